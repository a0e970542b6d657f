"""Segmentation: the ship's silhouette in a passive-infrared image."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require

METHODS = ("matched", "otsu", "li", "isodata")

_BETA = 0.5  # log-odds that a neighbour's being ship adds, of the Ising prior
_PASSES = 10
_LEAST, _MOST = 1e-6, 1e6  # K, of the sigmas
_HUGE = 1e30  # K; in sigmas its square is still a number

# Neighbours within an image of a stack, none between images.
_EIGHT = np.zeros((3, 3, 3), dtype=bool)
_EIGHT[1] = True
_FOUR = np.zeros((3, 3, 3), dtype=bool)
_FOUR[1, 1, :] = _FOUR[1, :, 1] = True

Mask = NDArray[np.bool_]
Floats = NDArray[np.float64]


def segment(
    image: ArrayLike,
    *,
    method: str = "matched",
    contrast: ArrayLike | None = None,
    target_sigma: ArrayLike | None = None,
    sea_sigma: ArrayLike | None = None,
) -> Mask:
    """The ship's silhouette in a passive-infrared image.

    Parameters
    ----------
    image : (..., row, col) array_like
        Apparent temperature above the mean of the sea [K]. Images of a stack are cut one by
        one, in less time than as many calls and with the same result.
    method : str
        `matched`: each pixel's likelihood ratio of ship to sea, whose distributions are
        known, smoothed by what its neighbours are. `otsu`, `li`, `isodata`: a threshold that
        scikit-image finds from the image alone.
    contrast : float or (...) array_like, optional
        Mean of the ship above the mean of the sea [K], 0 to 1e6; `matched` needs it, and the
        others do not look at it.
    target_sigma, sea_sigma : float or (...) array_like, optional
        Standard deviations of ship and sea, noise of the sensor included [K], 1e-6 to 1e6;
        as `contrast`.

    Returns
    -------
    (..., row, col) bool ndarray
        One 8-connected region an image, without holes: by `matched` the likeliest, by a
        threshold the largest (of equals, the first in order of rows). All False where nothing
        stands out: in a constant image and, by `matched`, where the contrast is 0.

    Raises
    ------
    ValueError
        If the image has no rows and columns or is not finite, the method is unknown, or
        `matched` lacks a parameter or has one out of range.

    Notes
    -----
    The article segments by a threshold which it does not state. `matched` is the best one for
    the two Gaussians of the article's Appendix 2, the zero of

        L(x) = ln N(x; contrast, target_sigma) - ln N(x; 0, sea_sigma),

    contrast / 2 when the sigmas are equal. When they are not, L is a parabola, which beyond
    its vertex would call a very cold pixel a ship, or a very hot one the sea: there L keeps
    its value at the vertex, so that it never falls with temperature, and it is at most 0
    where a pixel is no warmer than the sea.

    At low signal-to-noise ratio a threshold scatters. Iterated conditional modes (Besag 1986,
    doi:10.1111/j.2517-6161.1986.tb01412.x) therefore seek the mode of the posterior under an
    Ising prior (Geman and Geman 1984, doi:10.1109/TPAMI.1984.4767596): a pixel is ship where

        L(x) + beta (n - 4) > 0,  beta = 0.5,

    n of its 8 neighbours being ship (a pair that differs costs beta / 2 in log-probability),
    with sea all around the image. Pixels of one parity of row and of column are no neighbours
    and change together, the four such sets in turn (Besag's coding), so that the posterior
    never falls, until nothing changes or for 10 passes. Where |L| > 4 beta neighbours decide
    nothing. Pixels are assumed independent given what they show; mixed pixels at the ship's
    edge go to the likelier side.
    """
    # In one order of memory, in which the thresholds' sums are taken.
    values = np.asarray(image, dtype=np.float64, order="C")
    if values.ndim < 2 or values.size == 0:
        raise ValueError(f"image has shape {values.shape}, but must have rows and columns")
    if not np.isfinite(values).all():
        raise ValueError("image holds a value that is not finite, but must be all numbers")
    if not isinstance(method, str) or method not in METHODS:
        raise ValueError(f"method is {method!r}, but must be one of {', '.join(METHODS)}")
    stack = values.reshape(-1, *values.shape[-2:])
    if method == "matched":
        known = {"contrast": contrast, "target_sigma": target_sigma, "sea_sigma": sea_sigma}
        each = {name: _each(name, value, values.shape[:-2]) for name, value in known.items()}
        return _matched(stack, **each).reshape(values.shape)
    threshold = _threshold(method)
    target = np.array([_above(threshold, image) for image in stack])
    return _whole(target, weights=None).reshape(values.shape)


def _threshold(method: str) -> Callable[[Floats], float]:
    """Return the function that finds the threshold of one image."""
    # Imported where it is used: scikit-image and scipy take half a second.
    from skimage import filters

    found: dict[str, Callable[[Floats], float]] = {
        "otsu": filters.threshold_otsu,
        "li": filters.threshold_li,
        "isodata": filters.threshold_isodata,
    }
    return found[method]


def _above(threshold: Callable[[Floats], float], image: Floats) -> Mask:
    """Pixels of one image above the threshold found in it."""
    lowest, highest = image.min(), image.max()
    span = highest / 2 - lowest / 2  # halves, as the difference of huge values overflows
    if span < np.finfo(np.float64).tiny:
        return np.zeros(image.shape, dtype=bool)
    unit = (image / 2 - lowest / 2) / span  # the thresholds follow any gain and offset
    return np.asarray(unit > threshold(unit))


def _each(name: str, value: ArrayLike | None, shape: tuple[int, ...]) -> Floats:
    """A parameter of `matched` for every image of a stack, (image, 1, 1)."""
    if value is None:
        raise ValueError(f"{name} is None, but must be given in K for the method matched")
    for one in np.ravel(value).tolist():
        require(name, one, minimum=0.0 if name == "contrast" else _LEAST, maximum=_MOST)
    try:
        every = np.broadcast_to(np.asarray(value, dtype=np.float64), shape)
    except ValueError:
        raise ValueError(
            f"{name} has shape {np.shape(value)}, but must be a number or have the leading axes "
            f"of the image, {shape}"
        ) from None
    return every.reshape(-1, 1, 1)


def _matched(stack: Floats, *, contrast: Floats, target_sigma: Floats, sea_sigma: Floats) -> Mask:
    ratio = _log_likelihood_ratio(
        stack, contrast=contrast, target_sigma=target_sigma, sea_sigma=sea_sigma
    )
    target = ratio > 0
    # No ship is warmer than this sea, whatever the sigmas; or nothing tells one from the sea.
    span = np.ptp(stack, axis=(1, 2), keepdims=True)
    target &= (contrast > 0) & (span > 0)
    if not target.any():
        return target
    told = target.any(axis=(1, 2), keepdims=True)
    return _whole(_conditional_modes(target, np.where(told, ratio, -np.inf)), weights=ratio)


def _log_likelihood_ratio(
    stack: Floats, *, contrast: Floats, target_sigma: Floats, sea_sigma: Floats
) -> Floats:
    """L(x) of `segment`, monotone in x and at most 0 where x is."""
    # In units of the sea's sigma: the sea is N(0, 1), the ship N(mean, sigma).
    x = np.clip(stack, -_HUGE, _HUGE) / sea_sigma
    mean, sigma = contrast / sea_sigma, target_sigma / sea_sigma
    bent = sigma != 1.0
    if bent.any():
        # The vertex is hot when the ship varies less, else cold.
        vertex = mean / np.where(bent, 1.0 - sigma**2, 1.0)
        np.minimum(x, vertex, out=x, where=bent & (sigma < 1))
        np.maximum(x, vertex, out=x, where=bent & (sigma > 1))
    # x^2 - ((x - mean) / sigma)^2 as a product: their difference would lose all digits.
    ratio: Floats = x * (sigma - 1)
    ratio += mean
    x *= sigma + 1
    x -= mean
    ratio *= x
    ratio /= 2 * sigma**2
    ratio -= np.log(sigma)
    np.minimum(ratio, 0.0, out=ratio, where=stack <= 0)
    return ratio


def _conditional_modes(target: Mask, ratio: Floats) -> Mask:
    """Iterated conditional modes from `target`: see `segment`."""
    undecided = np.abs(ratio) <= 4 * _BETA
    if not undecided.any():
        return target
    images, rows, columns = target.shape
    width = columns + 2
    labels = np.zeros((images, rows + 2, width), dtype=np.uint8)
    labels[:, 1:-1, 1:-1] = target
    flat = labels.reshape(-1)
    around = np.array([-width - 1, -width, -width + 1, -1, 1, width - 1, width, width + 1])
    image, row, column = np.unravel_index(np.flatnonzero(undecided), target.shape)
    place = (image * (rows + 2) + row + 1) * width + column + 1
    # Ships among the neighbours, of which there must be more; small integers sum the quickest.
    bar = np.clip(4.0 - ratio[undecided] / _BETA, 0.0, 8.0).astype(np.uint8)
    parity = 2 * (row % 2) + column % 2
    sets = []
    for chosen in (np.flatnonzero(parity == k) for k in range(4)):
        if chosen.size:
            sets.append((place[chosen], place[chosen] + around[:, None], bar[chosen]))
    unchanged = 0
    for here, neighbours, least in sets * _PASSES:
        now = np.add.reduce(flat.take(neighbours), axis=0, dtype=np.uint8) > least
        unchanged = unchanged + 1 if (now == flat.take(here)).all() else 0
        if unchanged == len(sets):
            break
        flat[here] = now
    return labels[:, 1:-1, 1:-1].astype(bool)


def _whole(target: Mask, *, weights: Floats | None) -> Mask:
    """The 8-connected region of greatest weight (pixels, without weights), its holes filled."""
    from scipy import ndimage

    regions, count = ndimage.label(target, structure=_EIGHT)
    if count == 0:
        return np.zeros(target.shape, dtype=bool)
    flat = regions.reshape(-1)
    weight = np.bincount(flat, None if weights is None else weights.reshape(-1), count + 1)[1:]
    ships = np.flatnonzero(flat)
    image = np.zeros(count, dtype=np.intp)
    image[flat[ships] - 1] = ships // target[0].size
    # The heaviest of each image, of equals the one numbered first, which is the first in rows.
    order = np.lexsort((-weight, image))
    there, first = np.unique(image[order], return_index=True)
    chosen = np.full((len(target), 1, 1), -1)
    chosen[there, 0, 0] = order[first] + 1
    region: Mask = regions == chosen
    # What four-connected sea cannot reach from outside is a hole.
    sea = np.ones((len(target), target.shape[1] + 2, target.shape[2] + 2), dtype=bool)
    np.logical_not(region, out=sea[:, 1:-1, 1:-1])
    outside, parts = ndimage.label(sea, structure=_FOUR)
    if parts > len(target):
        region = (outside != outside[:, :1, :1])[:, 1:-1, 1:-1]
    return region

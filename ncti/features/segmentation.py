"""Segmentation: the ship's silhouette in a passive-infrared image."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage
from skimage import filters

from ncti.checks import require

METHODS = ("matched", "otsu", "li", "isodata")

_THRESHOLDS: dict[str, Callable[[NDArray[np.float64]], float]] = {
    "otsu": filters.threshold_otsu,
    "li": filters.threshold_li,
    "isodata": filters.threshold_isodata,
}
_BETA = 0.5  # log-odds that a neighbour's being ship adds, of the Ising prior
_PASSES = 10
_LEAST, _MOST = 1e-6, 1e6  # K, of the sigmas
_HUGE = 1e30  # K; in sigmas its square is still a number

_EIGHT = np.ones((3, 3), dtype=bool)
_FOUR = ndimage.generate_binary_structure(2, 1)

Mask = NDArray[np.bool_]
Floats = NDArray[np.float64]


def segment(
    image: ArrayLike,
    *,
    method: str = "matched",
    contrast: float | None = None,
    target_sigma: float | None = None,
    sea_sigma: float | None = None,
) -> Mask:
    """The ship's silhouette in a passive-infrared image.

    Parameters
    ----------
    image : (row, col) array_like
        Apparent temperature above the mean of the sea [K].
    method : str
        `matched`: each pixel's likelihood ratio of ship to sea, whose distributions are
        known, smoothed by what its neighbours are. `otsu`, `li`, `isodata`: a threshold that
        scikit-image finds from the image alone.
    contrast : float, optional
        Mean of the ship above the mean of the sea [K], 0 to 1e6; `matched` needs it.
    target_sigma, sea_sigma : float, optional
        Standard deviations of ship and sea, noise of the sensor included [K], 1e-6 to 1e6;
        `matched` needs them.

    Returns
    -------
    (row, col) bool ndarray
        One 8-connected region without holes: by `matched` the likeliest, by a threshold the
        largest (of equals, the first in order of rows). All False where nothing stands out,
        as in a constant image, or where the contrast is 0.

    Raises
    ------
    ValueError
        If the image is not two-dimensional or not finite, the method is unknown, or `matched`
        lacks a parameter or has one out of range.

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
    values = np.asarray(image, dtype=np.float64)
    if values.ndim != 2 or values.size == 0:
        raise ValueError(f"image has shape {values.shape}, but must have rows and columns")
    if not np.isfinite(values).all():
        raise ValueError("image holds a value that is not finite, but must be all numbers")
    if method == "matched":
        return _matched(values, contrast=contrast, target_sigma=target_sigma, sea_sigma=sea_sigma)
    if method not in _THRESHOLDS:
        raise ValueError(f"method is {method!r}, but must be one of {', '.join(METHODS)}")
    lowest, highest = values.min(), values.max()
    span = highest / 2 - lowest / 2  # halves, as the difference of huge values overflows
    if span < np.finfo(np.float64).tiny:
        return np.zeros(values.shape, dtype=bool)
    unit = (values / 2 - lowest / 2) / span  # the thresholds follow any gain and offset
    return _whole(unit > _THRESHOLDS[method](unit), weights=None)


def _matched(
    values: Floats,
    *,
    contrast: float | None,
    target_sigma: float | None,
    sea_sigma: float | None,
) -> Mask:
    known = {"contrast": contrast, "target_sigma": target_sigma, "sea_sigma": sea_sigma}
    for name, value in known.items():
        if value is None:
            raise ValueError(f"{name} is None, but must be given in K for the method matched")
        require(name, value, minimum=0.0 if name == "contrast" else _LEAST, maximum=_MOST)
    assert contrast is not None
    assert target_sigma is not None
    assert sea_sigma is not None
    # No ship is warmer than this sea, whatever the sigmas; or nothing tells one from the sea.
    if contrast == 0 or values.min() == values.max():
        return np.zeros(values.shape, dtype=bool)
    ratio = _log_likelihood_ratio(
        values, contrast=contrast, target_sigma=target_sigma, sea_sigma=sea_sigma
    )
    target = ratio > 0
    if not target.any():
        return target
    return _whole(_conditional_modes(target, ratio), weights=ratio)


def _log_likelihood_ratio(
    values: Floats, *, contrast: float, target_sigma: float, sea_sigma: float
) -> Floats:
    """L(x) of `segment`, monotone in x and at most 0 where x is."""
    # In units of the sea's sigma: the sea is N(0, 1), the ship N(mean, sigma).
    x = np.clip(values, -_HUGE, _HUGE) / sea_sigma
    mean, sigma = contrast / sea_sigma, target_sigma / sea_sigma
    if sigma != 1.0:
        vertex = mean / (1.0 - sigma**2)  # hot when the ship varies less, else cold
        x = np.minimum(x, vertex) if vertex > 0 else np.maximum(x, vertex)
    # x^2 - ((x - mean) / sigma)^2 as a product: their difference would lose all digits.
    ratio: Floats = (x * (sigma - 1) + mean) * (x * (sigma + 1) - mean) / (2 * sigma**2)
    ratio -= math.log(sigma)
    np.minimum(ratio, 0.0, out=ratio, where=values <= 0)
    return ratio


def _conditional_modes(target: Mask, ratio: Floats) -> Mask:
    """Iterated conditional modes from `target`: see `segment`."""
    undecided = np.abs(ratio) <= 4 * _BETA
    if not undecided.any():
        return target
    rows, columns = target.shape
    width = columns + 2
    labels = np.zeros((rows + 2, width), dtype=np.uint8)
    labels[1:-1, 1:-1] = target
    flat = labels.reshape(-1)
    around = np.array([-width - 1, -width, -width + 1, -1, 1, width - 1, width, width + 1])
    # Ships among the neighbours, of which there must be more; small integers sum the quickest.
    bar = np.floor(np.clip(4.0 - ratio / _BETA, 0.0, 8.0)).astype(np.uint8)
    sets = []
    for first_row, first_column in ((0, 0), (0, 1), (1, 0), (1, 1)):
        part = (slice(first_row, None, 2), slice(first_column, None, 2))
        row, column = undecided[part].nonzero()
        if row.size:
            place = (2 * row + first_row + 1) * width + 2 * column + first_column + 1
            sets.append((place, place + around[:, None], bar[part][row, column]))
    unchanged = 0
    for place, neighbours, least in sets * _PASSES:
        now = np.add.reduce(flat.take(neighbours), axis=0, dtype=np.uint8) > least
        unchanged = unchanged + 1 if (now == flat.take(place)).all() else 0
        if unchanged == len(sets):
            break
        flat[place] = now
    return labels[1:-1, 1:-1].astype(bool)


def _whole(target: Mask, *, weights: Floats | None) -> Mask:
    """The 8-connected region of greatest weight (pixels, without weights), its holes filled."""
    regions, count = ndimage.label(target, structure=_EIGHT)
    if count == 0:
        return np.zeros(target.shape, dtype=bool)
    flat = regions.reshape(-1)
    weight = np.bincount(flat, None if weights is None else weights.reshape(-1), count + 1)
    region: Mask = regions == 1 + int(weight[1:].argmax())
    # What four-connected sea cannot reach from outside is a hole.
    sea = np.ones((target.shape[0] + 2, target.shape[1] + 2), dtype=bool)
    np.logical_not(region, out=sea[1:-1, 1:-1])
    outside, parts = ndimage.label(sea, structure=_FOUR)
    if parts > 1:
        region = (outside != outside[0, 0])[1:-1, 1:-1]
    return region

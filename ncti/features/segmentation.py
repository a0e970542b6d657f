"""Segmentation of passive-infrared images: the silhouette of the ship."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require_all, require_word

METHODS = ("matched", "otsu", "li", "isodata")

_BETA = 0.5  # log-odds that each neighbour on the ship adds, under the Ising prior
_PASSES = 10
_MIN, _MAX = 1e-6, 1e6  # K, limits of the sigmas
_MAX_TEMPERATURE = 1e30  # K; its square in units of the smallest sigma is still finite

# Neighbours within an image of a stack, none between images.
_EIGHT_CONNECTED = np.zeros((3, 3, 3), dtype=bool)
_EIGHT_CONNECTED[1] = True
_FOUR_CONNECTED = np.zeros((3, 3, 3), dtype=bool)
_FOUR_CONNECTED[1, 1, :] = _FOUR_CONNECTED[1, :, 1] = True

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
    """Return the silhouette of the ship in a passive-infrared image.

    Parameters
    ----------
    image : (..., row, col) array_like
        Apparent temperature above the mean of the sea [K]. A stack of images gives the same
        result as one call for each, in less time.
    method : str
        `matched`: likelihood ratio of ship to sea in each pixel, for known distributions, smoothed
        over neighbours. `otsu`, `li`, `isodata`: a threshold that scikit-image, an extra, derives
        from the image alone.
    contrast : float or (...) array_like, optional
        Mean of the ship above the mean of the sea [K], 0 to 1e6. Required by `matched`, ignored
        by the other methods.
    target_sigma, sea_sigma : float or (...) array_like, optional
        Standard deviations of ship and sea, sensor noise included [K], 1e-6 to 1e6. Required by
        `matched`, ignored by the other methods.

    Returns
    -------
    (..., row, col) bool ndarray
        One 8-connected region without holes per image: with `matched` the most likely one, with a
        threshold the largest (of equals, the first in order of rows). All False if nothing stands
        out: in a constant image and, with `matched`, at zero contrast.

    Raises
    ------
    ValueError
        If the image has no rows and columns or is not finite, the method is unknown, or
        `matched` lacks a parameter or has one out of range.
    ImportError
        If a threshold needs scikit-image, which is not installed.

    See Also
    --------
    log_polar : Log-polar map of a silhouette.
    ncti.infrared : Simulated infrared images.

    Notes
    -----
    The article segments with a threshold that it does not state. `matched` is the optimal one for
    the two Gaussians of [1]_, the zero of

        L(x) = ln N(x; contrast, target_sigma) - ln N(x; 0, sea_sigma),

    which is contrast / 2 for equal sigmas. For unequal sigmas L is a parabola, which beyond its
    vertex would assign very cold pixels to the ship, or very hot ones to the sea. There L keeps
    its value at the vertex, so that it never falls with temperature, and it is at most 0 for
    pixels no warmer than the sea.

    At low signal-to-noise ratio a threshold alone gives scattered pixels. Iterated conditional
    modes [2]_ therefore search for the mode of the posterior under an Ising prior [3]_. A pixel
    belongs to the ship if

        L(x) + beta (n - 4) > 0,  beta = 0.5,

    with n the number of its 8 neighbours on the ship (a pair that differs costs beta / 2 in
    log-probability) and sea around the image. Pixels of equal parity of row and of column are not
    neighbours and are updated together, the four such sets in turn (the coding of [2]_), so that
    the posterior never falls. Iteration ends if nothing changes, or after 10 passes. Where
    |L| > 4 beta, neighbours have no influence. Pixels are assumed independent given their
    class; mixed pixels at the edge of the ship go to the more likely class.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, Appendix 2.
    .. [2] J. Besag, "On the statistical analysis of dirty pictures", Journal of the Royal
       Statistical Society B 48, 259-302 (1986), doi:10.1111/j.2517-6161.1986.tb01412.x.
    .. [3] S. Geman and D. Geman, "Stochastic relaxation, Gibbs distributions, and the Bayesian
       restoration of images", IEEE Transactions on Pattern Analysis and Machine Intelligence 6,
       721-741 (1984), doi:10.1109/TPAMI.1984.4767596.

    Examples
    --------
    A target of 400 pixels, three standard deviations above the sea. A threshold half way between
    the two errs in 153 of 2,400 pixels, the segmentation in 10:

    >>> import numpy as np
    >>> from ncti.features import segment
    >>> target = np.zeros((40, 60), dtype=bool)
    >>> target[15:25, 10:50] = True
    >>> noise = np.random.default_rng(0).normal(scale=0.1, size=target.shape)
    >>> image = 0.3 * target + noise
    >>> int(((image > 0.15) != target).sum())
    153
    >>> mask = segment(image, contrast=0.3, target_sigma=0.1, sea_sigma=0.1)
    >>> int((mask != target).sum())
    10
    """
    # In C order, so that the sums behind a threshold are always taken in the same order.
    values = np.asarray(require_all("image", image), order="C")
    if values.ndim < 2 or values.size == 0:
        raise ValueError(f"image has shape {values.shape}, but must have rows and columns")
    require_word("method", method, METHODS)
    stack = values.reshape(-1, *values.shape[-2:])
    if method == "matched":
        known = {"contrast": contrast, "target_sigma": target_sigma, "sea_sigma": sea_sigma}
        parameters = {
            name: _parameter_stack(name, value, values.shape[:-2]) for name, value in known.items()
        }
        return _matched_silhouettes(stack, **parameters).reshape(values.shape)
    threshold = getattr(_import_filters(), f"threshold_{method}")
    return largest_region([_pixels_above(threshold, image) for image in stack]).reshape(
        values.shape
    )


def largest_region(targets: ArrayLike) -> Mask:
    """Return the largest 8-connected region of each (image, row, col) mask, without holes."""
    return _heaviest_region(np.asarray(targets, dtype=bool), weights=None)


def _import_filters() -> Any:
    """Return the module of thresholds; `ImportError` if scikit-image is not installed."""
    try:
        from skimage import filters
    except ImportError as error:
        raise ImportError(
            "thresholds of images need scikit-image: pip install 'ncti-sweep[segmentation]'"
        ) from error
    return filters


def _pixels_above(threshold: Callable[[Floats], float], image: Floats) -> Mask:
    """Return the pixels of one image above the threshold derived from it."""
    lowest, highest = image.min(), image.max()
    span = highest / 2 - lowest / 2  # halves, because the difference of huge values may overflow
    if span < np.finfo(np.float64).tiny:
        return np.zeros(image.shape, dtype=bool)
    unit = (image / 2 - lowest / 2) / span  # the thresholds are covariant with gain and offset
    return np.asarray(unit > threshold(unit))


def _parameter_stack(name: str, value: ArrayLike | None, shape: tuple[int, ...]) -> Floats:
    """Return a parameter of `matched` for every image of a stack, (image, 1, 1)."""
    if value is None:
        raise ValueError(f"{name} is None, but must be given in K for the method matched")
    minimum = 0.0 if name == "contrast" else _MIN
    values = require_all(name, value, minimum=minimum, maximum=_MAX)
    try:
        full = np.broadcast_to(values, shape)
    except ValueError:
        raise ValueError(
            f"{name} has shape {np.shape(value)}, but must be a number or have the leading axes "
            f"of the image, {shape}"
        ) from None
    return full.reshape(-1, 1, 1)


def _matched_silhouettes(
    stack: Floats, *, contrast: Floats, target_sigma: Floats, sea_sigma: Floats
) -> Mask:
    """Return the silhouettes of a (image, row, col) stack by the method `matched`."""
    ratio = _log_likelihood_ratio(
        stack, contrast=contrast, target_sigma=target_sigma, sea_sigma=sea_sigma
    )
    target = ratio > 0
    # Without contrast there is no ship for any sigmas, and none in a constant image.
    span = np.ptp(stack, axis=(1, 2), keepdims=True)
    target &= (contrast > 0) & (span > 0)
    if not target.any():
        return target
    has_ship = target.any(axis=(1, 2), keepdims=True)
    return _heaviest_region(
        _conditional_modes(target, np.where(has_ship, ratio, -np.inf)), weights=ratio
    )


def _log_likelihood_ratio(
    stack: Floats, *, contrast: Floats, target_sigma: Floats, sea_sigma: Floats
) -> Floats:
    """Return L(x) of `segment`, monotone in x and at most 0 for x <= 0."""
    # In units of the sigma of the sea: the sea is N(0, 1), the ship N(mean, sigma).
    x = np.clip(stack, -_MAX_TEMPERATURE, _MAX_TEMPERATURE) / sea_sigma
    mean, sigma = contrast / sea_sigma, target_sigma / sea_sigma
    bent = sigma != 1.0
    if bent.any():
        # The vertex is on the hot side if the ship varies less than the sea, else on the cold side.
        vertex = mean / np.where(bent, 1.0 - sigma**2, 1.0)
        np.minimum(x, vertex, out=x, where=bent & (sigma < 1))
        np.maximum(x, vertex, out=x, where=bent & (sigma > 1))
    # x^2 - ((x - mean) / sigma)^2 as a product, because the difference would lose all digits.
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
    """Return the result of iterated conditional modes started at `target`; see `segment`."""
    is_undecided = np.abs(ratio) <= 4 * _BETA
    if not is_undecided.any():
        return target
    # Labels with a border of sea, flat, so that neighbours are at fixed offsets.
    images, rows, columns = target.shape
    width = columns + 2
    labels = np.zeros((images, rows + 2, width), dtype=np.uint8)
    labels[:, 1:-1, 1:-1] = target
    flat = labels.reshape(-1)
    around = np.array([-width - 1, -width, -width + 1, -1, 1, width - 1, width, width + 1])
    image, row, column = np.unravel_index(np.flatnonzero(is_undecided), target.shape)
    place = (image * (rows + 2) + row + 1) * width + column + 1
    # Number of ship neighbours that must be exceeded; small integers are the fastest to sum.
    bar = np.clip(4.0 - ratio[is_undecided] / _BETA, 0.0, 8.0).astype(np.uint8)
    # Four sets of pixels that are not neighbours, which are updated in turn until all are stable.
    parity = 2 * (row % 2) + column % 2
    sets = []
    for chosen in (np.flatnonzero(parity == k) for k in range(4)):
        if chosen.size:
            sets.append((place[chosen], place[chosen] + around[:, None], bar[chosen]))
    unchanged = 0
    for pixels, neighbours, threshold in sets * _PASSES:
        on_ship = np.add.reduce(flat.take(neighbours), axis=0, dtype=np.uint8) > threshold
        unchanged = unchanged + 1 if (on_ship == flat.take(pixels)).all() else 0
        if unchanged == len(sets):
            break
        flat[pixels] = on_ship
    return labels[:, 1:-1, 1:-1].astype(bool)


def _heaviest_region(target: Mask, *, weights: Floats | None) -> Mask:
    """Return the 8-connected region of largest weight, by default of most pixels, without holes."""
    from scipy import ndimage

    regions, count = ndimage.label(target, structure=_EIGHT_CONNECTED)
    if count == 0:
        return np.zeros(target.shape, dtype=bool)
    flat = regions.reshape(-1)
    weight = np.bincount(flat, None if weights is None else weights.reshape(-1), count + 1)[1:]
    ships = np.flatnonzero(flat)
    image = np.zeros(count, dtype=np.intp)
    image[flat[ships] - 1] = ships // target[0].size
    # The heaviest region of each image; of equals the one with the lowest number, first in rows.
    order = np.lexsort((-weight, image))
    numbers, first = np.unique(image[order], return_index=True)
    chosen = np.full((len(target), 1, 1), -1)
    chosen[numbers, 0, 0] = order[first] + 1
    region: Mask = regions == chosen
    # Sea that is not 4-connected to the outside is a hole.
    sea = np.ones((len(target), target.shape[1] + 2, target.shape[2] + 2), dtype=bool)
    np.logical_not(region, out=sea[:, 1:-1, 1:-1])
    outside, parts = ndimage.label(sea, structure=_FOUR_CONNECTED)
    if parts > len(target):
        region = (outside != outside[:, :1, :1])[:, 1:-1, 1:-1]
    return region

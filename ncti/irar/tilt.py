"""Residual tilt: the lean of masts and waterline that remains in a corrected image."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.irar.tilt_fit import START, fit_place

if TYPE_CHECKING:
    from ncti.irar.seen import Looks, Truth

MIN_CELLS = 4  # of the truth along a pixel
_MARGIN = 8  # pixels of sea around the ship that are fitted
_KNEE = 0.3  # share of the ship's brightness at which the first search saturates
_MIN_SCATTER = 0.02  # share of the model: error of area averages over finite cells
# Footprints of five rays a side resolve an edge to 0.2 / sqrt(12) pixels. Resulting errors of
# noiseless passes: scatter, as a share of the model, and lean, in pixels over the ship's length.
_SAMPLED_SCATTER, _SAMPLED_LEAN = 0.05, 0.03

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Tilt:
    """Lean of an image against the truth.

    Attributes
    ----------
    mast : float
        Tilt of upright lines of the truth [deg], positive to the right; NaN if a channel of the
        image shows nothing of the ship.
    waterline : float
        Tilt of level lines of the truth [deg], positive if rising to the right; NaN likewise.
    mast_error, waterline_error : float
        Standard errors of the two [deg], from the fit's residuals and, if places are given, the
        footprints of the samples. For distortions other than a shear, or for tilts of much more
        than a few degrees, tilts and errors are wrong by degrees.

    See Also
    --------
    tilts : Measure the tilt of an image.

    Examples
    --------
    >>> Tilt(5.1, 0.0, 0.1, 0.01).mast
    5.1
    """

    mast: float
    waterline: float
    mast_error: float
    waterline_error: float


_NONE = Tilt(*[math.nan] * 4)


def tilts(
    image: ArrayLike,
    truth: ArrayLike,
    *,
    places: tuple[ArrayLike, ArrayLike] | None = None,
) -> Tilt:
    """Measure the tilt of masts and waterline in an image against the true image.

    Parameters
    ----------
    image : (row, column) or (channel, row, column) array_like
        Intensity, in any unit, rows from the bottom up; NaN where it is unknown. Channels, such as
        the active and the passive image, are of the same samples at the same places and have one
        tilt.
    truth : (row * k, column * k) or (channel, row * k, column * k) array_like
        The same view without noise, in any unit, each pixel resolved into k x k cells, k whole and
        at least 4; NaN counts as 0. The error for an exactly sheared image falls with the cells:
        below 0.02 deg with k = 8, 0.05 deg with k = 4.
    places : (...) array_like and (...) array_like, optional
        Row and column of each sample that the image averages, from the middle of the first pixel
        [pixel]; NaN for a sample outside. Each cell of the truth must then show a sample's
        footprint. When not given, the samples of a pixel are assumed to be spread evenly, and cells
        show their own area.

    Returns
    -------
    Tilt
        The two tilts and their standard errors.

    Raises
    ------
    ValueError
        If the shapes do not match, a value is infinite or a truth is empty.

    See Also
    --------
    true_snapshot : The truth of a flight.
    correct : The image of a flight.

    Notes
    -----
    The article judges its corrections by straight masts and a horizontal waterline [1]_. Both
    defects (motion and mirror rotation) leave a shear, and a wrong closing speed stretches the
    rows, so the image is modelled as

        column' = right + b column + m row,  row' = up + a row + w column

    about the centre, with tan(mast) = m / a and tan(waterline) = w / b, and gain and offset free
    for each channel. Every look is mapped back to its place in the truth, and pixels are means of
    looks.

    Samples of a line are a pixel apart, so the looks of a pixel are at nearly the same place across
    it if the ship hardly drifts. That place changes with the drift from row to row: a shear within
    each column, absent from evenly sampled pixels, which appears as up to half a degree of mast
    tilt on ships seen from abeam. Mapped back by their places, looks of noiseless passes at 3 to 4
    km lean by less than 0.1 deg, mast and waterline.

    At 20 dB speckle alone hides the waterline of a ship 20 pixels wide to within 0.25 deg, and
    peaks of speckle make decks brighter than in the truth. The passive image has the same samples
    at the same places, and any residual tilt is in both images. Both are therefore fitted with one
    tilt, each weighted by its own noise.

    Speckle scatters in proportion to intensity, so residuals are weighted by the model plus a
    floor, and by Tukey's biweight, which rejects lines and columns that show something else.
    Neither notices a misfit of whole pixels, so the fit starts from Theil-Sen lines through the
    best shifts of whole rows and columns, with a floor at which no residual is an outlier, and
    lowers the floor in stages. The standard errors assume independent pixels.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, 'Data Processing'.

    Examples
    --------
    A hull and a mast, sheared by 5 deg to the right and with speckle of 50 looks:

    >>> import numpy as np
    >>> k = 8
    >>> truth = np.zeros((24 * k, 40 * k))
    >>> truth[4 * k : 8 * k, 6 * k : 34 * k] = 1.0
    >>> truth[8 * k : 20 * k, 19 * k : 21 * k] = 1.0
    >>> shift = np.round(np.tan(np.radians(5)) * (np.arange(24 * k) - 12 * k)).astype(int)
    >>> sheared = np.stack([np.roll(line, by) for line, by in zip(truth, shift)])
    >>> image = sheared.reshape(24, k, 40, k).mean(axis=(1, 3))
    >>> image *= np.random.default_rng(0).gamma(50, 1 / 50, image.shape)
    >>> tilt = tilts(image, truth)
    >>> print(f"{tilt.mast:.0f} +- {tilt.mast_error:.1f} deg")
    5 +- 0.1 deg
    """
    from ncti.irar.seen import Looks, Truth

    observed, cells, known = _checked_images(image, truth)
    rows, columns = observed.shape[1:]
    factor = cells.shape[1] // rows

    # Brightness in units of the ship's, in the image and in the truth.
    for channel, ship in zip(observed, cells, strict=True):
        averaged = ship.reshape(rows, factor, columns, factor).mean(axis=(1, 3))
        level, truth_level = _measure_brightness(channel, averaged)
        if not level > 0:
            return _NONE
        channel /= level
        ship /= truth_level

    min_scatter, lean = (_MIN_SCATTER, 0.0) if places is None else (_SAMPLED_SCATTER, _SAMPLED_LEAN)
    if places is None:  # spread evenly over each pixel, one per cell
        row, column = ((np.arange(n * factor) + 0.5) / factor - 0.5 for n in (rows, columns))
        row, column = np.broadcast_arrays(row[:, None], column)
        places = row, column
    looks = Looks.of(places, observed.shape[1:])
    view = Truth(cells, factor)
    known &= looks.count.reshape(1, rows, columns) > 0

    # A first estimate from whole shifts, then a fit of the pixels around the ship.
    place = _starting_place(observed, view, looks)
    box = _ship_block(view.image(place, looks)[0])
    fit = fit_place(observed[:, *box], known[:, *box], view, looks.block(*box), place, min_scatter)
    if fit is None:
        return _NONE
    return _tilt(*fit, (lean / view.rows, lean / view.columns))


def _checked_images(image: ArrayLike, truth: ArrayLike) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Return copies of image and truth with channels and 0 for NaN, and the mask of known pixels.

    Shapes are (channel, row, column), (channel, row * k, column * k) and (channel, row, column).
    """
    observed, cells = _checked_image("image", image), _checked_image("truth", truth)
    rows, columns = observed.shape[1:]
    factor = cells.shape[1] // rows
    if factor < MIN_CELLS or cells.shape != (len(observed), rows * factor, columns * factor):
        raise ValueError(
            f"truth has shape {np.shape(truth)}, but must be a whole multiple of the image's, "
            f"{np.shape(image)}, {MIN_CELLS} or more"
        )
    known = ~np.isnan(observed)
    observed, cells = np.nan_to_num(observed), np.nan_to_num(cells)
    if not cells.any(axis=(1, 2)).all():
        raise ValueError("truth is 0 everywhere, but must show a ship")
    return observed, cells, known


def _tilt(place: Floats, covariance: Floats, footprints: tuple[float, float]) -> Tilt:
    """Return the image's tilt from the fitted place, which maps the image to the truth.

    `footprints` are the errors of mast and waterline by the footprints of samples [rad].
    """
    leans = []
    # Mast from columns a row, waterline from rows a column; errors by linear propagation.
    for lean, scale, footprint in ((2, 5, footprints[0]), (3, 4, footprints[1])):
        slope = -place[lean] / place[scale]
        change = np.zeros(6)
        change[lean], change[scale] = 1.0, slope
        error = math.sqrt(change @ covariance @ change) / abs(place[scale]) / (1.0 + slope**2)
        error = math.hypot(math.degrees(error), math.degrees(footprint))
        leans.append((math.degrees(math.atan(slope)), error))
    (mast, mast_error), (waterline, waterline_error) = leans
    return Tilt(mast, waterline, mast_error, waterline_error)


def _ship_block(model: Floats) -> tuple[slice, slice]:
    """Return rows and columns of the ship in an image, with a margin of sea."""
    lit = [np.flatnonzero((model > 0).any(axis=(0, axis))) for axis in (2, 1)]
    if not lit[0].size:
        return slice(None), slice(None)
    rows, columns = (slice(max(line[0] - _MARGIN, 0), line[-1] + 1 + _MARGIN) for line in lit)
    return rows, columns


def _starting_place(observed: Floats, view: Truth, looks: Looks) -> Floats:
    """Return a place from the best shifts of whole rows, then of whole columns."""
    from scipy.stats import theilslopes

    place = np.array(START)
    # Most of an image is dark, so its median deviation from 0 is noise: use the least noisy.
    best = int(np.median(np.abs(observed), axis=(1, 2)).argmin())
    saturated = _saturate(observed[best])
    for axis in (0, 1):
        # Best shift of each line, then a robust line through the shifts.
        model = _saturate(view.image(place, looks)[0][best])
        lines, shifts = _best_shifts(*(np.moveaxis(x, axis, 0) for x in (saturated, model)))
        if lines.size < 2:
            continue
        slope, intercept = theilslopes(shifts, lines - (saturated.shape[axis] - 1) / 2)[:2]
        # Rows are shifted to the right, by the masts' tilt; columns up, by the waterline's.
        place[1 - axis], place[2 + axis] = -intercept, -slope
    return place


def _best_shifts(image: Floats, model: Floats) -> tuple[Floats, Floats]:
    """Return the lines that contain part of the ship, and the best whole shift of each."""
    lines = np.flatnonzero(model.sum(axis=1) > 0.5)
    length = image.shape[1]
    padded = 2 * length
    # Cross-correlation of all lines at once, padded so that it does not wrap around.
    first = np.fft.rfft(image[lines] - image[lines].mean(axis=1, keepdims=True), padded)
    second = np.fft.rfft(model[lines] - model[lines].mean(axis=1, keepdims=True), padded)
    score = np.fft.irfft(first * second.conj(), padded)
    best = score.argmax(axis=1)
    return lines.astype(np.float64), np.where(best < length, best, best - padded).astype(float)


def _saturate(intensity: Floats) -> Floats:
    """Return intensity / (intensity + knee), which limits the weight of glints and faulty lines."""
    positive = np.maximum(intensity, 0.0)
    return positive / (positive + _KNEE)


def _measure_brightness(observed: Floats, truth: Floats) -> tuple[float, float]:
    """Return the typical brightness of the ship in the image and in the truth.

    Take the median of the n brightest pixels of each row, n the number of ship pixels in the truth,
    then the median over rows. The result depends neither on the ship's place in its row nor on a
    few faulty lines.
    """
    count = (truth > (truth**2).sum() / truth.sum() / 2).sum(axis=1)
    rows = np.flatnonzero(count >= min(4, count.max()))
    medians = []
    for intensity in (observed, truth):
        ordered = -np.sort(-intensity[rows], axis=1)
        medians.append(float(np.median(ordered[np.arange(rows.size), count[rows] // 2])))
    return medians[0], medians[1]


def _checked_image(name: str, values: ArrayLike) -> Floats:
    """Return a copy of intensities, (channel, row, column), NaN where there are none."""
    array = np.array(values, dtype=np.float64)
    if array.ndim not in (2, 3) or 0 in array.shape:
        raise ValueError(f"{name} has shape {array.shape}, but must have rows and columns")
    if np.isinf(array).any():
        raise ValueError(f"{name} holds an infinite value, but must be numbers or NaN")
    return array if array.ndim == 3 else array[None]

"""Residual tilt: by how much the masts and the waterline of a corrected image still lean."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator
from scipy.stats import theilslopes

from ncti.checks import require

FINEST = 4  # cells of the truth along a pixel, at least
_KNEE = 0.3  # of the ship's brightness, at which the first search saturates
_SCHEDULE = (1.0, 0.5, 0.25, 0.12, 0.06)  # of that brightness: noise floors on the way down
_PASSES = 4  # at each of them
_MOST = 25  # passes at the last
_TUKEY = 4.685  # standard deviations; 95 % efficient for normal errors
_LEAST_SCATTER = 0.02  # of the model: what area averages of finite cells leave without noise
_SETTLED = 1e-6  # pixels a pixel
# (up, right, mast, waterline, height, width) of a perfect image, and the most a pass may move.
_START = (0.0, 0.0, 0.0, 0.0, 1.0, 1.0)  # pixels, pixels, and pixels a pixel
_STEP = (1.0, 1.0, 0.1, 0.1, 0.02, 0.02)

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Tilt:
    """How far an image leans against the truth.

    Attributes
    ----------
    mast : float
        Tilt of what is upright in the truth [deg], positive to the right; NaN where the image
        shows nothing of the ship.
    waterline : float
        Tilt of what is level in the truth [deg], positive rising to the right; NaN likewise.
    mast_error, waterline_error : float
        Standard errors of the two [deg], as the fit's residuals tell them.
    up, right : float
        Displacement at the centre of the image [pixel].
    """

    mast: float
    waterline: float
    mast_error: float
    waterline_error: float
    up: float
    right: float


def tilts(image: ArrayLike, truth: ArrayLike, *, floor: float = 0.03) -> Tilt:
    """Tilt of masts and waterline in an image, against the truth it should show.

    Parameters
    ----------
    image : (row, column) array_like
        Intensity, in any unit, rows growing upward; NaN where nothing is known.
    truth : (row * k, column * k) array_like
        The same view without noise, in any unit, each pixel resolved into k x k cells, k whole;
        NaN counts as 0. Where pixels average looks of a pixel's width, so must the cells be.
        What an exactly sheared image seems to lean grows with the cells: 0.02 deg with k = 8,
        0.05 deg with k = 4, 0.4 deg with k = 1. Of a ship 20 pixels wide, seen line by line from
        different places, the waterline is told to 0.2 deg only.
    floor : float
        Least error taken for granted beside speckle, as a share of the ship's brightness,
        above 0 and at most 1. Noise around the ship raises it.

    Returns
    -------
    Tilt
        The two tilts, their standard errors, and the displacement.

    Raises
    ------
    ValueError
        If the shapes do not fit, a value is infinite or the truth is empty.

    Notes
    -----
    Article, 'Data Processing' (motion distortions, mirror rotation), whose proof is that the
    mast is straight and the bottom of the ship horizontal. What both defects leave is a shear,
    and a wrong closing speed stretches the rows, so the image is taken as

        column' = right + b column + m row,  row' = up + a row + w column

    about the centre, tan(mast) = m / a and tan(waterline) = w / b, with gain and offset free.
    The truth's cells, squares of constant brightness, are so moved and laid upon the pixels,
    which averages areas as the sensor does; a truth hardly finer than the pixels is first
    resolved by monotone splines of its cumulative sums, which keep every pixel's sum.

    Speckle scatters in proportion to intensity, so residuals are weighed by the model plus the
    floor, and by Tukey's biweight, which leaves out lines and columns that show something
    else. Neither sees a misfit of pixels, so the fit starts from Theil-Sen lines through the
    best shifts of whole rows and columns, at a floor that lets no residual be an outlier, and
    lowers it by and by. The standard errors take the pixels as independent.
    """
    require("floor", floor, positive=True, maximum=1.0)
    seen, cells = _image("image", image), _image("truth", truth)
    known = ~np.isnan(seen)
    seen, cells = np.nan_to_num(seen), np.nan_to_num(cells)
    rows, columns = seen.shape
    factor = cells.shape[0] // rows
    if factor < 1 or cells.shape != (rows * factor, columns * factor):
        raise ValueError(
            f"truth has shape {cells.shape}, but must be a whole multiple of the image's, "
            f"{seen.shape}"
        )
    if not cells.any():
        raise ValueError("truth is 0 throughout, but must show a ship")
    coarse = _blocks(cells, factor)
    level, own = _levels(seen, coarse)
    if not level > 0:
        return Tilt(*[math.nan] * 6)
    refinement = -(-FINEST // factor)
    if refinement > 1:
        cells = _refined(_refined(cells, refinement).T, refinement).T
    ship = _Cells.of(cells / own, factor * refinement, seen.shape)
    return _fit(seen / level, known, ship, _start(seen / level, ship), floor)


@dataclass(frozen=True, eq=False)
class _Cells:
    """The bright cells of a truth: their places about the centre [pixel] and their brightness."""

    row: Floats
    column: Floats
    brightness: Floats
    side: float
    shape: tuple[int, int]

    @classmethod
    def of(cls, truth: Floats, factor: int, shape: tuple[int, int]) -> _Cells:
        row, column = np.nonzero(truth)
        return cls(
            row=(row + 0.5) / factor - shape[0] / 2,
            column=(column + 0.5) / factor - shape[1] / 2,
            brightness=truth[row, column] / factor**2,
            side=1.0 / factor,
            shape=shape,
        )

    def image(self, place: Floats) -> tuple[Floats, Floats]:
        """The image at a place (see `_START`), and its derivatives (row, column, 6)."""
        up, right, mast, waterline, height, width = place
        rows, columns = self.shape
        row = up + waterline * self.column + height * self.row
        column = right + mast * self.row + width * self.column
        bottom, low, d_low = self._overlap(row, rows)
        left, near, d_near = self._overlap(column, columns)
        sums = np.zeros((7, (rows + 3) * (columns + 3)))
        for above in (0, 1):
            in_row = low if above == 0 else 1.0 - low
            d_row = d_low if above == 0 else -d_low
            for beyond in (0, 1):
                in_column = near if beyond == 0 else 1.0 - near
                d_column = d_near if beyond == 0 else -d_near
                at = (bottom + above) * (columns + 3) + left + beyond
                d_up = self.brightness * d_row * in_column
                d_right = self.brightness * in_row * d_column
                for k, part in enumerate(
                    (
                        self.brightness * in_row * in_column,
                        d_up,
                        d_right,
                        d_right * self.row,
                        d_up * self.column,
                        d_up * self.row,
                        d_right * self.column,
                    )
                ):
                    sums[k] += np.bincount(at, part, sums.shape[1])
        whole = sums.reshape(7, rows + 3, columns + 3)[:, 1:-2, 1:-2]
        return whole[0], np.moveaxis(whole[1:], 0, -1)

    def _overlap(self, centre: Floats, pixels: int) -> tuple[NDArray[np.intp], Floats, Floats]:
        """The first of two pixels a cell may touch, bordered by one; its share of the cell.

        And that share's derivative, as a difference over a cell: cells that just fill a pixel
        would else seem not to move at all.
        """
        reach = self.side / 2
        start = centre - reach + pixels / 2
        first = np.floor(start - reach)
        share, before, after = (
            np.clip((first + 1.0 - moved) / self.side, 0.0, 1.0)
            for moved in (start, start - reach, start + reach)
        )
        inside = np.clip(first, -1, pixels).astype(np.intp)
        return inside + 1, share, (after - before) / self.side


def _fit(seen: Floats, known: NDArray[np.bool_], ship: _Cells, place: Floats, floor: float) -> Tilt:
    """Robust least squares from a start."""
    gain, offset, scatter = 1.0, 0.0, 1.0
    covariance = np.full((8, 8), np.nan)
    steps = [(level, _PASSES) for level in _SCHEDULE if level > floor] + [(floor, _MOST)]
    for level, passes in steps:
        for _ in range(passes):
            model, slopes = ship.image(place)
            lit, dark = (model > 0) & known, (model == 0) & known
            if lit.sum() < 8:
                return Tilt(*[math.nan] * 6)
            expected = gain * model + offset
            residual = seen - expected
            around = 1.4826 * np.median(np.abs(residual[dark])) if dark.any() else 0.0
            spread = np.maximum(expected, 0.0) + max(level, around / scatter)
            unit = residual / spread
            bright = lit & (model > model.max() / 5)
            scatter = max(1.4826 * np.median(np.abs(unit[bright])), _LEAST_SCATTER)
            weight = np.maximum(1.0 - (unit / (_TUKEY * scatter)) ** 2, 0.0) / spread
            weight *= known
            terms = np.concatenate(
                [gain * slopes, model[..., None], np.ones((*model.shape, 1))], axis=-1
            ).reshape(-1, 8)
            weighted = terms * weight.reshape(-1, 1)
            normal = np.linalg.pinv(weighted.T @ weighted, hermitian=True)
            change = normal @ (weighted.T @ (residual * weight).ravel())
            step = np.clip(change[:6], np.negative(_STEP), _STEP)
            place = place + step
            gain = float(np.clip(gain + change[6], 0.2, 5.0))
            offset = float(np.clip(offset + change[7], -0.5, 0.5))
            covariance = normal * scatter**2
            if np.abs(step).max() < _SETTLED:
                break
    error = np.degrees(np.sqrt(np.diag(covariance)))
    mast, waterline = np.degrees(np.arctan(place[2:4] / place[4:]))
    return Tilt(
        mast=float(mast),
        waterline=float(waterline),
        mast_error=float(error[2]),
        waterline_error=float(error[3]),
        up=float(place[0]),
        right=float(place[1]),
    )


def _start(seen: Floats, ship: _Cells) -> Floats:
    """(up, right, mast, waterline) from the best shifts of whole rows, then of whole columns."""
    place = np.array(_START)
    shown = _saturated(seen)
    for axis in (0, 1):
        model, _ = ship.image(place)
        lines, shifts = _best_shifts(*(np.moveaxis(x, axis, 0) for x in (shown, _saturated(model))))
        if lines.size < 2:
            continue
        slope, intercept = theilslopes(shifts, lines - (seen.shape[axis] - 1) / 2)[:2]
        # Rows are shifted to the right, by the masts' tilt; columns up, by the waterline's.
        place[1 - axis], place[2 + axis] = intercept, slope
    return place


def _best_shifts(shown: Floats, model: Floats) -> tuple[Floats, Floats]:
    """Lines in which the model has some of the ship, and the whole shift that fits each best."""
    lines = np.flatnonzero(model.sum(axis=1) > 0.5)
    length = shown.shape[1]
    padded = 2 * length
    first = np.fft.rfft(shown[lines] - shown[lines].mean(axis=1, keepdims=True), padded)
    second = np.fft.rfft(model[lines] - model[lines].mean(axis=1, keepdims=True), padded)
    score = np.fft.irfft(first * second.conj(), padded)
    best = score.argmax(axis=1)
    return lines.astype(np.float64), np.where(best < length, best, best - padded).astype(float)


def _saturated(intensity: Floats) -> Floats:
    """Intensity over itself and the knee: a glint or a garbled line has no more say than a hull."""
    positive = np.maximum(intensity, 0.0)
    return positive / (positive + _KNEE)


def _levels(seen: Floats, truth: Floats) -> tuple[float, float]:
    """Typical brightness of the ship in the image and in the truth.

    Row by row the median of as many brightest pixels as the truth has of the ship, of which
    the median over rows: wherever the ship lies in its row, garbled lines do not tell.
    """
    count = (truth > (truth**2).sum() / truth.sum() / 2).sum(axis=1)
    rows = np.flatnonzero(count >= min(4, count.max()))
    found = []
    for intensity in (seen, truth):
        ordered = -np.sort(-intensity[rows], axis=1)
        found.append(float(np.median(ordered[np.arange(rows.size), count[rows] // 2])))
    return found[0], found[1]


def _refined(cells: Floats, factor: int) -> Floats:
    """Each row of cells cut into more, as bright as smoothness and its own sum allow."""
    rows = cells.shape[0]
    total = np.concatenate([np.zeros((1, cells.shape[1])), cells.cumsum(axis=0)])
    edges = np.arange(rows * factor + 1) / factor
    finer = np.diff(PchipInterpolator(np.arange(rows + 1), total, axis=0)(edges), axis=0) * factor
    return np.maximum(finer, 0.0)


def _blocks(cells: Floats, factor: int) -> Floats:
    rows, columns = cells.shape[0] // factor, cells.shape[1] // factor
    averaged: Floats = cells.reshape(rows, factor, columns, factor).mean(axis=(1, 3))
    return averaged


def _image(name: str, values: ArrayLike) -> Floats:
    """Intensities, NaN where there are none."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 2 or 0 in array.shape:
        raise ValueError(f"{name} has shape {array.shape}, but must have rows and columns")
    if np.isinf(array).any():
        raise ValueError(f"{name} holds an infinite value, but must be numbers or NaN")
    return array

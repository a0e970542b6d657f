"""Segmentation of the active images: the ship stands out of the noise of the sea."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft

from ncti.checks import require, require_all

_STEP = 1 / 64  # noise powers, of one look's distribution
_BEYOND = 40.0  # noise powers above the median peak: a probability of exp(-40)


def segment(
    intensity: ArrayLike, range_: ArrayLike, *, threshold: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Intensity and range where the intensity reaches a threshold.

    Parameters
    ----------
    intensity : (...) array_like
        Averaged intensity in any unit, NaN where there is no look.
    range_ : (...) array_like
        Range of the same pixels [m].
    threshold : float or (...) array_like
        Least intensity of the ship, at least 0, in the same unit: one for all pixels or one a
        pixel.

    Returns
    -------
    intensity, range : (...) float64 ndarray
        Copies, 0 and NaN where the intensity is below the threshold or missing.

    Raises
    ------
    ValueError
        If the shapes differ or a threshold is negative or not finite.

    Notes
    -----
    Article, 'Data Enhancement and Compensation', which sets both images to zero there. Zero is a
    range too, that of the ship's origin: here a pixel without a range has NaN. The article
    does not state its threshold; `noise_threshold` gives one.
    """
    power = np.asarray(intensity, dtype=np.float64)
    distance = np.asarray(range_, dtype=np.float64)
    if power.shape != distance.shape:
        raise ValueError(
            f"range_ has shape {distance.shape}, but must have that of intensity, {power.shape}"
        )
    least = require_all("threshold", threshold, minimum=0.0)
    if least.ndim and least.shape != power.shape:
        raise ValueError(
            f"threshold has shape {least.shape}, but must be one number or have the shape of "
            f"intensity, {power.shape}"
        )
    ship = power >= least
    return np.where(ship, power, 0.0), np.where(ship, distance, math.nan)


def noise_threshold(*, cells: float, looks: int, false_alarm: float) -> float:
    """Intensity that the averaged noise of a pixel without a target seldom exceeds.

    Parameters
    ----------
    cells : float
        Independent range cells in the gate, of which a look reports the largest, 1 to 1e6.
    looks : int
        Independent looks in the average, 1 to 1000.
    false_alarm : float
        Probability that the average exceeds the threshold, 1e-9 to 0.5.

    Returns
    -------
    float
        Threshold in mean noise powers of a cell.

    Raises
    ------
    ValueError
        If a parameter is out of range.

    Notes
    -----
    Ours: the article states no threshold. The sea returns nothing, so that a peak-detecting
    sensor reports there the largest of M exponential noise powers,

        P(peak <= x) = (1 - exp(-x))^M,

    whose mean is the harmonic number H_M: averaging leaves a pedestal, 5.4 noise powers for 122
    cells, that no number of looks removes. The distribution of the sum over the looks is the
    M-cell one convolved with itself, here on a grid of 1/64 noise power.
    """
    require("cells", cells, minimum=1.0, maximum=1e6)
    require("looks", looks, whole=True, minimum=1, maximum=1000)
    require("false_alarm", false_alarm, minimum=1e-9, maximum=0.5)
    count = int(looks)
    steps = math.ceil((math.log(cells) + _BEYOND) / _STEP)
    edges = (np.arange(1, steps + 1) - 0.5) * _STEP
    # The tail itself: 1 - P would round it away.
    tail = np.append(1.0, -np.expm1(cells * np.log1p(-np.exp(-edges))))
    share = -np.diff(tail)
    # Of value j the sum takes what lies in (j - 1/2, j + 1/2] steps.
    size = fft.next_fast_len(count * steps, real=True)
    total = fft.irfft(fft.rfft(share, size) ** count, size)[: count * steps]
    above = np.cumsum(total[::-1])[::-1]
    # Above the edge j - 1/2 lies above[j]; it falls through false_alarm after the edge of `at`.
    at = int(np.flatnonzero(above > false_alarm)[-1])
    inside = (math.log(above[at]) - math.log(false_alarm)) / (
        math.log(above[at]) - math.log(above[at + 1])
    )
    return (at - 0.5 + inside) * _STEP / count

"""Segmentation of the active images: the ship stands out of the noise of the sea."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all
from ncti.irar.receiver import noise_below

_STEP = 1 / 32  # noise powers, of one look's distribution
_BEYOND = 40.0  # noise powers above the median peak: a probability of exp(-40)
_NEVER = 1e-300  # a probability that has a logarithm
_WRAPPED = 12.0  # of the false alarms exp(-12) may be wrapped ones


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


def noise_threshold(
    looks: ArrayLike, *, depth: float, pulse_length: float, dropout: float, false_alarm: float
) -> NDArray[np.float64]:
    """Intensity that the averaged noise of a pixel without a target seldom reaches.

    Parameters
    ----------
    looks : (...) array_like
        Independent looks in the average, dropouts among them, 1 to 100,000.
    depth : float
        Of the gate, of which a look reports the largest intensity [m].
    pulse_length : float
        c T / 2 [m].
    dropout : float
        Peaks below it, in noise powers, are not reported and count as 0.
    false_alarm : float
        Probability that the average reaches the threshold, 1e-9 to 0.5.

    Returns
    -------
    (...) float64 ndarray
        Threshold in mean noise powers. Where fewer averages than that hold any report at all, the
        least that one report makes.

    Raises
    ------
    ValueError
        If a parameter is out of range.

    Notes
    -----
    Ours: the article states no threshold. The sea returns nothing, so that a peak-detecting
    sensor reports there the largest intensity of its noise, distributed as `noise_below`:
    averaging leaves a pedestal, of 5.8 noise powers in a gate of 300 m for a pulse of 4.5 m, that
    no number of looks removes. The distribution of the sum over the looks is that of one look
    convolved with itself, here by its Fourier transform on a grid of 1/32 noise power, which moves
    the threshold by less than 1e-4 of itself. It falls with the looks, but for dropouts: where few
    peaks are reported, the number of reports that make an alarm goes up by steps.
    """
    counts = require_all("looks", looks, whole=True, minimum=1, maximum=100_000)
    require("depth", depth, minimum=0.0)
    require("pulse_length", pulse_length, positive=True)
    require("dropout", dropout, minimum=0.0)
    require("false_alarm", false_alarm, minimum=1e-9, maximum=0.5)
    if not counts.size:
        return counts
    # Imported where it is used: scipy takes a tenth of a second.
    from scipy import fft

    share, step = _noise_look(depth, pulse_length, dropout)
    numbers, place = np.unique(counts, return_inverse=True)
    # Far from the mean the sum has a tail no heavier than Bernstein's inequality allows; what is
    # left beyond wraps into the window at the other end.
    value = np.arange(len(share)) * step
    mean = share @ value
    rare = _WRAPPED - math.log(false_alarm)
    spread = np.sqrt(2 * rare * numbers * (share @ (value - mean) ** 2))
    jump = rare * (1 + mean + min(dropout, value[-1]) / 3)
    low = np.maximum((numbers * mean - spread - jump) / step, 0).astype(np.intp)
    width = 2 * float(spread[-1] + jump) / step
    size = fft.next_fast_len(max(math.ceil(width), len(share)), real=True)
    one = fft.rfft(share, size)
    sums = np.ones_like(one)
    found = np.empty(len(numbers))
    for i, further in enumerate(np.diff(numbers, prepend=0).astype(int).tolist()):
        sums *= one if further == 1 else one**further
        total = np.roll(fft.irfft(sums, size), -(low[i] % size))
        # Of the last k + 1 values the tail is above[k], beyond the lower edge of the first of them.
        above = np.cumsum(total[::-1])
        at = int(np.searchsorted(above, false_alarm, side="right"))
        more, less = above[at], max(above[at - 1], _NEVER)
        inside = math.log(more / false_alarm) / math.log(more / less)
        found[i] = (low[i] + size - 1.5 - at + inside) * step
    return (np.maximum(found, dropout) / numbers)[place].reshape(counts.shape)


def _noise_look(
    depth: float, pulse_length: float, dropout: float
) -> tuple[NDArray[np.float64], float]:
    """(value,) probabilities of 0, 1, 2 ... steps of one look of noise, and the step.

    A value j holds what lies in (j - 1/2, j + 1/2] steps; a dropout ends at such an edge.
    """
    # Beyond, one of a depth's crossings is as rare as exp(-40).
    top = math.log1p(depth / pulse_length) + _BEYOND
    least = min(dropout, top)
    first = max(1, round(least / _STEP))
    step = max(least, _STEP / 2) / (first - 0.5)
    edges = (np.arange(first, math.ceil(top / step) + 2, dtype=np.float64) - 0.5) * step
    below = noise_below(edges, depth=depth, pulse_length=pulse_length)
    share = np.zeros(first + len(edges))
    share[0] = below[0]
    share[first:] = np.diff(below, append=1.0)
    return share, step

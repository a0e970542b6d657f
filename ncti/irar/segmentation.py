"""Threshold between a ship and the noise of the sea, in active images."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncti.irar.receiver import noise_probability

_STEP = 1 / 32  # noise powers, of one look's distribution
_PEAK_MARGIN = 40.0  # noise powers above the median peak, with a probability of exp(-40)
_MIN_PROBABILITY = 1e-300  # least probability, so that its logarithm is finite
_WRAP_EXPONENT = 12.0  # a fraction exp(-12) of the false alarms may be wrapped around


def noise_threshold(
    looks: NDArray[np.intp],
    *,
    depth: float,
    pulse_length: float,
    dropout: float,
    false_alarm: float,
) -> NDArray[np.float64]:
    """Return the intensity (...) that averaged noise of a pixel without a target rarely reaches.

    `looks` (...) is the number of independent looks averaged, dropouts included; `depth` [m] is the
    gate's, `pulse_length` [m] c T / 2; peaks below `dropout` noise powers count as 0; `false_alarm`
    is the probability. The threshold is in mean noise powers, and at least `dropout` / `looks`: the
    average when one look reports a peak.

    A method of this project, as no threshold is published. The sea returns nothing, so a
    peak-detecting sensor reports the largest intensity of its noise there, with the distribution
    `noise_probability`. Averaging leaves a pedestal, of 5.8 noise powers in a gate of 300 m for a
    pulse of 4.5 m, whatever the number of looks. The distribution of the sum over looks is that of
    one look convolved with itself, by its Fourier transform on a grid of 1/32 noise power, which
    changes the threshold by less than 1e-4 of itself. The threshold falls with the number of looks,
    except for dropouts: where few peaks are reported, the number of reports that make an alarm
    rises in steps.
    """
    if not looks.size:
        return np.empty(looks.shape)
    from scipy import fft

    share, step = _discretise_noise(depth, pulse_length, dropout)
    numbers, place = np.unique(looks, return_inverse=True)
    # Window of the sum about its mean, by Bernstein's inequality. The rest of its distribution
    # wraps around into the window.
    value = np.arange(len(share)) * step
    mean = share @ value
    exponent = _WRAP_EXPONENT - math.log(false_alarm)
    spread = np.sqrt(2 * exponent * numbers * (share @ (value - mean) ** 2))
    linear_term = exponent * (1 + mean + min(dropout, value[-1]) / 3)
    low = np.maximum((numbers * mean - spread - linear_term) / step, 0).astype(np.intp)
    width = 2 * float(spread[-1] + linear_term) / step
    size = fft.next_fast_len(max(math.ceil(width), len(share)), real=True)
    # Distribution of the sum for each number of looks, in ascending order.
    single = fft.rfft(share, size)
    sums = np.ones_like(single)
    thresholds = np.empty(len(numbers))
    for i, added in enumerate(np.diff(numbers, prepend=0).astype(int).tolist()):
        sums *= single if added == 1 else single**added
        total = np.roll(fft.irfft(sums, size), -(low[i] % size))
        # above[k] is the probability of the last k + 1 values; interpolate it in its logarithm.
        above = np.cumsum(total[::-1])
        index = int(np.searchsorted(above, false_alarm, side="right"))
        upper, lower = above[index], max(above[index - 1], _MIN_PROBABILITY)
        inside = math.log(upper / false_alarm) / math.log(upper / lower)
        thresholds[i] = (low[i] + size - 1.5 - index + inside) * step
    return (np.maximum(thresholds, dropout) / numbers)[place].reshape(looks.shape)


def _discretise_noise(
    depth: float, pulse_length: float, dropout: float
) -> tuple[NDArray[np.float64], float]:
    """Return probabilities of 0, 1, 2 ... steps of one look of noise, (value,), and the step.

    Value j covers (j - 1/2, j + 1/2] steps; a dropout ends at such an edge.
    """
    # Above this level even one crossing in the gate has a probability below exp(-40).
    top = math.log1p(depth / pulse_length) + _PEAK_MARGIN
    lowest = min(dropout, top)
    first = max(1, round(lowest / _STEP))
    step = max(lowest, _STEP / 2) / (first - 0.5)
    edges = (np.arange(first, math.ceil(top / step) + 2, dtype=np.float64) - 0.5) * step
    below = noise_probability(edges, depth=depth, pulse_length=pulse_length)
    share = np.zeros(first + len(edges))
    share[0] = below[0]
    share[first:] = np.diff(below, append=1.0)
    return share, step

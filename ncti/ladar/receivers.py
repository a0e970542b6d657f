"""What a receiver keeps of the returned waveform: all of it, its first pulse, or its peak."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require

RECEIVERS = ("full_profile", "first_pulse", "peak_pulse")
FALSE_ALARM = 1e-6  # per range bin: one false first pulse in 4,000 IFOVs of 250 bins


def detect(
    amplitude: NDArray[np.floating],
    *,
    receiver: str,
    false_alarm: float = FALSE_ALARM,
) -> NDArray[np.floating]:
    """Waveforms as the receiver reports them.

    Parameters
    ----------
    amplitude : (..., bin) ndarray
        Detector output |l(n)| of one IFOV and frame along the last axis.
    receiver : str
        `full_profile` keeps the waveform. `peak_pulse` keeps only its largest value, in the
        bin where it occurs. `first_pulse` keeps only the first value above a threshold, and
        nothing where none is.
    false_alarm : float
        Probability that noise alone exceeds the first-pulse threshold in one bin, in (0, 1).

    Returns
    -------
    (..., bin) ndarray
        Amplitude reported in each bin, 0 elsewhere.

    Raises
    ------
    ValueError
        If the receiver is unknown or the probability outside (0, 1).

    Notes
    -----
    Article, 'Model for Laser Radar Range Profiles'. Noise alone is Rayleigh with variance
    s^2 = sqrt(pi/8) in each quadrature, so the threshold is s sqrt(-2 ln false_alarm).
    """
    if receiver not in RECEIVERS:
        raise ValueError(f"receiver is {receiver!r}, but must be one of {', '.join(RECEIVERS)}")
    if receiver == "full_profile":
        return amplitude
    kept = np.zeros_like(amplitude)
    if receiver == "peak_pulse":
        at = np.argmax(amplitude, axis=-1)[..., None]
        np.put_along_axis(kept, at, np.take_along_axis(amplitude, at, -1), -1)
        return kept
    require("false_alarm", false_alarm, positive=True, maximum=math.nextafter(1.0, 0.0))
    above = amplitude > math.sqrt(-2 * math.log(false_alarm) * math.sqrt(math.pi / 8))
    at = np.argmax(above, axis=-1)[..., None]
    first = np.where(np.take_along_axis(above, at, -1), np.take_along_axis(amplitude, at, -1), 0)
    np.put_along_axis(kept, at, first, -1)
    return kept

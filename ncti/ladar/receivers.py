"""Receivers: full waveform, first-pulse and peak-pulse detection."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require, require_word

RECEIVERS = ("full_profile", "first_pulse", "peak_pulse")
FALSE_ALARM = 1e-6  # per range bin: one false first pulse in 4,000 IFOVs of 250 bins


def detect(
    amplitude: NDArray[np.floating],
    *,
    receiver: str,
    false_alarm: float = FALSE_ALARM,
) -> NDArray[np.floating]:
    """Return (..., bin) waveforms as a receiver reports them, 0 where it reports nothing.

    `full_profile` keeps the waveform, `peak_pulse` its largest value in its bin, and `first_pulse`
    the first value above a threshold, if any. The article names them in "Model for Laser Radar
    Range Profiles". The magnitude of noise has a Rayleigh distribution with the variance s^2 =
    sqrt(pi/8) in each quadrature, so noise exceeds s sqrt(-2 ln false_alarm) in a bin with
    probability `false_alarm`.
    """
    require_word("receiver", receiver, RECEIVERS)
    if receiver == "full_profile":
        return amplitude

    reported = np.zeros_like(amplitude)
    if receiver == "peak_pulse":
        index = np.argmax(amplitude, axis=-1)[..., None]
        np.put_along_axis(reported, index, np.take_along_axis(amplitude, index, -1), -1)
        return reported

    # argmax of booleans is the first True; a waveform without one reports nothing.
    require("false_alarm", false_alarm, positive=True, maximum=math.nextafter(1.0, 0.0))
    above = amplitude > math.sqrt(-2 * math.log(false_alarm) * math.sqrt(math.pi / 8))
    index = np.argmax(above, axis=-1)[..., None]
    first = np.where(
        np.take_along_axis(above, index, -1), np.take_along_axis(amplitude, index, -1), 0
    )
    np.put_along_axis(reported, index, first, -1)
    return reported

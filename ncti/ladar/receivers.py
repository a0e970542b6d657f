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
    """Return waveforms as a receiver reports them.

    Parameters
    ----------
    amplitude : (..., bin) ndarray
        Detector output |l(n)| of one IFOV and frame along the last axis.
    receiver : str
        `full_profile` keeps the waveform. `peak_pulse` keeps only the largest value, in the bin
        where it occurs. `first_pulse` keeps only the first value above a threshold, and nothing
        if no value exceeds it.
    false_alarm : float
        Probability that noise alone exceeds the first-pulse threshold in one bin, in (0, 1).

    Returns
    -------
    (..., bin) ndarray
        Amplitude reported in each bin, 0 elsewhere.

    Raises
    ------
    ValueError
        If the receiver is unknown or the probability is outside (0, 1).

    See Also
    --------
    ncti.ladar.sample_frames : Random frames of any of these receivers.

    Notes
    -----
    The receivers are those named in [1]_. The magnitude of noise alone has a Rayleigh distribution
    with variance s^2 = sqrt(pi/8) in each quadrature, so the threshold is
    s sqrt(-2 ln false_alarm).

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, section "Model for Laser Radar Range Profiles".

    Examples
    --------
    The threshold is 4.16 at a false-alarm probability of 1e-6, so the first pulse is the weaker
    return in front of the peak:

    >>> import numpy as np
    >>> from ncti.ladar.receivers import detect
    >>> waveform = np.array([1.0, 6.0, 1.0, 9.0])
    >>> detect(waveform, receiver="first_pulse")
    array([0., 6., 0., 0.])
    >>> detect(waveform, receiver="peak_pulse")
    array([0., 0., 0., 9.])
    """
    require_word("receiver", receiver, RECEIVERS)
    if receiver == "full_profile":
        return amplitude

    kept = np.zeros_like(amplitude)
    if receiver == "peak_pulse":
        at = np.argmax(amplitude, axis=-1)[..., None]
        np.put_along_axis(kept, at, np.take_along_axis(amplitude, at, -1), -1)
        return kept

    # argmax of booleans is the first True; where there is none, nothing is kept.
    require("false_alarm", false_alarm, positive=True, maximum=math.nextafter(1.0, 0.0))
    above = amplitude > math.sqrt(-2 * math.log(false_alarm) * math.sqrt(math.pi / 8))
    at = np.argmax(above, axis=-1)[..., None]
    first = np.where(np.take_along_axis(above, at, -1), np.take_along_axis(amplitude, at, -1), 0)
    np.put_along_axis(kept, at, first, -1)
    return kept

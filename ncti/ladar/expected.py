"""The expected range profile, Equation C of the article."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require
from ncti.ladar.extent import RangeExtent
from ncti.ladar.pulse import noise_floor, target_kernel
from ncti.ladar.receivers import FALSE_ALARM, detect

STRONGEST = 1e20
"""Largest carrier-to-noise ratio, 200 dB: powers of frames stay numbers in float32."""


def expected_profile(
    extent: RangeExtent,
    *,
    pulse_width: float,
    cnr: float,
    target_free_ifovs: int = 0,
    receiver: str = "full_profile",
    false_alarm: float = FALSE_ALARM,
) -> NDArray[np.float64]:
    """Expected frame: the sum over IFOVs of the mean detector output, noise floor included.

    Parameters
    ----------
    extent : RangeExtent
        Range-extent fractions of the IFOVs on the target.
    pulse_width : float
        1/e^2 pulse width [s].
    cnr : float
        Carrier-to-noise power ratio (not decibels) of a filled IFOV at this range.
    target_free_ifovs : int
        How many IFOVs without target the frame accumulates besides.
    receiver : str
        `full_profile`, `first_pulse` or `peak_pulse`. The latter two have no closed form:
        theirs is the receiver's answer to the expected output of each IFOV.
    false_alarm : float
        As in `ncti.ladar.receivers.detect`.

    Returns
    -------
    (bin,) float64 ndarray
        Amplitude, in the article's units (one target-free IFOV gives `noise_floor()`).

    Raises
    ------
    ValueError
        If a parameter is out of range.

    Notes
    -----
    Article, Appendix 1, Equation C, per IFOV:

        <|l(n)|> = sqrt(A + B),
        A = (pi/2) CNR sum_k beta(k) exp(-8 (n - k)^2 / N_z^2) / N_z,
        B = sqrt(pi^3 / 32).

    The printed normalisation <w w*> = 1 of the speckle disagrees with it by sqrt(2); it holds
    for unit variance in each quadrature, which `sample_frames` therefore draws.
    """
    require("cnr", cnr, minimum=0.0, maximum=STRONGEST)
    require("target_free_ifovs", target_free_ifovs, minimum=0, whole=True)
    kernel = target_kernel(
        pulse_width=pulse_width, bin_width=extent.bin_width, bin_count=extent.down_range.size
    )
    a = (math.pi / 2) * cnr * extent.density @ (kernel**2).T
    b = noise_floor() ** 2
    amplitude = np.sqrt(a + b)
    seen = detect(amplitude, receiver=receiver, false_alarm=false_alarm).sum(axis=0)
    if receiver == "full_profile":
        seen += target_free_ifovs * noise_floor()
    return seen

"""Expected range profile: the closed form, Equation C of the article."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require
from ncti.ladar.extent import RangeExtent
from ncti.ladar.pulse import Pulse, noise_floor, target_kernel
from ncti.ladar.receivers import FALSE_ALARM, detect

MAX_CNR = 1e20
"""Largest carrier-to-noise ratio, 200 dB: the powers of frames stay finite in float32."""


def expected_profile(
    extent: RangeExtent,
    *,
    pulse_width: float,
    cnr: float,
    target_free_ifovs: int = 0,
    receiver: str = "full_profile",
    false_alarm: float = FALSE_ALARM,
) -> NDArray[np.float64]:
    """Return the expected range profile: mean detector output summed over IFOVs.

    Parameters
    ----------
    extent : RangeExtent
        Range-extent fractions of the IFOVs on the target.
    pulse_width : float
        1/e^2 pulse width [s].
    cnr : float
        Carrier-to-noise ratio of a filled IFOV at this range, **as a power ratio, not in
        decibels**: 32 dB is 1585, or ``power_ratio(32)``. 32 would be 15 dB.
    target_free_ifovs : int
        Number of IFOVs without target that are added to the frame.
    receiver : str
        `full_profile`, `first_pulse` or `peak_pulse`. The latter two have no closed form: they
        are applied to the expected output of each IFOV.
    false_alarm : float
        Probability that noise alone triggers the `first_pulse` receiver in one bin, in (0, 1).

    Returns
    -------
    (bin,) float64 ndarray
        Amplitude, noise floor included, in units in which one target-free IFOV gives
        `noise_floor()`.

    Raises
    ------
    ValueError
        If a parameter is out of range.

    See Also
    --------
    sample_frames : Random frames with this mean.
    frame_moments : Mean and covariance of a frame.
    ncti.features.profile_vector : Profile with the floor removed and the peak set to 1.

    Notes
    -----
    Equation C of [1]_, per IFOV:

        <|l(n)|> = sqrt(A + B),
        A = (pi/2) CNR sum_k beta(k) exp(-8 (n - k)^2 / N_z^2) / N_z,
        B = sqrt(pi^3 / 32).

    The speckle normalisation printed in the article, <w w*> = 1, disagrees with it by sqrt(2).
    Equation C holds for unit variance in each quadrature, which is what `sample_frames` draws.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, Appendix 1, Equation C.

    Examples
    --------
    A plate of 30 m x 30 m fills four IFOVs of 15 m at 100 km. Without signal the profile is the
    noise floor of the four IFOVs; at 32 dB the plate stands out twentyfold, in its own range bin:

    >>> import trimesh
    >>> from ncti.ladar import expected_profile, noise_floor, range_extent
    >>> from ncti.render import line_image
    >>> plate = trimesh.creation.box(extents=(4.0, 30.0, 30.0))
    >>> lines = line_image(plate, aspect=0, depression=0, spacing=0.5)
    >>> extent = range_extent(lines, slant_range=100e3)
    >>> silent = expected_profile(extent, pulse_width=30e-9, cnr=0.0)
    >>> print(f"{silent.min():.3f} {silent.max():.3f} {4 * noise_floor():.3f}")
    3.969 3.969 3.969
    >>> profile = expected_profile(extent, pulse_width=30e-9, cnr=10**3.2)
    >>> print(f"{profile.max():.1f} at {extent.down_range[profile.argmax()]:.1f} m")
    79.2 at -1.5 m
    """
    require("cnr", cnr, minimum=0.0, maximum=MAX_CNR)
    require("target_free_ifovs", target_free_ifovs, minimum=0, whole=True)
    kernel = target_kernel(Pulse(pulse_width, extent.bin_width), extent.down_range.size)
    # Terms A and B of Equation C, for every IFOV and bin.
    a = (math.pi / 2) * cnr * extent.density @ (kernel**2).T
    b = noise_floor() ** 2
    amplitude = np.sqrt(a + b)
    profile = detect(amplitude, receiver=receiver, false_alarm=false_alarm).sum(axis=0)
    # A target-free IFOV adds its flat floor; the other receivers have no such closed form.
    if receiver == "full_profile":
        profile += target_free_ifovs * noise_floor()
    return profile

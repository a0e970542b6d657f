"""Link budget: the carrier-to-noise ratio as a function of range, and decibels as a ratio."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ncti.checks import require
from ncti.ladar.beam import Signal
from ncti.ladar.expected import MAX_CNR
from ncti.ladar.extent import REFERENCE_BIN
from ncti.ladar.pulse import noise_floor

MAX_DECIBELS = 200.0
"""Largest level [dB], equal to `MAX_CNR`."""


def power_ratio(decibels: float) -> float:
    """Return the power ratio of a level in decibels.

    Functions of `ncti.ladar` take carrier-to-noise ratios as power ratios, `ncti.simulate` and the
    command line in decibels.

    Parameters
    ----------
    decibels : float
        Level [dB], from -200 to 200.

    Returns
    -------
    float
        10^(decibels / 10).

    Raises
    ------
    ValueError
        If the level is out of range.

    See Also
    --------
    carrier_to_noise : Carrier-to-noise ratio by range.

    Examples
    --------
    >>> from ncti.ladar import power_ratio
    >>> round(power_ratio(32), 1)
    1584.9
    """
    require("decibels", decibels, minimum=-MAX_DECIBELS, maximum=MAX_DECIBELS)
    return float(10 ** (decibels / 10))


def carrier_to_noise(
    slant_range: float,
    *,
    reference: float = Signal.cnr,
    reference_range: float = 100e3,
    extinction: float = 0.0,
) -> float:
    """Return the carrier-to-noise ratio of an IFOV filled by the target.

    Parameters
    ----------
    slant_range : float
        Distance from sensor to target [m].
    reference : float
        CNR at `reference_range`, as a power ratio, not in decibels (see `power_ratio`); 32 dB by
        default, the design value of the article.
    reference_range : float
        Range at which `reference` holds [m].
    extinction : float
        One-way power extinction of the atmosphere at the wavelength of the laser [dB/m].

    Returns
    -------
    float
        CNR as a power ratio.

    Raises
    ------
    ValueError
        If a parameter is out of range, ranges from 1 m to 1e9 m, or the CNR exceeds 200 dB.

    See Also
    --------
    power_ratio : Power ratio of a level in decibels.
    expected_profile : Range profile at a given CNR.

    Notes
    -----
    The return of a diffuse target that fills the beam falls as 1/R^2, the standard scaling for a
    resolved target, and the light crosses the atmosphere twice. The 32 dB at 100 km are from [1]_.
    `reference` already includes the extinction over `reference_range`.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, section "NCTI Sensor Suite".

    Examples
    --------
    Half the range gives 6 dB more. An extinction of 0.1 dB/km adds another 10 dB over the
    2 x 50 km saved:

    >>> import numpy as np
    >>> from ncti.ladar import carrier_to_noise
    >>> print(f"{10 * np.log10(carrier_to_noise(100e3)):.1f} dB")
    32.0 dB
    >>> print(f"{10 * np.log10(carrier_to_noise(50e3)):.1f} dB")
    38.0 dB
    >>> print(f"{10 * np.log10(carrier_to_noise(50e3, extinction=0.1e-3)):.1f} dB")
    48.0 dB
    """
    require("slant_range", slant_range, minimum=1.0, maximum=1e9)
    require("reference", reference, positive=True, maximum=MAX_CNR)
    require("reference_range", reference_range, minimum=1.0, maximum=1e9)
    require("extinction", extinction, minimum=0.0)
    two_way_db = 2 * extinction * (slant_range - reference_range)
    spreading_db = 20 * math.log10(slant_range / reference_range)
    if 10 * math.log10(reference) - spreading_db - two_way_db > MAX_DECIBELS:
        raise ValueError(
            f"extinction is {extinction:g} dB/m, but must be such that the carrier-to-noise ratio "
            f"at {slant_range:g} m is at most {MAX_DECIBELS:g} dB"
        )
    return float(reference * (reference_range / slant_range) ** 2 * 10 ** (-two_way_db / 10))


def faintest_ratio(
    size: Sequence[float], *, slant_range: float, ifov: float, target_free_ifovs: int
) -> float:
    """Return the carrier-to-noise ratio below which float32 rounding on the floor hides a ship.

    `size` (3,) is length, beam and height [m], `slant_range` [m], `ifov` [rad]; the CNR is a power
    ratio of a filled IFOV. The end of the box around the ship, its area spread over the length L,
    adds A = (pi/2) CNR (W H / side^2) / L per metre to Equation C of the article, and raises the
    profile by A / (2 sqrt(B)); float32 resolves 2^-23 of the floor, sqrt(B) for each IFOV. Real
    ships end-on peak three to eight times as high.
    """
    length, beam, height = size
    density = beam * height / (ifov * slant_range) ** 2 * REFERENCE_BIN / length
    floor = noise_floor() ** 2 * max(target_free_ifovs, 1)
    rise = math.pi / 2 * density / (2 * floor)  # of a CNR of 1, over the floor
    return float(np.finfo(np.float32).eps) / rise

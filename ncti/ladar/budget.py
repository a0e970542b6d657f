"""Link budget: the carrier-to-noise ratio as a function of range."""

from __future__ import annotations

from ncti.checks import require
from ncti.ladar.expected import STRONGEST


def carrier_to_noise(
    slant_range: float,
    *,
    reference: float = 10**3.2,
    reference_range: float = 100e3,
    extinction: float = 0.0,
) -> float:
    """Return the carrier-to-noise ratio of an IFOV filled by the target.

    Parameters
    ----------
    slant_range : float
        Distance from sensor to target [m].
    reference : float
        CNR at `reference_range`, as a power ratio, not in decibels; 32 dB by default, the
        design value of the article.
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
        If a parameter is out of range; ranges must lie between 1 m and 1e9 m.

    See Also
    --------
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
    require("reference", reference, positive=True, maximum=STRONGEST)
    require("reference_range", reference_range, minimum=1.0, maximum=1e9)
    require("extinction", extinction, minimum=0.0)
    two_way_db = 2 * extinction * (slant_range - reference_range)
    return float(reference * (reference_range / slant_range) ** 2 * 10 ** (-two_way_db / 10))

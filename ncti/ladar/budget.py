"""Link budget: how the carrier-to-noise ratio follows the range."""

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
    """Carrier-to-noise ratio of an IFOV that the target fills, at a range.

    Parameters
    ----------
    slant_range : float
        Sensor to target [m].
    reference : float
        Ratio (a power ratio, not decibels) at `reference_range`; the source's design is 32 dB.
    reference_range : float
        Where `reference` holds [m].
    extinction : float
        One-way power extinction of the atmosphere at the laser's wavelength [dB/m].

    Returns
    -------
    float
        CNR as a power ratio.

    Raises
    ------
    ValueError
        If a parameter is out of range; ranges are from 1 m to 1e9 m.

    Notes
    -----
    A diffuse target that fills the beam returns as 1/R^2 (article, 'NCTI Sensor Suite', gives
    the 32 dB at 100 km; the scaling is the standard one for a resolved target), and the light
    crosses the atmosphere twice. `reference` contains the extinction over `reference_range`.
    """
    require("slant_range", slant_range, minimum=1.0, maximum=1e9)
    require("reference", reference, positive=True, maximum=STRONGEST)
    require("reference_range", reference_range, minimum=1.0, maximum=1e9)
    require("extinction", extinction, minimum=0.0)
    two_way_db = 2 * extinction * (slant_range - reference_range)
    return float(reference * (reference_range / slant_range) ** 2 * 10 ** (-two_way_db / 10))

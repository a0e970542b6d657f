"""Depression of the line of sight from an aircraft."""

from __future__ import annotations

import math

from ncti.checks import require

EARTH_RADIUS = 6371e3  # m, mean

DEPRESSION = 3.84
"""Depression of the line of sight [deg] from 22,000 ft at 100 km, over a flat sea."""


def depression_angle(
    slant_range: float, *, altitude: float, earth_radius: float = EARTH_RADIUS
) -> float:
    """Return the grazing angle at the ship of the line of sight from an aircraft.

    Parameters
    ----------
    slant_range : float
        Aircraft to ship [m].
    altitude : float
        Altitude of the aircraft over the sea [m].
    earth_radius : float
        Radius of the sea's surface [m]; 1e12 and more is flat.

    Returns
    -------
    float
        Depression [deg], from 0 at the horizon to 90 overhead.

    Raises
    ------
    ValueError
        If a length is not positive, the aircraft is higher than the slant range, or the ship
        is beyond the horizon.

    See Also
    --------
    range_image, line_image : Views at a depression.

    Notes
    -----
    The law of cosines in the triangle of ship, aircraft and the Earth's centre:
    sin d = (h / R) (1 + h / (2 Re)) - R / (2 Re). At 22,000 ft and 100 km it is 3.39 deg, and
    3.84 deg over a flat sea. Refraction is neglected.

    Examples
    --------
    >>> from ncti.render import depression_angle
    >>> round(depression_angle(100e3, altitude=6705.6), 2)
    3.39
    >>> round(depression_angle(100e3, altitude=6705.6, earth_radius=1e12), 2)
    3.84
    """
    require("slant_range", slant_range, positive=True)
    require("altitude", altitude, positive=True)
    require("earth_radius", earth_radius, positive=True)
    sine = (altitude / slant_range) * (1 + altitude / (2 * earth_radius))
    sine -= slant_range / (2 * earth_radius)
    if sine > 1:
        raise ValueError(
            f"slant_range is {slant_range:g} m, but must be at least the altitude, {altitude:g} m"
        )
    if sine < 0:
        horizon = math.sqrt(altitude * (2 * earth_radius + altitude))
        raise ValueError(
            f"slant_range is {slant_range:g} m, but must be at most the {horizon:.0f} m to the "
            f"horizon from {altitude:g} m"
        )
    return math.degrees(math.asin(sine))

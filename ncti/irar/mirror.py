"""The scanning mirror: directions of the beam, and the lean of the image that it causes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_word

Floats = NDArray[np.float64]

MIRROR_FORMS = ("exact", "printed")


def compass_directions(azimuth: ArrayLike, elevation: ArrayLike) -> Floats:
    """Return unit vectors (..., 3) east, north, up of azimuths (clockwise) and elevations [deg]."""
    a, e = np.broadcast_arrays(np.radians(azimuth), np.radians(elevation))
    return np.stack([np.cos(e) * np.sin(a), np.cos(e) * np.cos(a), np.sin(e)], axis=-1)


def mirror_axes(*, azimuth: float, depression: float, mirror_angle: float = 45.0) -> Floats:
    """Return the axes (3, 3) of the scanner after the mirror, as rows of (east, north, up).

    Rows lie along the scan, across it and ahead: right, up and away, except for the rotation about
    the beam by `mirror_rotation`. `azimuth` [deg] from north and `depression` [deg] give the
    direction of the middle beam after the mirror; `mirror_angle` [deg] is half the azimuth by which
    the mirror turns it. At 45 the beam reaches the mirror from the right of the line of sight, with
    the article's sign. The scanner moves the beam in the horizontal plane, and the mirror, fixed
    during the pass, deflects it downwards, so that a line of the scan is not level.
    """
    towards = compass_directions(azimuth, -depression)
    source = azimuth + 2 * mirror_angle  # azimuth of the source of the beam
    normal = towards + compass_directions(source, 0.0)
    normal /= np.linalg.norm(normal)
    # Right, up and ahead before the mirror; a reflection turns right into left.
    axes = np.stack(
        [
            compass_directions(source + 90.0, 0.0),
            compass_directions(0.0, 90.0),
            -compass_directions(source, 0.0),
        ]
    )
    return axes - 2 * (axes @ normal)[:, None] * normal


def mirror_rotation(depression: float, *, mirror_angle: float = 45.0, form: str = "exact") -> float:
    """Return the angle by which the mirror rotates a vertical object in the image.

    Parameters
    ----------
    depression : float
        Depression of the line of sight, gamma [deg].
    mirror_angle : float
        Mirror pointing angle, psi [deg].
    form : str
        `exact`: tan(theta) = -sin(gamma) sin(2 psi) / (cos(gamma) + cos(2 psi)). `printed`: the
        article's tan(theta) = -sin(gamma) tan(psi).

    Returns
    -------
    float
        Angle theta_v [deg], positive clockwise.

    Raises
    ------
    ValueError
        If an angle is not between 0 and 90 degrees, or the form is unknown.

    See Also
    --------
    correct : The correction chain that removes it.
    azimuth_shift : The article's other equation of the corrections.

    Notes
    -----
    The article ascribes the printed equation to Hull [1]_. Reflection gives the exact form, which
    is -gamma at psi = 45 deg. The printed form is its limit for small gamma, 0.05 deg off at 6.7
    deg and 1.1 deg off at 20 deg.

    The image of a detector array, taken at once, rotates by this angle, as the article says. With
    one scanned detector, the lines lean by it while the rows still climb straight up with the
    aircraft: a shear.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, 'Data Processing'.

    Examples
    --------
    >>> print(f"{mirror_rotation(6.7):.2f} deg")
    -6.70 deg
    >>> print(f"{mirror_rotation(6.7, form='printed'):.2f} deg")
    -6.65 deg
    """
    require("depression", depression, minimum=0, below=90)
    require("mirror_angle", mirror_angle, positive=True, below=90)
    require_word("form", form, MIRROR_FORMS)
    gamma, psi = np.radians(depression), np.radians(mirror_angle)
    if form == "printed":
        return float(-np.degrees(np.arctan(np.sin(gamma) * np.tan(psi))))
    opposite, adjacent = np.sin(gamma) * np.sin(2 * psi), np.cos(gamma) + np.cos(2 * psi)
    return float(-np.degrees(np.arctan2(opposite, adjacent)))

"""The scanning mirror: where the beam goes, and how its images lean."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require

Floats = NDArray[np.float64]

MIRROR_FORMS = ("exact", "printed")


def compass(azimuth: ArrayLike, elevation: ArrayLike) -> Floats:
    """Unit vectors (east, north, up) of directions.

    Parameters
    ----------
    azimuth : (...) array_like
        Clockwise from north [deg].
    elevation : (...) array_like
        Above the horizon [deg].

    Returns
    -------
    (..., 3) float64 ndarray
    """
    a, e = np.broadcast_arrays(np.radians(azimuth), np.radians(elevation))
    return np.stack([np.cos(e) * np.sin(a), np.cos(e) * np.cos(a), np.sin(e)], axis=-1)


def mirror_axes(*, azimuth: float, depression: float, mirror_angle: float = 45.0) -> Floats:
    """Axes of the scanner as the mirror shows them, by reflection.

    Parameters
    ----------
    azimuth : float
        Of the undeflected beam behind the mirror, clockwise from north [deg].
    depression : float
        Of that beam, gamma [deg].
    mirror_angle : float
        Half the azimuth by which the mirror turns the beam, psi [deg]: at 45 the beam reaches it
        from abeam, on the right of the line of sight, where the article's sign puts it.

    Returns
    -------
    (3, 3) float64 ndarray
        Unit vectors (east, north, up) along the scan, across it and ahead: to the right, up and
        away, but for the mirror's turn about the beam, `mirror_rotation`.

    Notes
    -----
    The scanner moves the beam in the horizontal plane and the mirror, which stands still during
    the pass, sends it down: a line of the scan is then not level.
    """
    towards = compass(azimuth, -depression)
    source = azimuth + 2 * mirror_angle  # where the beam comes from
    normal = towards + compass(source, 0.0)
    normal /= np.linalg.norm(normal)
    # The mirror image of a turn to the right is one to the left.
    axes = np.stack([compass(source + 90.0, 0.0), compass(0.0, 90.0), -compass(source, 0.0)])
    reflected: Floats = axes - 2 * (axes @ normal)[:, None] * normal
    return reflected


def mirror_rotation(depression: float, *, mirror_angle: float = 45.0, form: str = "exact") -> float:
    """Angle by which the mirror turns a vertical object in the image.

    Parameters
    ----------
    depression : float
        Of the line of sight, gamma [deg].
    mirror_angle : float
        Mirror pointing angle, psi [deg].
    form : str
        `exact`: tan(theta) = -sin(gamma) sin(2 psi) / (cos(gamma) + cos(2 psi)). `printed`: the
        article's tan(theta) = -sin(gamma) tan(psi).

    Returns
    -------
    float
        theta_v [deg], positive clockwise.

    Raises
    ------
    ValueError
        If an angle is not between 0 and 90 degrees, or the form unknown.

    Notes
    -----
    Article, 'Data Processing', the equation ascribed to Hull. Reflection gives the exact form,
    which is -gamma at psi = 45 deg; the printed one is its limit for small gamma, 0.05 deg off at
    6.7 deg and 1.1 deg off at 20.

    Of a whole image that a detector array takes at once it is a rotation, as the article says. Of
    one detector that is scanned it is the lean of the lines, while the rows still climb straight
    up with the aircraft: a shear.
    """
    require("depression", depression, minimum=0, below=90)
    require("mirror_angle", mirror_angle, positive=True, below=90)
    if form not in MIRROR_FORMS:
        raise ValueError(f"form is {form!r}, but must be one of {', '.join(MIRROR_FORMS)}")
    gamma, psi = np.radians(depression), np.radians(mirror_angle)
    if form == "printed":
        return float(-np.degrees(np.arctan(np.sin(gamma) * np.tan(psi))))
    opposite, adjacent = np.sin(gamma) * np.sin(2 * psi), np.cos(gamma) + np.cos(2 * psi)
    return float(-np.degrees(np.arctan2(opposite, adjacent)))

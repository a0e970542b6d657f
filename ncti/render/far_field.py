"""Choice between drawing a ship at its slant range, and in the far field for several ranges."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from ncti.checks import require
from ncti.render.view import far_field_error

SHARE = 0.1
"""Share of a tolerance that drawing the far field may use up."""

NEGLIGIBLE = 1e-4
"""Largest error of drawing the far field when no tolerance is given."""


def drawn_range(
    reach: float, slant_range: float, *, tolerance: float | None = None
) -> float | None:
    """Return the slant range to draw a ship at, or None where the far field is good enough.

    Parameters
    ----------
    reach : float
        Largest distance of a point of the ship from its origin [m].
    slant_range : float
        Distance from the sensor to the ship origin [m].
    tolerance : float, optional
        Largest relative error of a range extent. Drawing the far field may use up a tenth of it,
        or has an error of at most 1e-4 when it is not given.

    Returns
    -------
    float or None
        The slant range [m], or None for the far field, whose image serves all ranges from there
        on.

    Raises
    ------
    ValueError
        If a parameter is out of its range.

    See Also
    --------
    ncti.render.far_field_error : Bound on the error of drawing the far field.
    ncti.render.line_image : Draws a view at a range, or in the far field.

    Notes
    -----
    The bound uses the reach of the whole ship, so that all views at a range are drawn the same way.

    Examples
    --------
    A ship of 140 m at 100 km, for errors of 0.1 % and 2 %:

    >>> from ncti.render import drawn_range
    >>> drawn_range(70.0, 100e3, tolerance=0.001)
    100000.0
    >>> print(drawn_range(70.0, 100e3, tolerance=0.02))
    None
    """
    require("reach", reach, minimum=0.0)
    require("slant_range", slant_range, positive=True)
    if tolerance is not None:
        require("tolerance", tolerance, positive=True)
    allowed = NEGLIGIBLE if tolerance is None else SHARE * tolerance
    return None if far_field_error(reach, slant_range) <= allowed else float(slant_range)


def reach_of(vertices: ArrayLike) -> float:
    """Return the largest distance of (vertex, 3) vertices from the ship origin [m]."""
    points = np.asarray(vertices)
    return math.sqrt(np.einsum("ij,ij->i", points, points).max(initial=0.0))


def sampling_tolerance(tolerance: float, drawn: float | None) -> float:
    """Return the part of a tolerance that remains for sampling, given the range of a view.

    A view drawn at a slant range [m] leaves all of it, the far field (None) 1 - `SHARE` of it.
    """
    return tolerance if drawn is not None else (1.0 - SHARE) * tolerance

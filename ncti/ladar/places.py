"""Places of the ship origin on the grid of IFOVs or pixels."""

from __future__ import annotations

IfovOffset = tuple[float, float]  # right and up [cell]

# Steps of Roberts' R2, a sequence that fills the unit square evenly at any length.
PLASTIC = (0.7548776662466927, 0.5698402909980532)

TEMPLATE_PLACES = 8
"""Positions per view of likelihood templates; at 100 km, more do not improve any score."""


def spread_place(number: int) -> IfovOffset:
    """Return the position of the ship origin right and up from the corner of its cell [cell].

    Parameters
    ----------
    number : int
        Index of the position; 0 is the corner.

    Returns
    -------
    right, up : float
        In [0, 1). The first n positions are evenly spread for any n.

    See Also
    --------
    ncti.ladar.range_extent : Takes it as its `shift`.

    Examples
    --------
    >>> from ncti.ladar import spread_place
    >>> [tuple(round(part, 2) for part in spread_place(number)) for number in range(3)]
    [(0.0, 0.0), (0.75, 0.57), (0.51, 0.14)]
    """
    return number * PLASTIC[0] % 1, number * PLASTIC[1] % 1

"""Places of the ship origin on the cells of a detector."""

from __future__ import annotations

from sweeps.engine.stage import plain

Shift = tuple[float, float]  # right and up [cell]

# Steps of Roberts' R2, a sequence that fills the unit square evenly, however long it is.
PLASTIC = (0.7548776662466927, 0.5698402909980532)


def place(number: int) -> Shift:
    """Return the position of the ship origin right and up from the corner of its cell [cell].

    Places of the numbers 0, 1, ... are evenly spread; the first is the corner itself.
    """
    return number * PLASTIC[0] % 1, number * PLASTIC[1] % 1


@plain()
def shift() -> Shift:
    """Return the position of the ship origin in training views: the corner of an IFOV."""
    return 0.0, 0.0

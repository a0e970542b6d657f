"""Where a ship lies on the cells of a detector, number by number."""

from __future__ import annotations

# Steps of a sequence that fills the unit square evenly, however long it is: Roberts' R2.
PLASTIC = (0.7548776662466927, 0.5698402909980532)


def place(number: int) -> tuple[float, float]:
    """Return where in a cell the ship origin lies, right and up from its corner [cell].

    Places of the numbers 0, 1, ... are evenly spread; the first is the corner itself.
    """
    return number * PLASTIC[0] % 1, number * PLASTIC[1] % 1

"""Shortest range window that holds a ship, the pulse that it returns, and free edges."""

from __future__ import annotations

import math

from ncti.ladar.pulse import SPEED_OF_LIGHT
from ncti.render.far_field import reach_of
from ncti.ships.shape import Mesh

EDGE_SHARE = 0.08  # share of the window that stays free of the ship at each end


def shortest_window(reach: float, pulse_width: float) -> float:
    """Return the shortest range window [m] that leaves both its edges free of a ship.

    `reach` is the largest distance of a point of the ship from its origin [m], `pulse_width` [s] at
    1/e^2. The noise floor is read at the edges, which the returned pulse must not reach.
    """
    return (2 * reach + pulse_width * SPEED_OF_LIGHT / math.sqrt(2)) / (1 - 2 * EDGE_SHARE)


def check_window(window: float, mesh: Mesh, *, pulse_width: float) -> None:
    """Raise `ValueError` for a window [m] that does not hold a ship with both edges free."""
    ship, reach = mesh.metadata.get("name", "mesh"), reach_of(mesh.vertices)
    if allowed := window_requirement(window, ship=ship, reach=reach, pulse_width=pulse_width):
        raise ValueError(f"window is {window!r} m, but must be {allowed}")


def window_requirement(window: float, *, ship: str, reach: float, pulse_width: float) -> str:
    """Return the window length [m] that a ship needs, in words; empty if it is long enough."""
    shortest = shortest_window(reach, pulse_width)
    if shortest <= window:
        return ""
    edges = f"leave {EDGE_SHARE:.0%} free at each end after a pulse of {pulse_width * 1e9:g} ns"
    return f"at least {math.ceil(shortest)} m to hold {ship} and {edges}"

"""The ships of a sweep: sizes and pictures, as the store's group `ships` has them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sweeps.report.rows import groups

GROUP = "ships"
SIZES = ("length", "beam", "height", "facets")


@dataclass(frozen=True)
class Ship:
    """A ship: its label, its sizes in words, and its picture as PNG in base64, if there is one."""

    label: str
    sizes: list[tuple[str, str]]
    picture: str


def ships_of(store: Any) -> list[Ship]:
    """Return the ships that a store describes."""
    if GROUP not in groups(store):
        return []
    return []

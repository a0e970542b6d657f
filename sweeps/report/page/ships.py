"""The ships of a sweep: measures and pictures, as the store's group `ships` has them."""

from __future__ import annotations

import base64
import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sweeps.report.stores import groups, read
from sweeps.report.words import unit_of

GROUP = "ships"
MEASURES = ("length", "beam", "height", "facets")
DARK, BRIGHT = (52, 72, 92), (178, 202, 222)  # visible on light and dark pages


def ships_of(store: Any) -> list[dict[str, Any]]:
    """Return the ships that a store describes; none where it has no such group.

    With label, measures by name as numbers with their units, picture as PNG in base64, and warning.
    """
    if GROUP not in groups(store):
        return []
    table = read(store, GROUP).load()
    units = {n: unit_of(str(table[n].attrs.get("units", "1"))) for n in MEASURES if n in table}
    ships = []
    for label in table.ship.values.tolist():
        here = table.sel(ship=label)
        measures = {name: (float(here[name]), unit) for name, unit in units.items()}
        picture = drawn(here.picture.values) if "picture" in here else ""
        warning = str(here.warning.item()) if "warning" in here else ""
        ship = {"label": str(label), "measures": measures, "picture": picture, "warning": warning}
        ships.append(ship)
    return ships


def drawn(brightness: NDArray[np.floating]) -> str:
    """Return a picture, (row, column), from 0 to 1 and the lowest row first, as PNG in base64.

    NaN is transparent. Empty if all is NaN.
    """
    from PIL import Image

    if not np.isfinite(brightness).any():
        return ""
    seen = np.isfinite(brightness)
    share = np.where(seen, brightness, 0.0).clip(0.0, 1.0)[..., None]
    colour = np.array(DARK) + share * (np.array(BRIGHT) - np.array(DARK))
    pixels = np.dstack([colour, 255 * seen])[::-1].astype(np.uint8)
    content = io.BytesIO()
    Image.fromarray(pixels, "RGBA").save(content, format="PNG")
    return base64.b64encode(content.getvalue()).decode("ascii")

"""What the tests of ships build with: packaged sheets, and a barge small enough to build often."""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import Any

import numpy as np
import trimesh
from manifold3d import Manifold, Mesh64

from ncti.ships import sheets


def packaged_text(name: str) -> str:
    return (resources.files("ncti.ships") / "sheets" / f"{name}.yaml").read_text()


@cache
def packaged_sheet(name: str) -> sheets.Sheet:
    return sheets.parse(packaged_text(name), packaged_text("templates"), where=name)


def solid_of(mesh: trimesh.Trimesh) -> Manifold:
    return Manifold(Mesh64(np.array(mesh.vertices), np.array(mesh.faces, dtype=np.uint64)))


def barge() -> dict[str, Any]:
    """A sheet of one plain hull with a component of nearly every kind."""
    place = {"src": "E", "x": 20.0, "y": 0.0, "z": 3.0}
    return {
        "name": "barge",
        "principal": {
            "LOA": 40.0,
            "beam_max": 8.0,
            "stem_at_wl_x": 2.0,
            "transom_head": [40.0, 3.0],
            "transom_angle_from_vertical": 10,
        },
        "stations": [
            [0.0, 3.0, 0.1, None],
            [2.0, 3.0, 1.5, 0.1],
            [10.0, 3.0, 4.0, 3.5],
            [40.0, 3.0, 4.0, 3.5],
        ],
        "templates": {"GUN": {"parts": [["cyl", 0, 0, 0, {"r": 1.0, "h": 1.0}]]}},
        "components": [
            place | {"name": "house", "prim": "box", "l": 6.0, "w": 4.0, "h": 3.0},
            {
                "name": "bridge",
                "prim": "poly",
                "src": "E",
                "z": 6.0,
                "h": 2.5,
                "pts": [[17, -2], [23, -2], [23, 2], [17, 2]],
            },
            {
                "name": "panes",
                "prim": "windows",
                "src": "E",
                "house": "bridge",
                "z": 7.0,
                "h": 1.0,
                "w": 0.8,
                "pitch": 1.0,
                "depth": 0.1,
            },
            place | {"name": "gun", "prim": "eq", "x": 8.0, "type": "GUN", "az": 30},
            place
            | {"name": "bitts", "prim": "cyl", "x": 30.0, "y": 2.0, "r": 0.3, "h": 0.6}
            | {"mirror": True, "n": 2, "dx_n": 2.0, "repeat": [[35.0, 1.0]]},
            {
                "name": "rail",
                "prim": "rail",
                "src": "E",
                "edge": [10.0, 38.0],
                "h": 1.0,
                "pitch": 4.0,
            },
            place
            | {"name": "door", "prim": "recess", "x": 23.0, "face": "aft"}
            | {"l": 0.1, "w": 1.0, "h": 2.0},
        ],
    }

"""Compiled loops of the engines."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from ncti.machine_code import CompiledLoops
from ncti.ships.shape import ShipMesh

LINES, MASK = "lines", "mask"
_VIEW: dict[str, Any] = {"aspect": 30.0, "depression": 10.0}
_BOX = ShipMesh(
    np.array([*product((-4.0, 4.0), (-2.0, 2.0), (-2.0, 2.0))]),
    np.array([*map(int, "130410032240173514571372642276654756")], np.int32).reshape(12, 3),
    {"digest": "box"},
)
"""8 by 4 by 4 m, its corners numbered by their bits."""


def engine_loops(engine: str) -> CompiledLoops:
    """Return the outermost loops of an engine, or of "mask" or "lines"; they compile all others."""
    if engine == MASK:
        return CompiledLoops(
            "silhouettes", ("render.mask.snap_vertices", "render.mask.fill"), _draw_mask
        )
    owner = f"the engine {engine}"
    if engine == LINES:
        return CompiledLoops(
            owner, ("render.line_sweep.sweep", "render.pieces.bin_pieces"), _draw_lines
        )
    if engine == "embree":
        return CompiledLoops(
            owner, ("render.pixels.rays", "render.pixels.row_spans"), _draw_by_embree
        )
    return CompiledLoops(owner, ("render.pixels.sampled_facets",), _draw_without_context)


def _draw_lines() -> None:
    from ncti.render.draw_lines import line_image, refined

    refined(_BOX, line_image(_BOX, **_VIEW)).bin(side=1.0)


def _bin_pieces() -> None:
    from ncti.render.lines import LineImage

    number, piece = np.zeros(1, np.int32), np.array([[0.0, 1.0, 0.0, 0.0]])
    normal = np.array([[1.0, 0.0, 0.0]])
    LineImage(number, piece, number, normal, 1.0, 0.5, **_VIEW, roll=0.0).bin(side=1.0)


PIECES = CompiledLoops("range extents of lines", ("render.pieces.bin_pieces",), _bin_pieces)


def _draw_mask() -> None:
    from ncti.render.mask import ship_mask

    ship_mask(_BOX, pixel=0.25, **_VIEW)


def _draw_by_embree() -> None:
    from ncti.render.draw import range_image

    range_image(_BOX, engine="embree", **_VIEW)


def _draw_without_context() -> None:
    """Run the loops of OpenGL engines without an engine, which would bind OpenGL to a platform."""
    from ncti.render.solid import Solid, sampled_facets, surface
    from ncti.render.view import Lattice, View

    solid = Solid.of(_BOX)
    view = View.checked(**_VIEW, roll=0.0, slant_range=None)
    points = solid.view_coordinates(view)
    lattice = Lattice.around(points, view, 0.25)
    sampled_facets(solid, view, lattice, points)
    facet = np.zeros(lattice.rows * lattice.columns, np.float32)
    surface(solid, view, lattice, points, facet)

"""Compiled loops of the engines."""

from __future__ import annotations

from typing import Any

import numpy as np

from ncti.machine_code import Loops

LINES, MASK = "lines", "mask"
_VIEW: dict[str, Any] = {"aspect": 30.0, "depression": 10.0}


def of_engine(engine: str) -> Loops:
    """Return the loops of an engine, or of "mask" or "lines": those that compile all others."""
    if engine == MASK:
        return Loops("silhouettes", ("render.mask.snapped", "render.mask.fill"), _draw_mask)
    what = f"the engine {engine}"
    if engine == LINES:
        return Loops(what, ("render.line_sweep.sweep", "render.pieces.bin_pieces"), _draw_lines)
    if engine == "embree":
        return Loops(what, ("render.pixels.rays", "render.spans.spans"), _draw_by_embree)
    return Loops(what, ("render.pixels.sampled",), _draw_without_context)


def _draw_lines() -> None:
    import trimesh

    from ncti.render.draw_lines import line_image, refined

    box = trimesh.creation.box()
    refined(box, line_image(box, **_VIEW)).bin(side=1.0)


def _draw_mask() -> None:
    import trimesh

    from ncti.render.mask import ship_mask

    ship_mask(trimesh.creation.box(), pixel=0.25, **_VIEW)


def _draw_by_embree() -> None:
    import trimesh

    from ncti.render.draw import range_image

    range_image(trimesh.creation.box((8.0, 4.0, 4.0)), engine="embree", **_VIEW)


def _draw_without_context() -> None:
    """Run the loops of OpenGL engines, without an engine, which would bind OpenGL for good."""
    import trimesh

    from ncti.render.solid import Solid, sampled, surface
    from ncti.render.view import Lattice, View

    solid = Solid.of(trimesh.creation.box((8.0, 4.0, 4.0)))
    seen = View.checked(**_VIEW, roll=0.0, slant_range=None)
    points = solid.along(seen)
    lattice = Lattice.around(points, seen, 0.25)
    sampled(solid, seen, lattice, points)
    facet = np.zeros(lattice.rows * lattice.columns, np.float32)
    surface(solid, seen, lattice, points, facet)

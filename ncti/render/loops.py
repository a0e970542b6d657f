"""The loops that engines run, and how one process compiles them for all."""

from __future__ import annotations

import numpy as np

from ncti import machine_code

LINES = "lines"
_LOOPS = {
    LINES: ("render.line_sweep.sweep", "render.pieces.bin_pieces"),
    "embree": ("render.pixels.rays",),
}
_OPENGL = ("render.pixels.sampled",)


def loops_of(engine: str) -> tuple[str, ...]:
    """Return the loops that an engine runs, or "lines", of which others compile the rest."""
    return _LOOPS.get(engine, _OPENGL)


def keep(engine: str) -> None:
    """Compile the loops that an engine runs, and keep their machine code, if it is not kept yet.

    Processes find it there afterwards, where each would compile the loops by itself. Importing
    numba takes long, and is left out where the code is there.

    Parameters
    ----------
    engine : str
        An engine, or "lines".
    """
    if not machine_code.folder() or machine_code.is_kept(loops_of(engine)):
        return
    import trimesh

    from ncti.compiled import announcer

    announcer.said = True  # it would tell of what was asked for
    box, view = trimesh.creation.box((8.0, 4.0, 4.0)), {"aspect": 30.0, "depression": 10.0}
    if engine == LINES:
        from ncti.render.lines import line_image

        line_image(box, **view).bin(side=1.0)
        return
    from ncti.render.draw import range_image
    from ncti.render.solid import Solid, sampled, surface
    from ncti.render.view import Lattice, View

    if engine == "embree":
        range_image(box, engine=engine, **view)
        return
    # What OpenGL engines run, without a context.
    solid, seen = Solid.of(box), View.checked(**view, roll=0.0, slant_range=None)
    points = solid.along(seen)
    lattice = Lattice.around(points, seen, 0.25)
    sampled(solid, seen, lattice, points)
    facet = np.zeros(lattice.rows * lattice.columns, np.float32)
    surface(solid, seen, lattice, points, facet, from_behind=False)

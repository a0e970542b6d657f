"""Where the machine code of compiled loops is kept, told without importing what compiles them."""

from __future__ import annotations

import hashlib
import os
import stat
from functools import cache
from pathlib import Path

import numpy as np
from platformdirs import user_cache_path

LINES = "lines"
LOOPS = {LINES: ("line_sweep.sweep", "pieces.bin_pieces"), "embree": ("pixels.rays",)}
"""By engine, modules and names of the loops that are compiled last."""

OPENGL_LOOPS = ("pixels.sampled",)
"""Those of the other engines."""


@cache
def folder() -> str:
    """Return the folder for machine code; nothing where it is not this user's to write alone.

    Notes
    -----
    It is that of NUMBA_CACHE_DIR, or in the user's cache: one for all sweeps.
    """
    given = os.environ.get("NUMBA_CACHE_DIR")
    chosen = Path(given) if given else user_cache_path("ncti-sweep") / "compiled"
    try:
        chosen.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = chosen.stat()
    except OSError:
        return ""
    # What numba keeps there is run when it is read.
    alone = not hasattr(os, "geteuid") or (
        found.st_uid == os.geteuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    )
    return str(chosen) if alone and os.access(chosen, os.W_OK | os.X_OK) else ""


def is_kept(engine: str) -> bool:
    """Return whether there is machine code of the loops that an engine runs, of their last source.

    Parameters
    ----------
    engine : str
        An engine, or "lines".

    Notes
    -----
    By the times of files alone. Where this errs, as with another release of numba, loops are
    compiled when they are first called.
    """
    here = Path(__file__).absolute()
    # As numba names them.
    place = Path(folder(), f"render_{hashlib.sha1(str(here.parent).encode()).hexdigest()}")
    return bool(folder()) and all(
        any(
            kept.stat().st_mtime >= here.with_name(f"{loop.split('.')[0]}.py").stat().st_mtime
            for kept in place.glob(f"{loop}-*.nbi")
        )
        for loop in LOOPS.get(engine, OPENGL_LOOPS)
    )


def keep(engine: str) -> None:
    """Compile the loops that an engine runs, and keep their machine code, if it is not kept yet.

    Processes find it there afterwards, where each would compile the loops by itself. Importing
    numba takes long, and is left out where the code is there.

    Parameters
    ----------
    engine : str
        An engine, or "lines".
    """
    if not folder() or is_kept(engine):
        return
    import trimesh

    from ncti.render.compiled import announcer

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

"""Where the machine code of compiled loops is kept, told without importing what compiles them."""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from platformdirs import user_cache_path


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


def is_kept(loops: Iterable[str]) -> bool:
    """Return whether there is machine code of loops, of their last source.

    Parameters
    ----------
    loops : iterable of str
        Their names within `ncti`, as "render.line_sweep.sweep".

    Notes
    -----
    By the times of files alone. Where this errs, as with another release of numba, loops are
    compiled when they are first called.
    """
    return bool(folder()) and all(_kept(*loop.rsplit(".", 2)) for loop in loops)


def _kept(*names: str) -> bool:
    """Return whether machine code of a function is there, of [room,] module and name."""
    *room, module, function = names
    source = Path(__file__).absolute().parent.joinpath(*room, f"{module}.py")
    # As numba names them.
    digest = hashlib.sha1(str(source.parent).encode()).hexdigest()
    place = Path(folder(), f"{source.parent.name}_{digest}")
    return any(
        kept.stat().st_mtime >= source.stat().st_mtime
        for kept in place.glob(f"{module}.{function}-*.nbi")
    )

"""Loops that are compiled together, and where their machine code is kept; numba is not imported."""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Callable
from dataclasses import dataclass
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


@dataclass(frozen=True)
class Loops:
    """Loops that are compiled by one call; `ncti.compiled.keep` does so.

    Attributes
    ----------
    of : str
        What runs them, as "sampled frames".
    names : tuple of str
        Their names within `ncti`, as "render.line_sweep.sweep"; of loops that only call one another
        the outer one.
    call : callable
        Runs them all on little, with arguments of the types that sweeps have.
    """

    of: str
    names: tuple[str, ...]
    call: Callable[[], object]

    def are_missing(self) -> bool:
        """Return whether there is a folder for machine code, but none in it of the last source.

        Notes
        -----
        By the times of files alone. Where this errs, as with another release of numba, loops are
        compiled when they are first called.
        """
        return bool(folder()) and not all(_kept(*name.rsplit(".", 2)) for name in self.names)


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

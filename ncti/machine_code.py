"""Groups of compiled loops and the cache folder of their machine code, without importing numba."""

from __future__ import annotations

import hashlib
import os
import stat
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from platformdirs import user_cache_path

from ncti.processors import processor_count


@cache
def folder() -> str:
    """Return the folder for machine code, or "" if it is not writable by this user alone.

    It is `NUMBA_CACHE_DIR`, if set, or a folder in the user's cache that all sweeps share.
    """
    setting = os.environ.get("NUMBA_CACHE_DIR")
    chosen = Path(setting) if setting else user_cache_path("ncti-sweep") / "compiled"
    return str(chosen) if _is_private(chosen) else ""


@cache
def folder_of(source: str) -> str:
    """Return `folder()`, or "" if its folder for functions of a source file is not private."""
    return folder() if folder() and _is_private(_place(Path(source).absolute())) else ""


def _is_private(place: Path) -> bool:
    """Return whether a folder, made if missing, is writable by this user alone."""
    try:
        for parent in reversed((place, *place.parents)):
            if not parent.is_dir():
                parent.mkdir(mode=0o700, exist_ok=True)
        status = place.stat()
    except OSError:
        return False
    # numba runs the code that it loads from there, so no other user may write to it.
    is_exclusive = not hasattr(os, "geteuid") or (
        status.st_uid == os.geteuid() and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    )
    return is_exclusive and os.access(place, os.W_OK | os.X_OK)


def _place(source: Path) -> Path:
    """Return the subfolder that numba uses for the functions of a source file."""
    digest = hashlib.sha1(str(source.parent).encode()).hexdigest()
    return Path(folder(), f"{source.parent.name}_{digest}")


@dataclass(frozen=True)
class CompiledLoops:
    """Loops that one call compiles; see `ncti.compiled.keep`.

    `label` is the noun for their results, such as "sampled frames"; `names` are the outermost loops
    within `ncti`, such as "render.line_sweep.sweep"; `warm_up` runs them all on tiny arguments of
    the types that sweeps use.
    """

    label: str
    names: tuple[str, ...]
    warm_up: Callable[[], object]

    def are_missing(self) -> bool:
        """Return whether the folder lacks machine code of the current source.

        It is False without a folder. Only file times are compared; if they mislead, as with another
        release of numba, the loops are compiled on their first call.
        """
        return bool(folder()) and not all(_is_compiled(*name.rsplit(".", 2)) for name in self.names)


@contextmanager
def compiling_ahead(*loops: CompiledLoops) -> Iterator[None]:
    """Compile missing loops in another process while the context runs; wait for it on exit.

    A loop called in the context before its machine code exists is also compiled here. On a single
    processor, nothing is compiled ahead.
    """
    calls = [part.warm_up for part in loops if processor_count() > 1 and part.are_missing()]
    lines = [f"from {call.__module__} import {call.__qualname__} as call; call()" for call in calls]
    process = None
    if lines:
        with suppress(OSError):  # the loops are compiled when they are called
            quiet = subprocess.DEVNULL
            command = [sys.executable, "-c", "\n".join(lines)]
            process = subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet)
    try:
        yield
        if process:
            process.wait()
    finally:
        if process:
            process.kill()
            process.wait()


def _is_compiled(*names: str) -> bool:
    """Return whether the machine code of a function exists, given [package,] module and name."""
    *packages, module, function = names
    source = Path(__file__).absolute().parent.joinpath(*packages, f"{module}.py")
    # numba's file names.
    return any(
        index.stat().st_mtime >= source.stat().st_mtime
        for index in _place(source).glob(f"{module}.{function}-*.nbi")
    )

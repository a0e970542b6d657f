"""Functions compiled by numba, kept in the user's cache and never in the package."""

from __future__ import annotations

import logging
import os
import stat
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import event
from platformdirs import user_cache_path

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """Return a function that numba compiles on its first call, or finds in the user's cache.

    Notes
    -----
    The folder is that of NUMBA_CACHE_DIR, or in the user's cache: one for all sweeps. Where it
    cannot be written, or another user could write it, code is compiled in each process. Division by
    zero gives infinity, as with arrays, and other threads of Python run meanwhile.
    """
    config: Any = numba.config  # its names are made when it is imported
    before = config.CACHE_DIR
    config.CACHE_DIR = _folder()
    try:
        kept = bool(config.CACHE_DIR)
        dispatcher: Any = numba.njit(cache=kept, nogil=True, error_model="numpy")(function)
        return cast(F, dispatcher)
    finally:
        config.CACHE_DIR = before


def inlined(function: F) -> F:
    """Return a function that numba inlines; loops that call nothing can be vector instructions."""
    return cast(F, numba.njit(inline="always", error_model="numpy")(function))


@cache
def _folder() -> str:
    """Return the folder for machine code; nothing where it is not this user's to write alone."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    folder = Path(given) if given else user_cache_path("ncti-sweep") / "compiled"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = folder.stat()
    except OSError:
        return ""
    # What numba keeps there is run when it is read.
    alone = not hasattr(os, "geteuid") or (
        found.st_uid == os.geteuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    )
    return str(folder) if alone and os.access(folder, os.W_OK | os.X_OK) else ""


class _Announcer(event.Listener):
    """Says once a process that functions of this project are being compiled."""

    def on_start(self, event: Any) -> None:
        function = event.data["dispatcher"].py_func
        if function.__module__.startswith("ncti.") and not self.said:
            self.said = True
            kept = f", and kept in {_folder()}" if _folder() else ""
            logging.getLogger("ncti").warning("loops are compiled, once: some seconds%s", kept)

    def on_end(self, event: Any) -> None:
        """Do nothing."""

    said = False


event.register("numba:compile", _Announcer())

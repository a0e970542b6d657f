"""Functions compiled by numba, kept in the user's cache and never in the package."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba.core import event

from ncti.machine_code import Loops, folder

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """Return a function that numba compiles on its first call, or finds in the user's cache.

    Notes
    -----
    Where the folder cannot be written, or another user could write it, code is compiled in each
    process. Division by zero gives infinity, as with arrays, and other threads of Python run
    meanwhile.
    """
    config: Any = numba.config  # its names are made when it is imported
    before = config.CACHE_DIR
    config.CACHE_DIR = folder()
    try:
        kept = bool(config.CACHE_DIR)
        dispatcher: Any = numba.njit(cache=kept, nogil=True, error_model="numpy")(function)
        return cast(F, dispatcher)
    finally:
        config.CACHE_DIR = before


def inlined(function: F) -> F:
    """Return a function that numba inlines; loops that call nothing can be vector instructions."""
    return cast(F, numba.njit(inline="always", error_model="numpy")(function))


class _Announcer(event.Listener):
    """Says once a process that functions of this project are being compiled."""

    def on_start(self, event: Any) -> None:
        function = event.data["dispatcher"].py_func
        if function.__module__.startswith("ncti.") and not self.said:
            self.said = True
            kept = f", and kept in {folder()}" if folder() else ""
            logging.getLogger("ncti").warning("loops are compiled, once: some seconds%s", kept)

    def on_end(self, event: Any) -> None:
        """Do nothing."""

    said = False


announcer = _Announcer()
event.register("numba:compile", announcer)


def keep(loops: Loops) -> None:
    """Compile loops in this process; others find their machine code, if there is a folder for it.

    Nothing is logged: who calls this tells of it.
    """
    before, announcer.said = announcer.said, True
    try:
        loops.call()
    finally:
        announcer.said = before

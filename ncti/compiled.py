"""Functions compiled by numba and kept in the user's cache, never in the package."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba.core import event

from ncti.machine_code import Loops, folder

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """Return a function that numba compiles on its first call, or loads from the user's cache.

    See Also
    --------
    inlined : For small functions called inside loops.
    keep : Compile loops ahead of their first use.

    Notes
    -----
    If the folder is not writable, or writable by another user, the code is compiled in each
    process. Division by zero gives infinity, as with arrays, and the function releases the
    interpreter's lock.
    """
    config: Any = numba.config  # its attributes are created on import
    before = config.CACHE_DIR
    config.CACHE_DIR = folder()
    try:
        kept = bool(config.CACHE_DIR)
        dispatcher: Any = numba.njit(cache=kept, nogil=True, error_model="numpy")(function)
        return cast(F, dispatcher)
    finally:
        config.CACHE_DIR = before


def inlined(function: F) -> F:
    """Return a function that numba inlines, so that the calling loop can be vectorised."""
    return cast(F, numba.njit(inline="always", error_model="numpy")(function))


class _Announcer(event.Listener):
    """Logs once per process that functions of this project are being compiled."""

    def on_start(self, event: Any) -> None:
        """Log the first compilation of a function of this project."""
        function = event.data["dispatcher"].py_func
        if function.__module__.startswith("ncti.") and not self.said:
            self.said = True
            kept = f" and keeping them in {folder()}" if folder() else ""
            logging.getLogger("ncti").warning("compiling loops%s; this takes some seconds", kept)

    def on_end(self, event: Any) -> None:
        """Do nothing."""

    said = False


announcer = _Announcer()
event.register("numba:compile", announcer)


def keep(loops: Loops) -> None:
    """Compile loops in this process; others load their machine code, if there is a folder for it.

    Nothing is logged: the caller reports it.
    """
    before, announcer.said = announcer.said, True
    try:
        loops.call()
    finally:
        announcer.said = before

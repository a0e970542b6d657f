"""Functions compiled by numba, with a cache in the user's folder, never in the package.

Only this module uses private names of numba, in versions 0.61 to 0.68: the public API neither
invalidates the cache when constants of other modules change, nor keeps code in memory when the
cache cannot be written.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any, TypeVar, cast

import numba
from numba.core import event

from ncti.machine_code import CompiledLoops, folder, folder_of

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """Return a function that numba compiles on its first call, or loads from the user's cache.

    If the folder is full, not writable, or writable by another user, the code is compiled in each
    process. Division by zero gives infinity, as with arrays, and the function releases the
    interpreter's lock.
    """
    config: Any = numba.config  # its attributes are created on import
    before = config.CACHE_DIR
    config.CACHE_DIR = folder_of(function.__code__.co_filename)
    compile_ = partial(numba.njit, nogil=True, error_model="numpy")
    try:
        dispatcher: Any = None
        if config.CACHE_DIR:
            with suppress(RuntimeError):  # nothing can be written there
                dispatcher = compile_(cache=True)(function)
        # numba may have chosen another folder.
        if dispatcher is None or not dispatcher.stats.cache_path.startswith(config.CACHE_DIR):
            return cast(F, compile_()(function))
        _ignore_cache_errors(dispatcher._cache)
        _stamp(dispatcher._cache, function)
        return cast(F, dispatcher)
    finally:
        config.CACHE_DIR = before


def _ignore_cache_errors(cache: Any) -> None:
    """Make a cache of numba tolerate files that it cannot read or write, as on a full disk."""
    load, save = cache.load_overload, cache.save_overload

    def load_overload(*args: Any) -> Any:
        try:
            return load(*args)
        except OSError:
            return None

    def save_overload(*args: Any) -> None:
        with suppress(OSError):
            save(*args)

    cache.load_overload, cache.save_overload = load_overload, save_overload


def _stamp(cache: Any, function: Callable[..., Any]) -> None:
    """Make a cache of numba reject machine code when constants of other modules change.

    Numba compiles them in, but checks only the time of the function's own file.
    """
    variables = sorted(function.__globals__.items())
    constants = tuple(
        (name, repr(value)) for name, value in variables if isinstance(value, int | float)
    )
    index = cache._cache_file
    index._source_stamp = (index._source_stamp, constants)


def inlined(function: F) -> F:
    """Return a function that numba inlines, so that the calling loop can be vectorised."""
    return cast(F, numba.njit(inline="always", error_model="numpy")(function))


class _Announcer(event.Listener):
    """Logs once per process that functions of this project are being compiled."""

    def on_start(self, event: Any) -> None:
        """Log the first compilation of a function of this project."""
        function = event.data["dispatcher"].py_func
        if function.__module__.startswith("ncti.") and not self.was_logged:
            self.was_logged = True
            place = f" and keeping them in {folder()}" if folder() else ""
            logging.getLogger("ncti").warning("compiling loops%s; this takes some seconds", place)

    def on_end(self, event: Any) -> None:
        """Do nothing."""

    was_logged = False


announcer = _Announcer()
event.register("numba:compile", announcer)


def keep(loops: CompiledLoops) -> None:
    """Compile loops, and cache their machine code for other processes if there is a folder for it.

    The function logs nothing: the caller reports the compilation.
    """
    before, announcer.was_logged = announcer.was_logged, True
    try:
        loops.warm_up()
    finally:
        announcer.was_logged = before

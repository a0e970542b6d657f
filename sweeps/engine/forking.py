"""A process that imports what workers need, and from which they are then forked.

A forked worker shares the memory of modules imported before. This process has only one
thread, so that forking it is safe.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import forkserver, resource_tracker
from typing import Any

from sweeps.engine.process import ONE_THREAD, environment

# Environment that a worker process must be started with, since libraries read it only then. It
# keeps 256 MiB of freed memory, and maps arrays separately from 32 MiB on, the most that allocators
# accept: with dask's 64 KiB, requests for memory take a quarter of the time of array-heavy tasks.
KEPT, MAPPED = 2**28, 2**25
ENVIRONMENT = ONE_THREAD | dict(
    MALLOC_TRIM_THRESHOLD_=str(KEPT), MALLOC_MMAP_THRESHOLD_=str(MAPPED)
)

IMPORTS = "IMPORTS"
"""Name of a module's list of what its stages import when they are called."""


def worth_importing(modules: Iterable[str]) -> list[str]:
    """Return names of some modules and of those listed in their `IMPORTS`, each once."""
    found = [(name, *getattr(sys.modules.get(name), IMPORTS, ())) for name in modules]
    return list(dict.fromkeys(name for names in found for name in names))


@contextmanager
def fork_server(modules: Iterable[str]) -> Iterator[str]:
    """Start the process that imports some modules; it ends with this context.

    Yields the start method of `multiprocessing` to use meanwhile. If a server
    was started ahead, it is used, whatever it imports. If this process has another one, which
    may have older code, or none can be started, as where the path of the temporary folder is too
    long for a socket, they are spawned instead.
    """
    server: Any = forkserver._forkserver
    if server._forkserver_pid is not None:
        yield "forkserver" if server._forkserver_pid in _ahead else "spawn"
        return
    before = server._preload_modules
    server.set_forkserver_preload(["distributed", *modules])
    try:
        method = "forkserver"
        try:
            with environment(ENVIRONMENT), interrupts_held():
                server.ensure_running()
        except OSError:
            method = "spawn"
        yield method
    finally:
        server.set_forkserver_preload(before)
        server._stop()


@contextmanager
def fork_server_ahead(modules: Iterable[str]) -> Iterator[None]:
    """Start the process that workers are forked from, before knowing whether any are needed.

    It ends with this context, even during its imports.
    """
    server: Any = forkserver._forkserver
    with fork_server(modules):
        own = server._forkserver_pid
        if own is None:
            yield
            return
        _ahead.add(own)
        try:
            yield
        finally:
            _ahead.discard(own)
            with suppress(ProcessLookupError):
                os.kill(own, signal.SIGTERM)


_ahead: set[int] = set()  # process ids


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Shield processes started meanwhile from Ctrl-C, which a terminal sends to all processes.

    This process receives it, at the end of this context at the earliest, and stops its workers in
    order; they would print tracebacks.
    """
    # Processes inherit the signals that the thread which starts them blocks, and threads those of
    # their starter, as does a worker that is restarted later. Python 3.11 unblocks the signal where
    # it first starts its resource tracker, so that must have started already.
    resource_tracker.ensure_running()
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    in_main_thread = threading.current_thread() is threading.main_thread()
    arrived = []
    # Other threads of this process may take the signal; its effect is left to the main one.
    if in_main_thread:
        before = signal.signal(signal.SIGINT, lambda *_: arrived.append(True))
    try:
        yield
    finally:
        if in_main_thread:
            signal.signal(signal.SIGINT, before)
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        if arrived:
            signal.raise_signal(signal.SIGINT)

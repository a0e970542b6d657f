"""A process that imports what workers need, once, and from which they are then forked.

A worker that is forked shares the memory of what was imported before. The process is alone in
having one thread, and so the only one from which it is safe to fork.
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
"""Name by which a module of stages lists what these import when they are called."""


def worth_importing(modules: Iterable[str]) -> list[str]:
    """Names of some modules, and of those that they list in `IMPORTS`, each once."""
    found = [(name, *getattr(sys.modules.get(name), IMPORTS, ())) for name in modules]
    return list(dict.fromkeys(name for names in found for name in names))


@contextmanager
def fork_server(modules: Iterable[str]) -> Iterator[str]:
    """Start the process that imports some modules; it ends with this context.

    Yields how processes are to be started meanwhile, as `multiprocessing` calls it. Where a server
    was started ahead, it is taken, whatever it imports. Where this process has another one, which
    may have older code, they are spawned instead.
    """
    server: Any = forkserver._forkserver
    if server._forkserver_pid is not None:
        yield "forkserver" if server._forkserver_pid in _ahead else "spawn"
        return
    before = server._preload_modules
    server.set_forkserver_preload(["distributed", *modules])
    try:
        with environment(ENVIRONMENT), interrupts_held():
            server.ensure_running()
        yield "forkserver"
    finally:
        server.set_forkserver_preload(before)
        server._stop()


@contextmanager
def fork_server_ahead(modules: Iterable[str]) -> Iterator[None]:
    """Start the process that workers are forked from before it is known whether any are needed.

    It ends with this context, at once if it still imports.
    """
    server: Any = forkserver._forkserver
    with fork_server(modules):
        own = server._forkserver_pid
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
    """Keep Ctrl-C, which a terminal sends to all processes, from those that are started meanwhile.

    This process hears it, at the end of this context at the earliest, and ends its workers in
    order; they would add their tracebacks.
    """
    # Processes inherit the signals that the thread which starts them blocks, and threads those of
    # their starter: so also a worker that is restarted later. Python 3.11 unblocks the signal where
    # it first starts its resource tracker, so that must be there already.
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

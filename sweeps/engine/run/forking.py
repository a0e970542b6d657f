"""Fork server: a process that imports the modules of workers, which are forked from it.

Forked workers share the memory of modules that the server has imported. The server has a single
thread, so forking it is safe.
"""

from __future__ import annotations

import ast
import inspect
import linecache
import multiprocessing
import os
import signal
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from multiprocessing import forkserver, resource_tracker
from multiprocessing.spawn import get_preparation_data

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.run.process import ONE_THREAD, environment

# Environment of new worker processes, since libraries read it only at start. malloc keeps 256 MiB
# of freed memory, and maps only arrays from 32 MiB, its largest threshold. With dask's 64 KiB,
# allocation takes a quarter of the time of array-heavy tasks.
TRIM_BYTES, MMAP_BYTES = 2**28, 2**25
ENVIRONMENT = ONE_THREAD | dict(
    MALLOC_TRIM_THRESHOLD_=str(TRIM_BYTES), MALLOC_MMAP_THRESHOLD_=str(MMAP_BYTES)
)

IMPORTS = "IMPORTS"
"""Name of a module's list of the modules that its stages import when called."""

SERVER = "sweeps.engine.run.server"
"""Module that the server imports first."""


def check_guard() -> None:
    """Refuse to start workers from a script without a guard, since they would run it again."""
    preparation = get_preparation_data("")
    module = preparation.get("init_main_from_path") or preparation.get("init_main_from_name", "")
    if not module or module.endswith(".__main__"):
        return  # a notebook, prompt or `python -m package`: workers run none of it
    frame = inspect.currentframe()
    while frame and (frame.f_code.co_name, frame.f_globals["__name__"]) != ("<module>", "__main__"):
        frame = frame.f_back
    script = frame and frame.f_code.co_filename
    if not frame or not script or not (text := "".join(linecache.getlines(script))):
        return
    line = frame.f_lineno
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.If) and node.lineno <= line <= (node.end_lineno or line):
            test = ast.unparse(node.test)
            if "__name__" in test or "parent_process" in test:
                return
    raise ConfigurationError(
        f"cluster is local, whose workers run {os.path.basename(script)} again, but line {line} of "
        'it is not guarded; put it under `if __name__ == "__main__":`, or use inline'
    )


def preloaded_modules(modules: Iterable[str]) -> list[str]:
    """Return modules and the ones that their `IMPORTS` list, each once."""
    imports = [(name, *getattr(sys.modules.get(name), IMPORTS, ())) for name in modules]
    return list(dict.fromkeys(name for names in imports for name in names))


def start_fork_server(modules: Iterable[str]) -> str:
    """Start the fork server, which imports modules; return the start method of workers.

    It lives as long as this process. At a prompt or in a notebook, where modules are edited and
    reloaded, each worker imports them itself. If the server cannot start, for example because the
    path of the temporary folder is too long for a socket, workers are spawned.
    """
    main = vars(sys.modules["__main__"])
    if not os.path.exists(main.get("__file__") or "."):  # '<stdin>', which no worker can run
        del main["__file__"]
    imported = [] if hasattr(sys, "ps1") else modules
    multiprocessing.set_forkserver_preload([SERVER, "distributed", *imported])
    try:
        with environment(ENVIRONMENT), block_interrupts():
            forkserver.ensure_running()
    except OSError:
        return "spawn"
    return "forkserver"


@contextmanager
def block_interrupts() -> Iterator[None]:
    """Let processes that start within this context ignore Ctrl-C and the end of the terminal.

    This process receives the signals, and stops its workers without tracebacks.
    """
    # Processes and threads inherit blocked signals from the thread that starts them, and so do
    # restarted workers. The resource tracker starts first: it ignores interrupts, and Python 3.11
    # unblocks them when it starts.
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGHUP])
    try:
        resource_tracker.ensure_running()
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)

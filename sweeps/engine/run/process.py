"""This process: its output, environment and threads."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import lru_cache
from typing import Any

from rich.console import Console
from threadpoolctl import ThreadpoolController  # type: ignore[import-untyped]

# Limit numerical libraries to one thread: tasks already run in parallel, results must not depend
# on how a matrix product is split, and waiting threads spin while other tasks use the cores.
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NUMEXPR")}

# output: a full disk, a closed pipe or a limited terminal costs no results


def say(name: str, sentence: str) -> None:
    """Print a sentence to stderr, ignoring errors."""
    with suppress(OSError, ValueError, AttributeError):  # there may be no stderr at all
        sys.stderr.write(f"{name}: {sentence}\n")
        sys.stderr.flush()


_write_errors: list[str] = []  # errors of writing to stdout


@contextmanager
def guarded_stdout() -> Iterator[None]:
    """Within this context, ignore a closed stdout, and record other errors of writing to it.

    `flush_output` returns the first recorded error.
    """
    try:
        yield
    except (BrokenPipeError, ValueError, SystemExit):  # rich ends the process for a closed pipe
        pass
    except OSError as error:
        _write_errors.append(error.strerror or str(error))


def show(printable: Any) -> None:
    """Print a text or a table of rich to stdout; see `guarded_stdout`."""
    with guarded_stdout():
        Console(highlight=False, markup=False, soft_wrap=True).print(printable)


def flush_output() -> str:
    """Flush stdout; return the first error of writing to it, unless its reader has ended."""
    is_flushed = sys.stdout is None
    with guarded_stdout():
        if sys.stdout is not None:
            sys.stdout.flush()
        is_flushed = True
    if not is_flushed:  # else Python tries again when it ends, and exits with 120
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    reason = _write_errors[0] if _write_errors else ""
    _write_errors.clear()
    return reason


# environment


@contextmanager
def environment(variables: Mapping[str, str], *changed: str) -> Iterator[None]:
    """Set environment variables within this context; then restore them, and `changed` ones."""
    before = {name: os.environ.get(name) for name in (*variables, *changed)}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value


@contextmanager
def call_every(seconds: float, function: Callable[[], object]) -> Iterator[None]:
    """Call a function every few seconds within this context; its OSErrors are ignored."""
    ended = threading.Event()

    def repeat() -> None:
        while not ended.wait(seconds):
            with suppress(OSError):
                function()

    thread = threading.Thread(
        target=repeat, name=getattr(function, "__name__", "repeat"), daemon=True
    )
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit numerical libraries, including ones loaded meanwhile, to one thread."""
    with environment(ONE_THREAD), _find_libraries(len(sys.modules)).limit(limits=1):
        yield


@lru_cache(maxsize=1)
def _find_libraries(modules: int) -> ThreadpoolController:
    """Return the numerical libraries; the search takes 30 ms, and is repeated after imports."""
    return ThreadpoolController()

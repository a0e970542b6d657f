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

# Environment of numerical libraries. Tasks are the parallelism, results must not depend on how a
# product is split, and threads that wait for one another spin when a neighbour has the cores.
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NUMEXPR")}

# output: a full disk, a closed pipe or a limited terminal costs no results


def say(name: str, sentence: str) -> None:
    """Print a sentence to stderr, ignoring errors."""
    with suppress(OSError, ValueError, AttributeError):  # there may be no stderr at all
        sys.stderr.write(f"{name}: {sentence}\n")
        sys.stderr.flush()


def show(what: Any) -> None:
    """Print a text or a table of rich to stdout, ignoring errors."""
    with suppress(OSError, ValueError, SystemExit):  # rich ends the process for a closed pipe
        Console(highlight=False, markup=False, soft_wrap=True).print(what)


@contextmanager
def tolerant_output() -> Iterator[Callable[[], str]]:
    """Suppress errors of printing to stdout or stderr within this context.

    Yields a function that returns why writing to stdout failed; empty if it did not, or its
    reader has ended.
    """
    before = sys.stdout, sys.stderr
    for stream in before:
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    forgave = [one if one is None else _TolerantStream(one) for one in before]
    sys.stdout, sys.stderr = forgave
    try:
        yield lambda: forgave[0].lost() if forgave[0] is not None else ""
    finally:
        sys.stdout, sys.stderr = before
        for stream in before:
            _discard_pending(stream)


class _TolerantStream:
    """A stream that ignores errors of writing."""

    def __init__(self, stream: Any) -> None:
        self._stream, self._why = stream, ""

    def write(self, text: str) -> int:
        with self._noted():
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        with self._noted():
            self._stream.flush()

    def lost(self) -> str:
        self.flush()
        return self._why

    @contextmanager
    def _noted(self) -> Iterator[None]:
        try:
            yield
        except (BrokenPipeError, ValueError):
            pass
        except OSError as error:
            self._why = error.strerror or str(error)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def _discard_pending(stream: Any) -> None:
    """Discard unprintable output: else Python tries again at exit, and exits with 120."""
    if stream is None:
        return
    try:
        stream.flush()
    except (OSError, ValueError):
        with suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)


# environment


@contextmanager
def environment(variables: Mapping[str, str], *changed: str) -> Iterator[None]:
    """Set environment variables within this context; restore them and those named in `changed`."""
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

    thread = threading.Thread(target=repeat, name="lease", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit numerical libraries, including those loaded meanwhile, to one thread."""
    with environment(ONE_THREAD), _libraries(len(sys.modules)).limit(limits=1):
        yield


@lru_cache(maxsize=1)
def _libraries(modules: int) -> ThreadpoolController:
    """Return the numerical libraries; the search takes 30 ms, and is repeated after imports."""
    return ThreadpoolController()

"""This process: its output, environment, threads, and the signals that ask it to stop.

No signal is lost, and none interrupts cleaning up: an exception raised at any moment would be
swallowed by some library, or cut short what stops workers. So a signal is only noted, and `Stopped`
is raised where the program asks (`heed`), or at any moment of what may take long and needs no
cleaning up (`interruptible`).
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import lru_cache
from types import FrameType
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
def forgiving() -> Iterator[None]:
    """Suppress errors of printing to stdout or stderr within this context."""
    before = sys.stdout, sys.stderr
    for stream in before:
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    sys.stdout, sys.stderr = (one if one is None else _Forgiving(one) for one in before)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before
        for stream in before:
            _settle(stream)


class _Forgiving:
    """A stream that drops what cannot be written."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        with suppress(OSError, ValueError):
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        with suppress(OSError, ValueError):
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def _settle(stream: Any) -> None:
    """Discard what cannot be printed: else Python tries again at exit, and exits with 120."""
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

CACHE = "SWEEP_CACHE"  # the environment variable that has the folder of the cache, if one is given


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
def repeating(seconds: float, function: Callable[[], object]) -> Iterator[None]:
    """Call a function from time to time within this context; it may fail by OSError."""
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
    """Return the numerical libraries; looked for, which takes 30 ms, after further imports only."""
    return ThreadpoolController()


# signals

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
PATIENCE = 5.0  # s of cleaning up, after which another signal ends the process at once


class Stopped(BaseException):
    """The process is asked to end; holds the signal's number."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number

    @property
    def words(self) -> str:
        """Return what happened, for the user."""
        if self.number == signal.SIGINT:
            return "interrupted"
        return f"stopped by {signal.Signals(self.number).name}"

    @property
    def status(self) -> int:
        """Return the exit status of a process that a signal stopped."""
        return 128 + self.number


class _Noted:
    """The signal that arrived, and whether one may interrupt now."""

    number: int | None = None
    at = 0.0  # s, monotonic
    handled = False
    interruptible = 0


_noted = _Noted()


@contextmanager
def stopping() -> Iterator[None]:
    """Note signals within this context; inside another such context, do nothing.

    Signals that are ignored, as by `nohup` or in the background, stay so.
    """
    if _noted.handled or threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers = {one: signal.getsignal(one) for one in SIGNALS}
    before = {one: was for one, was in handlers.items() if was not in (signal.SIG_IGN, None)}
    hook = sys.unraisablehook
    _noted.number, _noted.interruptible, _noted.handled = None, 0, True
    # Nothing is printed of a `Stopped` that the interpreter cannot raise.
    sys.unraisablehook = lambda error: issubclass(error.exc_type, Stopped) or hook(error)
    for one in before:
        signal.signal(one, _note)
    try:
        yield
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)
        sys.unraisablehook, _noted.handled = hook, False


def heed() -> None:
    """Raise `Stopped` if a signal has arrived."""
    if _is_here() and _noted.number is not None:
        raise Stopped(_noted.number)


def heeding(say: Callable[[str], None]) -> Callable[[str], None]:
    """Return a function that says a sentence, unless a signal has arrived."""

    def heeded(sentence: str) -> None:
        heed()
        say(sentence)

    return heeded


@contextmanager
def interruptible() -> Iterator[None]:
    """Let a signal raise `Stopped` at any moment of this context, its first included."""
    if not _is_here():
        yield
        return
    _noted.interruptible += 1  # before asking, so that no signal falls in between
    try:
        heed()
        yield
    finally:
        _noted.interruptible -= 1
    heed()  # something may have swallowed the exception


def _is_here() -> bool:
    return _noted.handled and threading.current_thread() is threading.main_thread()


def _note(number: int, frame: FrameType | None) -> None:
    if _noted.number is None:
        _noted.number, _noted.at = number, time.monotonic()
        if _noted.interruptible:
            raise Stopped(number)
    elif time.monotonic() - _noted.at > PATIENCE:
        os._exit(128 + number)

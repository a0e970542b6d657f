"""Signals that ask this process to stop.

The handler only records the signal. `raise_if_stopped` and `allow_interrupts` raise `Stopped` at
safe points. The module imports little because it is imported first.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, SimpleNamespace

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
CLEANUP_SECONDS = 5.0  # s of cleanup, after which another signal ends the process at once


class Stopped(BaseException):
    """The process is asked to end; holds the signal's number."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number

    @property
    def message(self) -> str:
        """Message for the user."""
        if self.number == signal.SIGINT:
            return "interrupted"
        return f"stopped by {signal.Signals(self.number).name}"

    @property
    def status(self) -> int:
        """Return the exit status of a process that a signal stopped."""
        return 128 + self.number


# The signal that arrived, its time [s, monotonic], and whether a signal may interrupt now.
_state = SimpleNamespace(number=None, arrived=0.0, handled=False, interruptible=0)


@contextmanager
def defer_signals() -> Iterator[None]:
    """Defer signals within this context, unless another such context does.

    Ignored signals, as under `nohup` or in the background, stay ignored.
    """
    if _state.handled or threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers = {number: signal.getsignal(number) for number in SIGNALS}
    previous = {
        number: handler
        for number, handler in handlers.items()
        if handler not in (signal.SIG_IGN, None)
    }
    hook = sys.unraisablehook
    _state.number, _state.interruptible, _state.handled = None, 0, True
    # Do not print a `Stopped` raised where Python ignores exceptions, as in `__del__`.
    sys.unraisablehook = lambda error: issubclass(error.exc_type, Stopped) or hook(error)
    for number in previous:
        signal.signal(number, _handle_signal)
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
        sys.unraisablehook, _state.handled = hook, False


def raise_if_stopped() -> None:
    """Raise `Stopped` if a signal has arrived."""
    if _handles_signals() and _state.number is not None:
        raise Stopped(_state.number)


@contextmanager
def allow_interrupts() -> Iterator[None]:
    """Let signals raise `Stopped` within this context, and on entry if one has arrived."""
    if not _handles_signals():
        yield
        return
    _state.interruptible += 1  # before asking, so that no signal falls in between
    try:
        raise_if_stopped()
        yield
    finally:
        _state.interruptible -= 1
    raise_if_stopped()  # something may have swallowed the exception


def _handles_signals() -> bool:
    return _state.handled and threading.current_thread() is threading.main_thread()


def _handle_signal(number: int, frame: FrameType | None) -> None:
    if _state.number is None:
        _state.number, _state.arrived = number, time.monotonic()
        if _state.interruptible:
            raise Stopped(number)
    elif time.monotonic() - _state.arrived > CLEANUP_SECONDS:
        os._exit(128 + number)

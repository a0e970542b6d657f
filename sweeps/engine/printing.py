"""Printing that never costs results: a full disk, a closed pipe or a poor terminal is no error."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from rich.console import Console


def say(name: str, sentence: str) -> None:
    """Print a sentence to stderr, whatever becomes of it."""
    with suppress(OSError, ValueError, AttributeError):  # there may be no stderr at all
        text = f"{name}: {sentence}\n"
        encoding = sys.stderr.encoding or "utf-8"
        sys.stderr.write(text.encode(encoding, "backslashreplace").decode(encoding))
        sys.stderr.flush()


def show(what: Any, *, error: bool = False) -> None:
    """Print a text or a table of rich, whatever becomes of it."""
    stream = sys.stderr if error else sys.stdout
    with suppress(OSError, ValueError, SystemExit):  # rich ends the process for a closed pipe
        console = Console(file=stream, highlight=False, markup=False, soft_wrap=True)
        console.print(what)
        console.file.flush()


@contextmanager
def forgiving() -> Iterator[None]:
    """Let nothing that is printed to stdout or stderr meanwhile raise an error."""
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
    """A stream that loses what cannot be written."""

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
    """Give up what cannot be printed: else Python tries again at the end, and exits with 120."""
    if stream is None:
        return
    try:
        stream.flush()
    except (OSError, ValueError):
        with suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)

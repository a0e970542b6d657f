"""Failed cells and tables: their reasons, tracebacks and arguments."""

from __future__ import annotations

import traceback
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from textwrap import indent
from typing import Any, NamedTuple

import numpy as np

INDENT = "    "
RAISED = (Exception, SystemExit)  # by a function that fails; others end the sweep
MAX_ARGUMENT, MAX_TRACEBACK = 200, 20_000  # characters of an argument; of a traceback


class Failure(NamedTuple):
    """A failed cell or table: its name, the reason in one line, arguments and traceback."""

    name: str
    reason: str
    arguments: str = ""  # a line each
    traceback: str = ""


def one_line(error: BaseException) -> str:
    """Return an exception in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())


def format_traceback(error: BaseException) -> str:
    """Return the traceback of an exception, without the middle of a very long one."""
    text = "".join(traceback.format_exception(error)).rstrip()
    half = MAX_TRACEBACK // 2
    return text if len(text) <= MAX_TRACEBACK else f"{text[:half]}\n...\n{text[-half:]}"


def format_arguments(arguments: Mapping[str, Any]) -> str:
    """Return a line for each argument; arrays with dtype, shape and first values."""
    lines = []
    for name, value in arguments.items():
        try:
            text = " ".join(repr(value).split())
        except Exception as error:  # of any class's own `__repr__`
            text = f"{type(value).__name__} without a representation ({one_line(error)})"
        if len(text) > MAX_ARGUMENT:
            text = f"{text[:MAX_ARGUMENT]}..."
        array = isinstance(value, np.ndarray)
        lines.append(f"{name} = {f'{value.dtype} {value.shape} ' if array else ''}{text}")
    return "\n".join(lines)


class FailureLog:
    """Log file of failures, created with the first failure.

    It replaces a repeated traceback by the name of the first failure that has it, and ignores
    errors of writing.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.exists = False
        self._first_names: dict[str, str] = {}

    def add(self, failure: Failure) -> None:
        """Append a failure."""
        parts = [failure.reason]
        if failure.arguments:
            parts.append(f"arguments:\n{indent(failure.arguments, INDENT)}")
        if failure.traceback:
            first = self._first_names.setdefault(failure.traceback, failure.name)
            repeated = first != failure.name
            parts.append(f"traceback as of {first}" if repeated else failure.traceback)
        text = "\n".join(parts)
        with suppress(OSError), self.path.open("a", encoding="utf-8", errors="replace") as file:
            file.write(f"{failure.name}\n{indent(text, INDENT)}\n\n")
            self.exists = True

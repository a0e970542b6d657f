"""Console output of any width and encoding, to a stream that may be closed."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO

from rich.console import Console
from rich.text import Text

from ncti.text import printable
from sweeps.engine.run.process import guarded_stdout

PIPE_WIDTH = 80  # cells of a line where there is no terminal
ASCII = str.maketrans({"–": "-", "−": "-", "±": "~", "×": "x", "µ": "u", "°": " ", "…": "."})


def stdout_console() -> Console:
    """Return the console of stdout: as wide as the terminal, elsewhere 80 cells or `COLUMNS`."""
    console = Console(highlight=False)
    if not console.is_terminal:
        columns = os.environ.get("COLUMNS", "")
        console.width = max(PIPE_WIDTH, int(columns) if columns.isdigit() else 0)
    return console


@contextmanager
def buffered_console(console: Console) -> Iterator[Console]:
    """Yield a buffered console; finally write its text to another, as far as possible."""
    text = io.StringIO()
    yield Console(
        file=text,
        width=console.width,
        force_terminal=console.is_terminal,
        color_system=console.color_system,  # type: ignore[arg-type]
        no_color=console.no_color,
    )
    _write_text(text.getvalue(), console.file, console.encoding)


def _write_text(text: str, file: IO[str], encoding: str) -> None:
    """Write to a file that may be closed, or of another encoding."""
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        text = text.translate(ASCII).encode(encoding, "replace").decode(encoding)
    with guarded_stdout():
        file.write(text)
        file.flush()


def plain_text(text: str) -> Text:
    """Return a text without markup, its control characters except newlines escaped."""
    return Text("\n".join(map(printable, text.split("\n"))))


def print_line(text: str, console: Console) -> None:
    """Print one line without wrapping."""
    console.print(plain_text(text), soft_wrap=True)


def print_note(text: str, console: Console, *, style: str = "dim") -> None:
    """Print a note, if it says anything."""
    if text:
        console.print(plain_text(text), style=style)

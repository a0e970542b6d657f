"""What the report writes: CSV files, whole or not at all, and text for whatever screen there is."""

from __future__ import annotations

import csv
import io
import os
import sys
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from rich.console import Console

from sweeps.report.rows import Row

PARTIAL = ".partial"

# Every file of a folder of tables; those that a store has no tables for are removed.
FILES = (
    *("categories", "accuracy", "classifiers", "fusion", "infrared_sensor", "infrared_categories"),
    *("infrared_accuracy", "infrared_detection", "infrared_super_resolution", "rejection"),
    *("rejection_curve", "flights", "measured"),
)
FORMULA = ("=", "+", "-", "@", "\t", "\r")  # with which a spreadsheet takes a cell for a formula
PLAINER = str.maketrans({"–": "-", "−": "-", "±": "~", "×": "x", "µ": "u", "°": " ", "…": "."})


def write_tables(folder: Path, tables: Mapping[str, list[Row]]) -> list[str]:
    """Write rows as CSV by name, in place of an earlier run's; returns the names of the files.

    Raises OSError if the folder cannot be written to.
    """
    folder.mkdir(exist_ok=True)
    there = {name: rows for name, rows in tables.items() if rows}
    for name, rows in there.items():
        write_csv(folder / f"{name}.csv", rows)
    for name in set(FILES) - set(there):
        (folder / f"{name}.csv").unlink(missing_ok=True)
    return [f"{name}.csv" for name in there]


def write_csv(path: Path, rows: list[Row]) -> None:
    """Write rows with their keys as header; an absent value is an empty field."""
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerows([[*map(neutral, rows[0])], *([*map(neutral, row.values())] for row in rows)])
    content = text.getvalue().encode("utf-8", "backslashreplace")
    write_whole(path, lambda made: made.write_bytes(content))


def write_whole(path: Path, write: Callable[[Path], Any]) -> None:
    """Write a file under another name and then move it: what can be seen is whole."""
    made = path.with_name(f".{path.name}.{uuid.uuid4().hex}{PARTIAL}")
    try:
        write(made)
        made.replace(path)
    finally:
        made.unlink(missing_ok=True)


def neutral(value: Any) -> Any:
    """A cell that no spreadsheet takes for a formula: an apostrophe stands before such a text."""
    if not isinstance(value, str) or not value.startswith(FORMULA):
        return value
    with suppress(ValueError):
        float(value)
        return value
    return f"'{value}"


class _Page(io.StringIO):
    """Text on its way to a screen, drawn with what the encoding of that has."""

    encoding: str = "utf-8"


@contextmanager
def page(console: Console) -> Iterator[Console]:
    """A console whose text goes to another one in the end, as far as that can take it.

    A closed pipe ends it in silence, a full device with a sentence on stderr.
    """
    text = _Page()
    text.encoding = console.encoding
    yield Console(
        file=text,
        width=console.width,
        force_terminal=console.is_terminal,
        color_system=console.color_system,  # type: ignore[arg-type]
        no_color=console.no_color,
        legacy_windows=False,
    )
    say(text.getvalue(), console.file, console.encoding)


def say(text: str, file: IO[str], encoding: str) -> None:
    """Write a text to a file that may be closed, full, or of another encoding."""
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        text = text.translate(PLAINER).encode(encoding, "replace").decode(encoding)
    try:
        file.write(text)
        file.flush()
    except BrokenPipeError:
        _silence(file)
    except OSError as error:
        _silence(file)
        complain(f"tables cannot be printed: {error.strerror or error}")
    except ValueError:  # closed
        return


def complain(sentence: str, program: str = "ncti-report") -> None:
    """Say a sentence on stderr, if anybody listens."""
    with suppress(OSError, ValueError, AttributeError):
        print(f"{program}: {sentence}", file=sys.stderr, flush=True)


def _silence(file: IO[str]) -> None:
    """Let what is left of a text go nowhere, so that closing the file does not fail."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, file.fileno())
        os.close(nowhere)

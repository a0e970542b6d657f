"""Output of the report: tables on any screen, and as CSV files."""

from __future__ import annotations

import csv
import io
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from rich.console import Console

from sweeps.report.axes import NOTHING, Axis, Column, printable, shown, told
from sweeps.report.layout import plain, sheet, show
from sweeps.report.own import OwnFiles
from sweeps.report.rows import BIN, Row, axes_in, grouped, several

SOURCE = "source"
PIPED = 80  # cells of a line where there is no terminal
PUT_IN = "* Assumed: reflectivity of the transom and the masts, relative to the rest of the ship."

# Names of tables with a layout of their own.
FILES = (
    *("categories", "accuracy", "classifiers", "fusion", "infrared_sensor", "infrared_categories"),
    *("infrared_accuracy", "infrared_detection", "infrared_super_resolution", "rejection"),
    *("rejection_curve", "flights", "measured", "scan", "stages"),
)
FORMULA = ("=", "+", "-", "@", "\t", "\r")  # prefixes of formulas in spreadsheets
PLAINER = str.maketrans({"–": "-", "−": "-", "±": "~", "×": "x", "µ": "u", "°": " ", "…": "."})

Lines = Iterable[tuple[str, list[Row]]]


def write_tables(folder: Path, tables: Mapping[str, list[Row]]) -> list[Path]:
    """Write rows as CSV by name; returns the paths at which other files are in the way.

    Tables of an earlier run are removed, unless they were changed since. Raises OSError if it
    cannot.
    """
    contents = {f"{name}.csv": _csv(rows) for name, rows in tables.items() if rows}
    files = OwnFiles(folder)
    for name, content in contents.items():
        files.put(name, content)
    for name in files.names:
        if name.endswith(".csv") and name not in contents:
            files.remove(name)
    return files.kept


def _csv(rows: list[Row]) -> bytes:
    """Return rows with their keys as header; an absent value is an empty field."""
    text = io.StringIO(newline="")
    lines = ([*map(neutral, line)] for line in (rows[0], *(row.values() for row in rows)))
    csv.writer(text).writerows(lines)
    return text.getvalue().encode("utf-8", "backslashreplace")


def neutral(value: Any) -> Any:
    """Return a cell that no spreadsheet reads as a formula, with an apostrophe if needed."""
    if not isinstance(value, str) or not value.startswith(FORMULA):
        return value
    with suppress(ValueError):
        float(value)
        return value
    return f"'{value}"


def screen() -> Console:
    """Return the console of stdout: as wide as the terminal, elsewhere 80 cells or `COLUMNS`."""
    console = Console(highlight=False)
    if not console.is_terminal:
        asked = os.environ.get("COLUMNS", "")
        console.width = max(PIPED, int(asked) if asked.isdigit() else 0)
    return console


class _Page(io.StringIO):
    """Buffer of text for a screen, limited to the characters of its encoding."""

    encoding: str = "utf-8"


@contextmanager
def page(console: Console) -> Iterator[Console]:
    """Yield a console whose text is finally written to another one, as far as possible."""
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
    _say(text.getvalue(), console.file, console.encoding)


def _say(text: str, file: IO[str], encoding: str) -> None:
    """Write to a file that may be closed, full (a sentence on stderr), or of another encoding."""
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        text = text.translate(PLAINER).encode(encoding, "replace").decode(encoding)
    try:
        file.write(text)
        file.flush()
    except OSError as error:
        # Discard the rest of the text, so that closing the file does not fail.
        with suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, file.fileno())
            os.close(nowhere)
        if not isinstance(error, BrokenPipeError):
            complain(f"tables cannot be printed: {error.strerror or error}")
    except ValueError:  # closed
        return


def complain(sentence: str) -> None:
    """Print a sentence to stderr, ignoring errors."""
    with suppress(OSError, ValueError, AttributeError):
        print(f"ncti-report: {sentence}", file=sys.stderr, flush=True)


def line(text: str, console: Console) -> None:
    """Print one line without wrapping."""
    console.print(plain(text), soft_wrap=True)


def note(text: str, console: Console) -> None:
    """Print a note on a table."""
    console.print(plain(text), style="dim")


def explain(columns: Iterable[Column], console: Console) -> None:
    """Print the meaning of columns, from their long names in the store."""
    meant = [f"{one.words}: {printable(one.long_name)}" for one in columns if one.long_name]
    if meant:
        note(f"{'; '.join(meant)}.", console)


def unforeseen(rows: list[Row]) -> list[Axis]:
    """Return axes of several values that no table has words for."""
    return [axis for axis in several(rows) if not (axis.foreseen or axis.number)]


def settings(
    rows: list[Row], always: Sequence[str], *, but: Iterable[str]
) -> Iterator[tuple[str, list[Row]]]:
    """Yield rows by setting, each with its words for a title.

    Axes in `always` come first, then others of several values, except the columns `but`,
    which are inside the table.
    """
    first = [axis for name in always for axis in axes_in(rows) if axis.name == name]
    more = [axis for axis in several(rows, but=but) if axis not in first]
    keys = (*first, *more)
    whole = [row for row in rows if all(row.get(axis) is not None for axis in keys)]
    for place in grouped(whole, keys) or [()]:
        at = dict(zip(keys, place, strict=False))
        # A row that does not depend on an axis appears at all of its values.
        here = [row for row in rows if all(row.get(key) in (None, at[key]) for key in at)]
        yield ", ".join(told(at, at)), here


def by_frames(rows: Iterable[Row]) -> list[tuple[str, list[Row]]]:
    """Return rows by number of frames, the largest first, after training."""
    found = grouped(rows, ("frame_count",))
    places = sorted(found, key=lambda place: place[0] or math.inf, reverse=True)
    return [(frames_text(place[0]), found[place]) for place in places]


def frames_text(count: int | None) -> str:
    """Return a number of frames in words; None means training."""
    return "training" if count is None else "1 frame" if count == 1 else f"{count} frames"


def print_scores(title: str, heading: str, lines: Lines, console: Console) -> None:
    """Print percent correct: aspect bins across, with the source's, if any, below each line.

    A line has a label and rows; one without rows is a heading.
    """
    lines = list(lines)
    bins = list(dict.fromkeys(row[BIN] for _, rows in lines for row in rows))
    labels = [label if label == "overall" else f"{label}°" for label in bins]
    table = sheet(title, *labels, left=(heading,))
    indent = "  " if any(not rows for _, rows in lines) else ""
    for name, rows in lines:
        if not rows:
            table.add_row(name, *("" for _ in bins))
            continue
        found = {row[BIN]: row for row in rows}
        style = "bold" if name.startswith("both") else None
        figures = [percent_text(found.get(label)) for label in bins]
        table.add_row(indent + name, *figures, style=style)
        theirs = [found.get(label, {}).get("source_percent") for label in bins]
        if any(figure is not None for figure in theirs):
            texts = ("" if figure is None else str(figure) for figure in theirs)
            table.add_row(f"{indent}  {SOURCE}", *texts, style="dim")
    show(table, console)


def print_grid(
    rows: list[Row],
    title: Callable[[str], str],
    down: Mapping[str, str],
    across: tuple[str, Mapping[Any, str]],
    figure: str,
    text: Callable[[float], str],
    console: Console,
) -> None:
    """Print a figure down and across: columns `down` by their headings, of one `across` values."""
    column, headings = across
    for words, group in settings(rows, (), but=(*down, column, BIN)):
        named = title(f", {words}" if words else "")
        # Words stand to the left, numbers to the right.
        words_first = all(isinstance(row[key], str) for row in group for key in down)
        labels = {"left": tuple(down.values())} if words_first else {"keys": len(down)}
        table = sheet(named, *(() if words_first else down.values()), *headings.values(), **labels)
        for place, line in grouped(group, tuple(down)).items():
            found = {row[column]: row[figure] for row in line if row[figure] is not None}
            texts = (text(found[key]) if key in found else NOTHING for key in headings)
            table.add_row(*map(shown, place), *texts)
        show(table, console)


def percent_text(row: Row | None) -> str:
    """Return percent correct and its interval; the standard deviation over draws is in the CSV."""
    if row is None:
        return ""
    if row["percent_correct"] is None:
        return NOTHING
    return f"{row['percent_correct']:.0f} [{row['ci_low']:.0f}-{row['ci_high']:.0f}]"

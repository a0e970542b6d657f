"""Tables on any screen: headings fold, labels wrap, columns that do not fit move below."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from typing import IO

from rich.cells import cell_len, chop_cells
from rich.console import Console
from rich.text import Text

from sweeps.report.pivot import Cell, Table
from sweeps.report.words import printable

PIPED = 80  # cells of a line where there is no terminal
PLAINER = str.maketrans({"–": "-", "−": "-", "±": "~", "×": "x", "µ": "u", "°": " ", "…": "."})
GAP = 2  # blanks between columns
WIDEST, WIDEST_FIGURE, LEAST = 26, 40, 4  # cells of a column of labels, of figures, of any
FOLDED = 16  # of a single column of labels that folds, so that all figures fit
MOST = 60  # rows of a table; its file has all


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


def plain(text: str) -> Text:
    """Return a text as it is, lines apart, its control characters escaped and no markup read."""
    return Text("\n".join(map(printable, text.split("\n"))))


def line(text: str, console: Console) -> None:
    """Print one line without wrapping."""
    console.print(plain(text), soft_wrap=True)


def note(text: str, console: Console, *, style: str = "dim") -> None:
    """Print a note on a table, if it says anything."""
    if text:
        console.print(plain(text), style=style)


def print_table(
    table: Table, console: Console, *, most: int | None = MOST, say_rest: bool = True
) -> None:
    """Print a table with what holds for all its rows, no wider than the console.

    Axes that do not fit as columns of labels become headings of sections, and figures that do not
    fit move into a table below.
    """
    console.print()
    note(table.title, console, style="bold")
    lines = table.lines[:most]
    texts = [[text_of(cell) for cell in line.cells] for line in lines]
    figures = [
        _column(head, [row[k] for row in texts], WIDEST_FIGURE)
        for k, head in enumerate(table.heads)
    ]
    labels = [
        _column(column.heading, [line.keys[k] for line in lines], WIDEST)
        for k, column in enumerate(table.down)
    ]
    # As many axes head sections as are needed for all figures, or else for the widest, to fit.
    wide, most_apart = max((one.width for one in figures), default=0), max(len(labels) - 1, 0)
    last = min(_sum(labels[most_apart:]), FOLDED)
    whole = _sum(figures) if last + GAP + _sum(figures) <= console.width else wide
    apart = 0
    while apart < most_apart and _sum(labels[apart:]) + GAP + whole > console.width:
        apart += 1
    shown = labels[apart:]
    if len(shown) == 1 and console.width - GAP - _sum(figures) >= FOLDED:
        shown = [replace(shown[0], width=min(shown[0].width, console.width - GAP - _sum(figures)))]
    if shown and _sum(shown) + GAP + wide > console.width:
        shown = [replace(shown[0], width=max(console.width - wide - GAP, LEAST))]
    for number, share in enumerate(_shares(figures, console.width - _sum(shown) - GAP)):
        if number:
            note("(further columns of the same table)", console)
        columns = [*shown, *(figures[k] for k in share)]
        _print_row(columns, [one.head for one in columns], console, style="bold", low=True)
        note("─" * _sum(columns), console)
        before: tuple[str, ...] = ()
        for line, row in zip(lines, texts, strict=True):
            if apart and line.keys[:apart] != before[:apart]:
                before = ()
                note(_place(table, line.keys[:apart]), console, style="bold")
            keys = _unrepeated(line.keys[apart:], before[apart:])
            _print_row(columns, [*keys, *(row[k] for k in share)], console)
            before = line.keys
    if say_rest and len(table.lines) > len(lines):
        note(f"{len(table.lines) - len(lines)} more rows are in the CSV file.", console)
    for text in table.notes:
        note(text, console)


@dataclass(frozen=True)
class _Printed:
    """Column as printed: its heading, its width, and whether its texts stand to the right."""

    head: str
    width: int
    right: bool


def _column(head: str, texts: Sequence[str], widest: int) -> _Printed:
    """Return a column as wide as its texts, and as the words of its heading, which fold."""
    words = [*head.split(), *(one for text in texts for one in text.split("\n"))]
    width = max(map(cell_len, words), default=1)
    is_short = cell_len(head) <= max(width, 10)
    width = max(width, cell_len(head)) if is_short else width
    return _Printed(head, min(width, widest), widest == WIDEST_FIGURE)


def _sum(columns: Sequence[_Printed]) -> int:
    return sum(one.width for one in columns) + GAP * max(len(columns) - 1, 0)


def _print_row(
    columns: Sequence[_Printed],
    texts: Sequence[str],
    console: Console,
    *,
    style: str = "",
    low: bool = False,
) -> None:
    """Print cells beside each other, folded at blanks; of headings the last lines are level."""
    cells = [
        [part for line in text.split("\n") for part in _folded(printable(line), column.width)]
        for column, text in zip(columns, texts, strict=True)
    ]
    tall = max(map(len, cells), default=0)
    cells = [[""] * (tall - len(c)) + c if low else c + [""] * (tall - len(c)) for c in cells]
    for parts in zip(*cells, strict=True):
        padded = []
        for column, part in zip(columns, parts, strict=True):
            blank = " " * (column.width - cell_len(part))
            padded.append(blank + part if column.right else part + blank)
        console.print(Text((" " * GAP).join(padded).rstrip(), style=style), soft_wrap=True)


def _folded(text: str, width: int) -> list[str]:
    """Return a text in lines of some cells, broken at blanks; only a longer word is broken."""
    lines = [""]
    for word in text.split(" "):
        while cell_len(word) > width:
            head = chop_cells(word, width)[0]
            lines.append(head)
            word = word[len(head) :]
        joined = f"{lines[-1]} {word}" if lines[-1] else word
        if cell_len(joined) <= width:
            lines[-1] = joined
        else:
            lines.append(word)
    return [line for line in lines if line] or [""]


def text_of(cell: Cell) -> str:
    """Return a figure with its interval or spread, and the article's below."""
    interval = f" [{cell.interval}]" if cell.interval else ""
    spread = f" {cell.spread}" if cell.spread else ""
    return cell.text + interval + spread + (f"\narticle {cell.source}" if cell.source else "")


def _place(table: Table, keys: Sequence[str]) -> str:
    """Return the values of the first axes of a table in words."""
    return ", ".join(
        f"{column.words} {text} {column.unit}".strip()
        for column, text in zip(table.down, keys, strict=False)
        if text
    )


def _unrepeated(keys: Sequence[str], before: Sequence[str]) -> list[str]:
    """Return the keys of a row, empty as long as they are those of the row before."""
    same = 0
    while same < min(len(keys), len(before)) - 1 and keys[same] == before[same]:
        same += 1
    return ["" if k < same else key for k, key in enumerate(keys)]


def _shares(figures: Sequence[_Printed], width: int) -> Iterator[list[int]]:
    """Yield numbers of the figures of each printed table."""
    share: list[int] = []
    for k in range(len(figures)):
        if share and _sum([figures[one] for one in (*share, k)]) > width:
            yield share
            share = []
        share.append(k)
    yield share

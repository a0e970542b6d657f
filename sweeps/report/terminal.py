"""Tables on a screen: headings fold, labels wrap, columns that do not fit move below."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Literal

from rich.cells import cell_len
from rich.console import Console
from rich.table import Table

from sweeps.report.pivot import Entry, Line, TextTable
from sweeps.report.screen import plain_text, print_note

GAP = 2  # blanks between columns
MAX_LABEL_WIDTH, MAX_FIGURE_WIDTH, MIN_WIDTH = 26, 40, 4  # of a column, in characters
FOLDED_WIDTH = 16  # of a single column of labels that folds, so that all figures fit
MAX_ROWS = 60  # rows of a table; its file has all


@dataclass(frozen=True)
class _Column:
    """A printed column: its heading, its width, and whether its texts align right."""

    head: str
    width: int
    right: bool = False


def print_table(table: TextTable, console: Console, *, max_rows: int | None = MAX_ROWS) -> None:
    """Print a table and its notes, no wider than the console.

    Axes that do not fit as columns of labels become headings of sections, and figures that do not
    fit move into a table below.
    """
    console.print()
    print_note(table.title, console, style="bold")
    lines = table.lines[:max_rows]
    labels, figures = _make_columns(table, lines)
    beside = _fitting_labels(labels, figures, console.width)
    section_count = len(labels) - len(beside)  # axes that head sections
    for number, share in enumerate(
        _iter_column_groups(figures, console.width - _total_width(beside) - GAP)
    ):
        if number:
            print_note("(further columns of the same table)", console)
        columns = [*beside, *(figures[k] for k in share)]
        heads = [column.head for column in columns]
        _print_rows(columns, [heads], console, style="bold", vertical="bottom")
        print_note("─" * _total_width(columns), console)
        for _, section in groupby(lines, key=lambda line: line.keys[:section_count]):
            rows, previous = [], tuple[str, ...]()
            for line in section:
                keys = line.keys[section_count:]
                figure_texts = [entry_text(line.cells[k]) for k in share]
                rows.append([*_blank_repeated_keys(keys, previous), *figure_texts])
                previous = keys
            pairs = zip(table.down[:section_count], line.place, strict=False)
            words = [axis.in_words(value) for axis, value in pairs if value is not None]
            print_note(", ".join(words), console, style="bold")
            _print_rows(columns, rows, console)
    if len(table.lines) > len(lines):
        print_note(f"{len(table.lines) - len(lines)} more rows are in {table.name}.csv.", console)
    for text in table.notes:
        print_note(text, console)


def count_fitting_columns(table: TextTable, width: int) -> int:
    """Return the number of a table's columns of figures that fit in a width beside its labels."""
    labels, figures = _make_columns(table, table.lines)
    beside = _fitting_labels(labels, figures, width)
    return len(next(_iter_column_groups(figures, width - _total_width(beside) - GAP)))


def _make_columns(table: TextTable, lines: Sequence[Line]) -> tuple[list[_Column], list[_Column]]:
    """Return the columns of labels and of figures, for some rows of a table."""
    labels = [
        _make_column(column.heading, [line.keys[k] for line in lines], MAX_LABEL_WIDTH)
        for k, column in enumerate(table.down)
    ]
    figures = [
        replace(
            _make_column(head, [entry_text(line.cells[k]) for line in lines], MAX_FIGURE_WIDTH),
            right=True,
        )
        for k, head in enumerate(table.heads)
    ]
    return labels, figures


def entry_text(cell: Entry) -> str:
    """Return a figure with its interval or spread, and the article's below."""
    interval = f" [{cell.interval}]" if cell.interval else ""
    spread = f" {cell.spread}" if cell.spread else ""
    return cell.text + interval + spread + (f"\narticle {cell.article}" if cell.article else "")


def _make_column(head: str, texts: Sequence[str], widest: int) -> _Column:
    """Return a column as wide as its texts, and as the words of its heading, which fold."""
    words = [*head.split(), *(word_line for text in texts for word_line in text.split("\n"))]
    width = max(map(cell_len, words), default=1)
    if cell_len(head) <= max(width, 10):
        width = max(width, cell_len(head))
    return _Column(head, min(width, widest))


def _fitting_labels(
    labels: Sequence[_Column], figures: Sequence[_Column], width: int
) -> Sequence[_Column]:
    """Return the last columns of labels that fit beside the figures in a width.

    Keep as many as leave space for all figures, or at least for the widest; the last may fold.
    """
    widest = max((figure.width for figure in figures), default=0)
    last = min(_total_width(labels[-1:]), FOLDED_WIDTH)
    figures_width = GAP + (
        _total_width(figures) if last + GAP + _total_width(figures) <= width else widest
    )
    beside = labels
    while len(beside) > 1 and _total_width(beside) + figures_width > width:
        beside = beside[1:]
    if len(beside) == 1:
        available = width - figures_width
        beside = [replace(beside[0], width=max(min(beside[0].width, available), MIN_WIDTH))]
    return beside


def _total_width(columns: Sequence[_Column]) -> int:
    return sum(column.width for column in columns) + GAP * max(len(columns) - 1, 0)


def _print_rows(
    columns: Sequence[_Column],
    rows: Sequence[Sequence[str]],
    console: Console,
    *,
    style: str = "",
    vertical: Literal["top", "bottom"] = "top",
) -> None:
    """Print rows of texts beside each other, folded at blanks; only a longer word is broken."""
    grid = Table.grid(padding=(0, GAP, 0, 0), pad_edge=False)
    for column in columns:
        justify: Literal["left", "right"] = "right" if column.right else "left"
        grid.add_column(width=column.width, justify=justify, vertical=vertical)
    for row in rows:
        grid.add_row(*map(plain_text, row), style=style)
    console.print(grid)


def _blank_repeated_keys(keys: Sequence[str], previous: Sequence[str]) -> list[str]:
    """Return the keys of a row, with leading keys that repeat the previous row's empty."""
    repeated = 0
    while repeated < min(len(keys), len(previous)) - 1 and keys[repeated] == previous[repeated]:
        repeated += 1
    return ["" if k < repeated else key for k, key in enumerate(keys)]


def _iter_column_groups(figures: Sequence[_Column], width: int) -> Iterator[list[int]]:
    """Yield the indices of the figures of each printed table."""
    share: list[int] = []
    for k in range(len(figures)):
        if share and _total_width([figures[index] for index in (*share, k)]) > width:
            yield share
            share = []
        share.append(k)
    yield share

"""Tables of plain text that fit the console: headings wrap, labels wrap, and columns move below."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from sweeps.report.axes import printable

GAP = 2  # blanks between columns
WRAPPED = 16  # cells of a column of wrapping labels


def plain(text: str) -> Text:
    """Return a text as it is, lines apart, its control characters escaped and no markup read."""
    return Text("\n".join(map(printable, text.split("\n"))))


class Sheet(Table):
    """A table of plain text: nothing in it is read as markup, and no control character passes.

    The first `keys` columns label a row; they are repeated if others move below.
    """

    caption_text: str = ""
    keys: int = 0

    def add_row(self, *cells: Any, style: Any = None, end_section: bool = False) -> None:
        """Add a row of texts."""
        super().add_row(*(plain(cell) for cell in cells), style=style, end_section=end_section)


def sheet(
    title: str,
    *headings: str,
    left: Sequence[str] = (),
    dim: Sequence[str] = (),
    keys: int | None = None,
) -> Sheet:
    """Return an empty table: words first, to the left, then figures, then dimmed figures.

    Its keys are the words, unless `keys` is given.
    """
    table = Sheet(box=SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, GAP - 1, 0, 0))
    table.caption_text, table.keys = title, len(left) if keys is None else keys
    for text in left:
        table.add_column(plain(text))
    for text in headings:
        table.add_column(plain(text), justify="right")
    for text in dim:
        table.add_column(plain(text), justify="right", style="dim")
    return table


def show(table: Sheet, console: Console) -> None:
    """Print a title and a table no wider than the console, without breaking words.

    Headings fold at blanks, and the labels of rows wrap; columns that still do not fit are
    in a table of their own below, with the same labels. Labels of too many columns are joined.
    Only a word longer than the console is broken.
    """
    if console.width < _least(table, WRAPPED) and console.width < _least(table, 1):
        table = _with_one_label(table)
    wrapped = WRAPPED if console.width >= _least(table, WRAPPED) else 1
    console.print()
    if table.caption_text:
        console.print(plain(table.caption_text), style="bold")
    for number, columns in enumerate(_shares(table, console.width, wrapped)):
        if number:
            console.print(plain("(further columns of the same table)"), style="dim")
        console.print(_fitted(table, columns, console.width, wrapped))


def _least(table: Sheet, wrapped: int) -> int:
    """Return the cells that a table needs: all keys, wrapped, and its widest figure."""
    needed = [_narrowest(table, one, wrapped) for one in range(len(table.columns))]
    return sum(one + GAP for one in needed[: table.keys]) + max(needed[table.keys :], default=0)


def _with_one_label(table: Sheet) -> Sheet:
    """Return the table with all keys of a row, each with its heading, in one column."""
    keys = [_texts(table, one) for one in range(table.keys)]
    headings = [heading.replace("\n", " ") for heading, *_ in keys]
    made = sheet(table.caption_text, left=("row",) * bool(keys))
    for column in table.columns[table.keys :]:
        made.add_column(column.header, justify=column.justify, style=column.style)
    cells = [column.cells for column in table.columns[table.keys :]]
    labels = zip(*(texts for _, *texts in keys), strict=True)
    for row, label, *figures in zip(table.rows, labels, *cells, strict=True):
        pairs = zip(headings, label, strict=True)
        words = ", ".join(f"{heading} {text}".strip() for heading, text in pairs if text)
        made.add_row(words, *map(str, figures), style=row.style)
    return made


def _shares(table: Sheet, width: int, wrapped: int) -> Iterator[list[int]]:
    """Yield numbers of the columns of each printed table, without the keys."""
    spare = width - sum(_narrowest(table, one, wrapped) + GAP for one in range(table.keys))
    share: list[int] = []
    taken = 0
    for one in range(table.keys, len(table.columns)):
        needed = _narrowest(table, one)
        if share and taken + GAP + needed > spare:
            yield share
            share, taken = [], 0
        taken += needed + GAP * bool(share)
        share.append(one)
    yield share


def _fitted(table: Sheet, columns: list[int], width: int, wrapped: int) -> Table:
    """Return part of a table, with columns up to their natural width."""
    part = Sheet(box=table.box, show_edge=False, pad_edge=False, padding=table.padding)
    shown = [*range(table.keys), *columns]
    narrow = {one: _narrowest(table, one, wrapped) for one in shown}
    spare = width - sum(narrow.values()) - GAP * (len(shown) - 1)
    for one in shown:
        column = table.columns[one]
        wish = _widest(table, one) - narrow[one]
        more = max(min(wish, spare), 0)
        if one >= table.keys and more < wish:
            more = 0  # a heading folds, or does not
        spare -= more
        part.add_column(
            column.header,
            justify=column.justify,
            style=column.style,
            width=max(min(narrow[one] + more, width), 1),
            overflow="fold",
        )
    rows = zip(table.rows, *(table.columns[one].cells for one in shown), strict=True)
    for row, *cells in rows:
        part.add_row(*map(str, cells), style=row.style, end_section=row.end_section)
    return part


def _widest(table: Sheet, column: int) -> int:
    """Return cells of the longest line of a column, including its heading."""
    return max(cell_len(line) for text in _texts(table, column) for line in text.split("\n"))


def _narrowest(table: Sheet, column: int, wrapped: int = 1) -> int:
    """Return the minimum width of a column: its words for a key, its lines for a figure.

    A key that wraps has a minimum width.
    """
    heading, *cells = _texts(table, column)
    words = heading.split()
    if column < table.keys:
        longest = max(map(cell_len, (*words, *" ".join(cells).split())), default=1)
        return min(max(longest, wrapped), max(_widest(table, column), 1))
    lines = [line for cell in cells for line in cell.split("\n")]
    return max(map(cell_len, (*words, *lines)), default=1)


def _texts(table: Sheet, column: int) -> list[str]:
    """Return heading and cells of a column."""
    one = table.columns[column]
    return [str(one.header), *map(str, one.cells)]

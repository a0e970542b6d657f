"""Tables of plain text that fit the console: headings fold, labels wrap, and columns move below."""

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
NARROWEST = 16  # of a column of labels that wrap, in cells, where no word of theirs is longer


def plain(text: str) -> Text:
    """Return a text as it is, lines apart, its control characters escaped and no markup read."""
    return Text("\n".join(map(printable, text.split("\n"))))


class Sheet(Table):
    """A table of plain text: nothing in it is read as markup, and no control character passes.

    The first `keys` columns say what a row is of; they come again where others move below.
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
    """Return an empty table: words first, to the left, then figures, then what interests less.

    Its keys are the words, unless it says how many columns are.
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
    """Print a title and a table that is no wider than the console, and break no word.

    Headings fold at blanks, and the labels of rows wrap; columns that find no place even so stand
    in a table of their own below, beside the same labels. Only a word that is longer than the
    console is broken.
    """
    console.print()
    if table.caption_text:
        console.print(plain(table.caption_text), style="bold")
    for number, columns in enumerate(_shares(table, console.width)):
        if number:
            console.print(plain("(further columns of the same table)"), style="dim")
        console.print(_fitted(table, columns, console.width))


def _shares(table: Sheet, width: int) -> Iterator[list[int]]:
    """Numbers of the columns of each table that is printed, the keys left out."""
    keys = range(table.keys)
    spare = width - sum(_narrowest(table, one) + GAP for one in keys)
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


def _fitted(table: Sheet, columns: list[int], width: int) -> Table:
    """Part of a table, its columns as wide as they like to be while there is room."""
    part = Sheet(box=table.box, show_edge=False, pad_edge=False, padding=table.padding)
    shown = [*range(table.keys), *columns]
    narrow = {one: _narrowest(table, one) for one in shown}
    spare = width - sum(narrow.values()) - GAP * (len(shown) - 1)
    for one in shown:
        column = table.columns[one]
        more = min(max(_widest(table, one) - narrow[one], 0), max(spare, 0))
        if one >= table.keys and more < _widest(table, one) - narrow[one]:
            more = 0  # a heading folds, or does not
        spare -= more
        part.add_column(
            column.header,
            justify=column.justify,
            style=column.style,
            width=min(narrow[one] + more, width),
            overflow="fold",
        )
    rows = zip(table.rows, *(table.columns[one].cells for one in shown), strict=True)
    for row, *cells in rows:
        part.add_row(*map(str, cells), style=row.style, end_section=row.end_section)
    return part


def _widest(table: Sheet, column: int) -> int:
    """Cells of the longest line of a column, its heading included."""
    return max((cell_len(line) for text in _texts(table, column) for line in text.split("\n")))


def _narrowest(table: Sheet, column: int) -> int:
    """Cells that a column needs: of a key those of its words, of a figure those of its lines."""
    heading, *cells = _texts(table, column)
    words = heading.split()
    if column < table.keys:
        longest = max(map(cell_len, (*words, *" ".join(cells).split())), default=1)
        return min(max(longest, NARROWEST), max(_widest(table, column), 1))
    lines = [line for cell in cells for line in cell.split("\n")]
    return max(map(cell_len, (*words, *lines)), default=1)


def _texts(table: Sheet, column: int) -> list[str]:
    """Heading and cells of a column."""
    one = table.columns[column]
    return [str(one.header), *map(str, one.cells)]

"""Tables on the screen."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from sweeps.report.axes import NOTHING, Axis, Column, printable, shown, told
from sweeps.report.rows import BIN, Row, axes_in, grouped, several

SOURCE = "source"
PUT_IN = "* Put in: what the transom and the masts reflect, over the rest of the ship."

Lines = Iterable[tuple[Sequence[str], list[Row]]]


class Sheet(Table):
    """A table of plain text: nothing in it is read as markup, and no control character passes."""

    def add_row(self, *cells: Any, style: Any = None, end_section: bool = False) -> None:
        """Add a row of texts."""
        super().add_row(*(plain(cell) for cell in cells), style=style, end_section=end_section)


def plain(text: str) -> Text:
    """A text as it is, lines apart, its control characters escaped."""
    return Text("\n".join(map(printable, text.split("\n"))))


def sheet(
    title: str, *headings: str, left: Sequence[str] = (), dim: Sequence[str] = (), **how: Any
) -> Sheet:
    """An empty table: words first, to the left, then figures, then what is less of interest."""
    table = Sheet(title=plain(title), **how)
    for text in left:
        table.add_column(plain(text))
    for text in headings:
        table.add_column(plain(text), justify="right")
    for text in dim:
        table.add_column(plain(text), justify="right", style="dim")
    return table


def show(table: Table, console: Console) -> None:
    """Print a table that loses no word: headings fold at blanks if they must, values do not.

    A console that is too narrow even so is widened.
    """
    spare = console.width - 3 * len(table.columns) - 1  # blanks either side, and lines between
    headings = [str(one.header) for one in table.columns]
    for one, heading in zip(table.columns, headings, strict=True):
        texts = [line for cell in one.cells for line in str(cell).split("\n")]
        one.width = max(map(cell_len, (*heading.split(), *texts)), default=1)
        spare -= one.width
    for one, heading in zip(table.columns, headings, strict=True):
        more = max(map(cell_len, heading.split("\n"))) - (one.width or 0)
        if 0 < more <= spare:
            one.width, spare = (one.width or 0) + more, spare - more
    console.width += max(0, -spare)
    console.print(table)


def note(text: str, console: Console) -> None:
    """Print what is to be known of a table."""
    console.print(plain(text), style="dim")


def explain(columns: Iterable[Column], console: Console) -> None:
    """Print what columns mean, in the words of the store."""
    meant = [f"{one.words}: {printable(one.long_name)}" for one in columns if one.long_name]
    if meant:
        note(f"{'; '.join(meant)}.", console)


def unforeseen(rows: list[Row]) -> list[Axis]:
    """Return axes of several values that no table has words for."""
    return [axis for axis in several(rows) if not (axis.foreseen or axis.number)]


def settings(
    rows: list[Row], always: Sequence[str], *, but: Iterable[str]
) -> Iterator[tuple[str, list[Row]]]:
    """Rows by setting, each with its words for a title.

    Axes that are `always` told come first, then others of several values, except the columns `but`,
    which have a place inside a table.
    """
    first = [axis for name in always for axis in axes_in(rows) if axis.name == name]
    more = [axis for axis in several(rows, but=but) if axis not in first]
    keys = (*first, *more)
    whole = [row for row in rows if all(row.get(axis) is not None for axis in keys)]
    for place in grouped(whole, keys) or [()]:
        at = dict(zip(keys, place, strict=False))
        # A row that does not depend on an axis stands at all of its values.
        yield ", ".join(told(at, at)), [row for row in rows if _stands_at(row, at)]


def _stands_at(row: Row, place: Row) -> bool:
    return all(row.get(axis) in (None, value) for axis, value in place.items())


def by_training(groups: Iterable[tuple[tuple[Any, ...], Any]]) -> list[tuple[tuple[Any, ...], Any]]:
    """Groups by number of frames, the largest first: training comes before, as of endless ones."""
    return sorted(groups, key=lambda item: item[0][0] or math.inf, reverse=True)


def print_scores(
    title: str,
    headings: Sequence[str],
    lines: Lines,
    console: Console,
    *,
    dim: Sequence[str] = (),
    more: Any = None,
    **how: Any,
) -> None:
    """Print percent correct: aspect bins across, and below a line the source's where it has some.

    A line has texts for the columns before the bins (an empty first one goes on with the last one)
    and rows; `dim` heads columns after the bins, which show `more` of its rows.
    """
    lines = list(lines)
    bins = list(dict.fromkeys(row[BIN] for _, rows in lines for row in rows))
    labels = [label if label == "overall" else f"{label}°" for label in bins]
    table = sheet(title, *labels, left=headings, dim=dim, **how)
    for number, (names, rows) in enumerate(lines):
        if number and names[0] and len(headings) > 1:
            table.add_section()
        found = {row[BIN]: row for row in rows}
        after = more(rows) if more else ()
        figures = (percent_text(found.get(label)) for label in bins)
        style = "bold" if names[-1].startswith("both") else None
        table.add_row(*names, *figures, *after, style=style)
        theirs = [found.get(label, {}).get("source_percent") for label in bins]
        if any(figure is not None for figure in theirs):
            figures = ("" if figure is None else str(figure) for figure in theirs)
            table.add_row(*[""] * (len(headings) - 1), f"  {SOURCE}", *figures, style="dim")
    show(table, console)


def print_grid(
    rows: list[Row],
    title: Callable[[str], str],
    down: Mapping[str, str],
    across: Mapping[str, Mapping[Any, str]],
    text: Callable[[Row | None], str],
    console: Console,
) -> None:
    """Print rows down and across: the columns `down` by their headings, of one `across` values."""
    ((column, headings),) = across.items()
    for words, group in settings(rows, (), but=(*down, column, BIN)):
        table = sheet(title(f", {words}" if words else ""), *down.values(), *headings.values())
        for place, line in grouped(group, tuple(down)).items():
            found = {row[column]: row for row in line}
            table.add_row(*map(shown, place), *(text(found.get(value)) for value in headings))
        show(table, console)


def percent_text(row: Row | None) -> str:
    """Percent correct, its interval, and its spread where it has one."""
    if row is None:
        return ""
    if row["percent_correct"] is None:
        return NOTHING
    spread = "" if row.get("spread") is None else f" ±{row['spread']:.0f}"
    return f"{row['percent_correct']:.0f} [{row['ci_low']:.0f}-{row['ci_high']:.0f}]{spread}"

"""Rows and printed form of any table of a store, by its names, units and labels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import xarray as xr
from rich.console import Console

from sweeps.report import rows
from sweeps.report.axes import OF_ARRAYS, Axis, Column, shown
from sweeps.report.layout import sheet, show
from sweeps.report.rows import Row, grouped
from sweeps.report.screen import explain, note

MOST = 60  # rows on the screen; the file has all


def other_rows(table: xr.Dataset) -> list[Row]:
    """Return a row per cell of any table: its place on the axes, including draws, and figures."""
    columns = {str(name): Column(array) for name, array in table.data_vars.items()}
    return [
        axes | {column: rows.known(cell[name]) for name, column in columns.items()}
        for axes, cell in rows.cells(table, but=OF_ARRAYS)
        if columns
    ]


def print_other(title: str, found: list[Row], console: Console, most: int | None = MOST) -> None:
    """Print a table of any kind: axes of several values to the left, figures to the right.

    Axes without effect, and figures that are the same in all rows, are named below.
    """
    axes = [axis for axis in rows.several(found, none=True) if not axis.number]
    places = set(rows.axes_in(found))
    figures = [key for key in found[0] if key not in places]
    kept, folded = _folded(found, axes, figures)
    axes = [axis for axis in axes if axis not in folded]
    constant = [one for one in figures if len({_text(row[one]) for row in kept}) == 1]
    constant = constant if len(kept) > 1 and len(constant) < len(figures) else []
    varying = [one for one in figures if one not in constant]
    left = [one.heading for one in axes]
    table = sheet(title, *(_heading(one) for one in varying), left=left)
    for row in kept[:most]:
        table.add_row(*(_text(row[key]) for key in (*axes, *varying)))
    show(table, console)
    if most is not None and len(kept) > most:
        note(f"{len(kept) - most} more rows are in the CSV file.", console)
    for axis in folded:
        note(f"The same for every {axis.words}.", console)
    same = [f"{_heading(one)} {_text(kept[0][one])}" for one in constant]
    if same:
        note(f"In all rows: {'; '.join(same)}.", console)
    explain([one for one in varying if isinstance(one, Column)], console)


def _folded(
    found: list[Row], axes: Sequence[Axis], figures: Sequence[str]
) -> tuple[list[Row], list[Axis]]:
    """Return rows without repetitions along axes without effect, and these axes."""
    folded: list[Axis] = []
    for axis in axes:
        others = [one for one in axes if one not in (*folded, axis)]
        groups = grouped(found, others).values()
        values = {row.get(axis) for row in found}
        alike = all(
            len({tuple(map(_text, (row[one] for one in figures))) for row in group}) == 1
            and len(group) == len(values)
            for group in groups
        )
        if alike and len(values) > 1:
            folded.append(axis)
            found = [group[0] for group in groups]
    return found, folded


def _heading(column: str) -> str:
    return column.heading if isinstance(column, Column) else column.replace("_", " ")


def _text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else shown(value)

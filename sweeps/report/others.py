"""Tables that nobody foresaw: each as the store has it, with the names and units that it gives."""

from __future__ import annotations

from typing import Any

import xarray as xr
from rich.console import Console

from sweeps.report.axes import OF_ARRAYS, Column, shown
from sweeps.report.rows import Row, cells, known, several
from sweeps.report.screen import explain, note, sheet, show

MOST = 60  # rows on the screen; the file has all


def other_rows(table: xr.Dataset) -> list[Row]:
    """Return a row for each cell of a table: its place on the axes, draws among them, its figures.

    Profiles and images are no figures.
    """
    figures = table.drop_vars([name for name in table if set(table[name].dims) & set(OF_ARRAYS)])
    columns = {str(name): Column(array) for name, array in figures.data_vars.items()}
    return [
        axes | {column: known(cell[name]) for name, column in columns.items()}
        for axes, cell in cells(figures, but=OF_ARRAYS)
        if columns
    ]


def print_other(title: str, rows: list[Row], console: Console) -> None:
    """Print a table of any kind: axes of several values to the left, figures to the right."""
    axes = [axis for axis in several(rows, none=True) if not axis.number]
    figures = [key for key in rows[0] if type(key) is Column]
    table = sheet(title, *(one.heading for one in figures), left=[one.heading for one in axes])
    for row in rows[:MOST]:
        table.add_row(*(_text(row[key]) for key in (*axes, *figures)))
    show(table, console)
    if len(rows) > MOST:
        note(f"{len(rows) - MOST} more rows are in the CSV.", console)
    explain(figures, console)


def _text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else shown(value)

"""Measured profiles named by who learned synthetic ones."""

from __future__ import annotations

import xarray as xr
from rich.console import Console

from sweeps.report.axes import SHORT, Axis, shown, told
from sweeps.report.rows import BIN, Row, grouped, score_rows, several
from sweeps.report.screen import PUT_IN, note, percent_text, sheet, show

LEADING = ("pulse_width_ns", "classifier")
PLACED = (*LEADING, "kind", BIN)
ALL = "all"  # where an answer is the same for every value


def measured_rows(tables: xr.Dataset) -> list[Row]:
    """Percent correct of measured profiles beside synthetic ones, by who learned the latter.

    Draws of the noise are counted together; `ship_` counts the ship alone, where a classifier names
    an aspect bin, too.
    """
    figures = ("percent_correct", "ci_low", "ci_high")
    by_ship = score_rows(tables, "ship_", label={})
    return [
        {key: value for key, value in row.items() if key != "n"}
        | {f"ship_{name}": ship[name] for name in figures}
        | {"n": row["n"]}
        for row, ship in zip(score_rows(tables, label={}), by_ship, strict=True)
    ]


def print_measured(rows: list[Row], console: Console) -> None:
    """Print how many measured profiles are named right, beside synthetic ones.

    A row for every value of an axis that has several, or one where all of them give the same.
    """
    bins = list(dict.fromkeys(row[BIN] for row in rows))
    axes = [axis for axis in several(rows, but=PLACED, none=True) if axis.name != "error_value"]
    axes = [axis for axis in axes if not axis.number]
    table = sheet(
        "Ships named right [%] by what synthetic profiles taught",
        *bins,
        left=("pulse [ns]", "classifier", *map(_heading, axes), "profiles"),
    )
    for (pulse, name, kind), group in grouped(rows, (*LEADING, "kind")).items():
        lines: dict[tuple[str, ...], dict[str, str]] = {}
        for row in group:
            of_ship = {name[5:]: figure for name, figure in row.items() if name[:5] == "ship_"}
            setting = tuple(_setting(row, axis) for axis in axes)
            lines.setdefault(setting, {})[row[BIN]] = percent_text(of_ship)
        figures = list(lines.values())
        if len(figures) > 1 and all(line == figures[0] for line in figures):
            lines = {(ALL,) * len(axes): figures[0]}
        word = str(name).upper() if len(str(name)) == 3 else shown(name)
        for setting, line in lines.items():
            texts = (line.get(label, "") for label in bins)
            table.add_row(shown(pulse), word, *setting, shown(kind), *texts)
    show(table, console)
    if any(axis.name in SHORT for axis in axes):
        note(PUT_IN, console)
    note(
        "Of the ships flown past, the ship alone, all draws of the noise together, with 95 % "
        "intervals. learned: the synthetic profiles themselves, without noise; test: averages of "
        "frames of them, with the range profiler's noise; measured: corrected images, gathered "
        "into its beams, with that of the flight alone.",
        console,
    )


def _heading(axis: Axis) -> str:
    return "error" if axis.name == "error_parameter" else axis.heading


def _setting(row: Row, axis: Axis) -> str:
    if axis.name == "error_parameter":
        return told(row, [axis])[0]
    return shown(row[axis])

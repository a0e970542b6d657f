"""Measured profiles named by who learned synthetic ones, on the screen and as rows."""

from __future__ import annotations

from typing import Any

import xarray as xr
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from sweeps.axes import OF_FLIGHT
from sweeps.report.flight_words import (
    PUT_IN,
    SHORT,
    column,
    heading,
    print_whole,
    shown,
    told,
)
from sweeps.report.screen import NOTHING, WIDTH, grouped
from sweeps.report.tables import Row, cells, percent

SETTINGS = ("vigilance", "range", *OF_FLIGHT)
AXES = ("pulse_width", "classifier", *SETTINGS, "kind", "aspect_bin")
ALL = "all"  # where an answer is the same for every value


def measured_rows(tables: xr.Dataset) -> list[Row]:
    """Percent correct of measured profiles beside synthetic ones, by who learned the latter.

    Parameters
    ----------
    tables : xarray.Dataset
        The store's group `tables/measured`, in which draws of the noise are counted together.

    Returns
    -------
    list of dict
        One row a setting, kind of profile and aspect bin; the ship alone is also counted, where
        a classifier names an aspect bin, too.
    """
    errors = list(
        zip(
            tables.error_parameter.values.reshape(-1).tolist(),
            tables.error_value.values.reshape(-1).tolist(),
            strict=True,
        )
    )
    rows: list[Row] = []
    for axes, cell in cells(xr.broadcast(tables)[0], AXES):
        parameter, amount = errors[axes["error"] if len(errors) > 1 else 0]
        row = {column(name): None if value != value else value for name, value in axes.items()}
        row |= {"error_parameter": parameter, "error_value": amount}
        for prefix in ("", "ship_"):
            row |= {
                f"{prefix}{name}": percent(cell[f"{prefix}{key}"])
                for name, key in (
                    ("percent_correct", "accuracy"),
                    ("ci_low", "ci_low"),
                    ("ci_high", "ci_high"),
                )
            }
        rows.append(row | {"n": cell["n"]})
    return rows


def print_measured(rows: list[Row], console: Console) -> None:
    """Print how many measured profiles are named right, beside synthetic ones.

    A row for every value of an axis that has several, or one where all of them give the same.
    """
    console.width = max(console.width, WIDTH)
    bins = list(dict.fromkeys(row["aspect_bin_deg"] for row in rows))
    several = [name for name in SETTINGS if len({str(row[column(name)]) for row in rows}) > 1]
    table = Table(title="Ships named right [%] by what synthetic profiles taught")
    for text in ("pulse [ns]", "classifier", *map(heading, several), "profiles"):
        table.add_column(escape(text))
    for label in bins:
        table.add_column(label, justify="right")
    for (pulse, name, kind), group in grouped(
        rows, ("pulse_width_ns", "classifier", "kind")
    ).items():
        lines: dict[tuple[str, ...], dict[Any, str]] = {}
        for row in group:
            setting = tuple(_setting(one, row) for one in several)
            lines.setdefault(setting, {})[row["aspect_bin_deg"]] = _percent(row)
        figures = list(lines.values())
        if len(figures) > 1 and all(line == figures[0] for line in figures):
            lines = {(ALL,) * len(several): figures[0]}
        for setting, line in lines.items():
            table.add_row(
                f"{pulse:g}",
                str(name).upper() if len(str(name)) == 3 else str(name),
                *setting,
                str(kind),
                *(line[label] for label in bins),
            )
    print_whole(table, console)
    if set(SHORT) & set(several):
        console.print(PUT_IN, style="dim")
    console.print(
        "Of the ships flown past, the ship alone, all draws of the noise together, with 95 % "
        "intervals. learned: the synthetic profiles themselves, without noise; test: averages of "
        "frames of them, with the range profiler's noise; measured: corrected images, gathered "
        "into its beams, with that of the flight alone.",
        style="dim",
    )


def _setting(name: str, row: Row) -> str:
    if name == "error":
        return told(name, (row["error_parameter"], row["error_value"]))
    return shown(row[column(name)])


def _percent(row: Row) -> str:
    if row["ship_percent_correct"] is None:
        return NOTHING
    return f"{row['ship_percent_correct']:.0f} [{row['ship_ci_low']:.0f}-{row['ship_ci_high']:.0f}]"

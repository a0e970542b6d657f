"""Unknown ships on the screen: what it costs to reject them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from rich.console import Console
from rich.table import Table

from sweeps.report.screen import NOTHING, WIDTH, grouped
from sweeps.report.tables import Row, cells, first_rules, percent

TITLES = {
    "acn": "ACN",
    "correlation": "correlation",
    "acn_infrared": "ACN on silhouettes",
}
FIGURES = ("rejected_unknown", "rejected_known", "correct_known")
LEVELS = (0.5, 0.8, 0.9, 0.95)  # of unknown ships rejected


def rejection_rows(tables: Mapping[str, xr.Dataset]) -> list[Row]:
    """Rejection and correct rate at every test vigilance.

    Parameters
    ----------
    tables : mapping of str to xarray.Dataset
        The store's rejection tables by classifier.

    Returns
    -------
    list of dict
        One row for each classifier, setting, cell, kind of aspect and test vigilance: percentages
        with their intervals, and numbers of answers.
    """
    rows: list[Row] = []
    for name, table in tables.items():
        for axes, cell in cells(xr.broadcast(table)[0]):
            rows.append(
                {"classifier": name}
                | axes
                | {
                    prefix + figure + end: percent(cell[figure + end])
                    for figure in FIGURES
                    for prefix, end in (("percent_", ""), ("", "_ci_low"), ("", "_ci_high"))
                }
                | {key: cell[key] for key in ("n_known", "n_unknown")}
            )
    keys = list(dict.fromkeys(key for row in rows for key in row))
    return [{key: row.get(key) for key in keys} for row in rows]


def print_rejection(rows: list[Row], console: Console) -> None:
    """Print the share of known ships still named right when so many unknown ones are rejected."""
    console.width = max(console.width, WIDTH)
    table = Table(title="Known ships named right [%] where so many unknown ships are rejected")
    settings = [
        key
        for key in rows[0]
        if key not in ("classifier", "aspects", "test_vigilance", "frame_count")
        and not key.startswith(("percent_", "n_", *FIGURES))
    ]
    rows = first_rules(rows)
    several = [
        key for key in settings if len({row[key] for row in rows if row[key] is not None}) > 1
    ]
    for name in ("classifier", *(key.replace("_", " ") for key in several), "aspects", "frames"):
        table.add_column(name)
    table.add_column("answers,\nknown +\nunknown", justify="right")
    table.add_column("none", justify="right")
    for level in LEVELS:
        table.add_column(f"{level:.0%}", justify="right")
    table.add_column("area", justify="right")
    keys = ("classifier", *several, "aspects", "frame_count")
    for key, line in grouped(rows, keys).items():
        unknown, right = (
            np.array([row[f"percent_{name}"] for row in line], dtype=float)
            for name in ("rejected_unknown", "correct_known")
        )
        enough = [np.isfinite(right), *(unknown >= 100 * level for level in LEVELS)]
        table.add_row(
            TITLES[str(key[0])],
            *("" if value is None else f"{value}" for value in key[1:]),
            f"{line[0]['n_known']} +\n{line[0]['n_unknown']}",
            *(_best(line, np.where(there, right, np.nan)) for there in enough),
            _area(unknown, right),
        )
    console.print(table)
    console.print(
        "Area: under the curve of known ships right over unknown ships let through; 100 where "
        "every one is right before any unknown one is let through. Below each figure its 95 % "
        "Wilson interval. Answers to known and to unknown ships are counted; in the interval those "
        "of several replicates count for less where they are alike for one view (Kish's design "
        "effect), those of several phases and orders of presentation as one.",
        style="dim",
    )


def _best(line: list[Row], right: np.ndarray) -> str:
    """The most known ships named right, with its interval below."""
    if np.isnan(right).all():
        return NOTHING
    row = line[int(np.nanargmax(right))]
    low, high = row["correct_known_ci_low"], row["correct_known_ci_high"]
    return f"{row['percent_correct_known']:.0f}\n{low:.0f}-{high:.0f}"


def _area(unknown: np.ndarray, right: np.ndarray) -> str:
    """Area under right over let through, in per cent."""
    there = np.isfinite(unknown) & np.isfinite(right)
    if not there.any():
        return NOTHING
    through, named = 100 - unknown[there], right[there]
    order = np.lexsort((named, through))
    through = np.concatenate([[0.0], through[order], [100.0]])
    # Nothing is right where all is rejected; beyond the lowest test vigilance no more is.
    named = np.concatenate([[0.0], named[order], [named.max()]])
    return f"{np.trapezoid(named, through) / 100:.0f}"

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
CURVE = (
    *("correct_where_rejected", "correct_where_rejected_ci_low", "correct_where_rejected_ci_high"),
    *("rejected_up_to", "area", "n_known", "n_unknown"),
)
FIGURES_OF_A_CURVE = (
    *("least_percent_rejected", "rejected_up_to", "percent_correct", "ci_low", "ci_high"),
    *("percent_area", "n_known", "n_unknown"),
)


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
        rates = table.drop_dims("least_rejected").drop_vars("area")
        for axes, cell in cells(xr.broadcast(rates)[0]):
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


def curve_rows(tables: Mapping[str, xr.Dataset]) -> list[Row]:
    """What is still right where so many answers to unknown ships are rejected.

    Parameters
    ----------
    tables : mapping of str to xarray.Dataset
        The store's rejection tables by classifier.

    Returns
    -------
    list of dict
        One row for each classifier, setting, cell, kind of aspect and least share rejected: the
        cosine up to which answers are, known ships right in percent with their interval, the area
        under the curve in percent, and numbers of answers.
    """
    rows: list[Row] = []
    for name, table in tables.items():
        for axes, cell in cells(xr.broadcast(table[list(CURVE)])[0]):
            least = axes.pop("least_rejected")
            up_to = cell["rejected_up_to"]
            rows.append(
                {"classifier": name}
                | axes
                | {
                    "least_percent_rejected": percent(least),
                    "rejected_up_to": None if np.isnan(up_to) else up_to,
                    "percent_correct": percent(cell["correct_where_rejected"]),
                    "ci_low": percent(cell["correct_where_rejected_ci_low"]),
                    "ci_high": percent(cell["correct_where_rejected_ci_high"]),
                    "percent_area": percent(cell["area"]),
                }
                | {key: cell[key] for key in ("n_known", "n_unknown")}
            )
    keys = list(dict.fromkeys(key for row in rows for key in row))
    return [{key: row.get(key) for key in keys} for row in rows]


def print_rejection(rows: list[Row], console: Console) -> None:
    """Print the share of known ships still named right when so many unknown ones are rejected.

    Parameters
    ----------
    rows : list of dict
        From `curve_rows`.
    console : rich.console.Console
        Where to print.
    """
    console.width = max(console.width, WIDTH)
    title = "Known ships named right [%] where so many unknown ships are rejected"
    table = Table(title=title, pad_edge=False, collapse_padding=True)
    others = ("classifier", "aspects", "frame_count", *FIGURES_OF_A_CURVE)
    rows = first_rules(rows)
    several = [
        key
        for key in rows[0]
        if key not in others and len({row[key] for row in rows if row[key] is not None}) > 1
    ]
    for name in ("classifier", *(key.replace("_", " ") for key in several), "aspects", "frames"):
        table.add_column(name)
    table.add_column("answers,\nknown +\nunknown", justify="right")
    for least in dict.fromkeys(row["least_percent_rejected"] for row in rows):
        table.add_column(f"{least:g}%" if least else "none", justify="right")
    table.add_column("area", justify="right")
    keys = ("classifier", *several, "aspects", "frame_count")
    for key, line in grouped(rows, keys).items():
        area = line[0]["percent_area"]
        table.add_row(
            TITLES[str(key[0])],
            *("" if value is None else f"{value}" for value in key[1:]),
            f"{line[0]['n_known']} +\n{line[0]['n_unknown']}",
            *(_with_interval(row) for row in line),
            NOTHING if area is None else f"{area:.0f}",
        )
    console.print(table)
    console.print(
        "At the least test vigilance that rejects at least so many. Area: under the curve of known "
        "ships right over unknown ships let through; 100 where every one is right before any "
        "unknown one is let through. Below each figure its 95 % Wilson interval, for that test "
        "vigilance. Answers to known and to unknown ships are counted; in the interval those of "
        "several replicates count for less where they are alike for one view (Kish's design "
        "effect), those of several phases and orders of presentation as one.",
        style="dim",
    )


def _with_interval(row: Row) -> str:
    """Known ships named right, with the interval below."""
    if row["percent_correct"] is None:
        return NOTHING
    return f"{row['percent_correct']:.0f}\n{row['ci_low']:.0f}-{row['ci_high']:.0f}"

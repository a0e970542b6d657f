"""Unknown ships: what it costs to reject them."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr
from rich.console import Console

from sweeps.report.axes import NOTHING, printable, shown
from sweeps.report.rows import Row, cells, finite, grouped, of_one, percent, several, together
from sweeps.report.screen import note, sheet, show

TITLES = {"acn": "ACN", "acn_infrared": "ACN on silhouettes"}
FIGURES = ("rejected_unknown", "rejected_known", "correct_known")
ENDS = ("ci_low", "ci_high")
COUNTS = ("n_known", "n_unknown")
AT_LEAST = "correct_where_rejected"


def rejection_rows(tables: Mapping[str, xr.Dataset]) -> list[Row]:
    """Rejection and correct rate at every test vigilance, of rejection tables by classifier."""
    names = [*FIGURES, *(f"{name}_{end}" for name in FIGURES for end in ENDS), *COUNTS]
    return together(
        {"classifier": name}
        | axes
        | {
            (column if end else f"percent_{column}"): percent(cell[column])
            for figure in FIGURES
            for end in ("", *ENDS)
            for column in (f"{figure}_{end}".strip("_"),)
        }
        | {key: int(cell[key]) for key in COUNTS}
        for name, table in tables.items()
        for axes, cell in cells(table[names])
    )


def curve_rows(tables: Mapping[str, xr.Dataset]) -> list[Row]:
    """What is still right where so many answers to unknown ships are rejected.

    One row for each cell, kind of aspect and least share rejected: the cosine up to which answers
    are, known ships right in percent, the area under the curve in percent, and numbers of answers.
    """
    names = [AT_LEAST, *(f"{AT_LEAST}_{end}" for end in ENDS), "rejected_up_to", "area", *COUNTS]
    rows = []
    for name, table in tables.items():
        for axes, cell in cells(table[names]):
            least = axes.pop("least_rejected")
            rows.append(
                {"classifier": name}
                | axes
                | {
                    "least_percent_rejected": percent(least),
                    "rejected_up_to": finite(cell["rejected_up_to"]),
                    "percent_correct": percent(cell[AT_LEAST]),
                    **{end: percent(cell[f"{AT_LEAST}_{end}"]) for end in ENDS},
                    "percent_area": percent(cell["area"]),
                }
                | {key: int(cell[key]) for key in COUNTS}
            )
    return together(rows)


def print_rejection(rows: list[Row], console: Console) -> None:
    """Print the share of known ships still named right when so many unknown ones are rejected."""
    rows = of_one(rows)
    more = several(rows, but=("aspects", "frame_count"))
    leasts = list(dict.fromkeys(row["least_percent_rejected"] for row in rows))
    table = sheet(
        "Known ships named right [%] where so many unknown ships are rejected",
        "answers,\nknown +\nunknown",
        *(f"{least:g}%" if least else "none" for least in leasts),
        "area",
        left=("classifier", *(axis.words for axis in more), "aspects", "frames"),
        pad_edge=False,
        collapse_padding=True,
    )
    for key, line in grouped(rows, ("classifier", *more, "aspects", "frame_count")).items():
        found = {row["least_percent_rejected"]: row for row in line}
        area = line[0]["percent_area"]
        table.add_row(
            TITLES.get(key[0], printable(str(key[0]))),
            *("" if value is None else shown(value) for value in key[1:]),
            f"{line[0]['n_known']} +\n{line[0]['n_unknown']}",
            *(_with_interval(found.get(least)) for least in leasts),
            NOTHING if area is None else f"{area:.0f}",
        )
    show(table, console)
    note(
        "At the least test vigilance that rejects at least so many. Area: under the curve of known "
        "ships right over unknown ships let through; 100 where every one is right before any "
        "unknown one is let through. Below each figure its 95 % Wilson interval, for that test "
        "vigilance. Answers to known and to unknown ships are counted; in the interval those of "
        "several replicates count for less where they are alike for one view (Kish's design "
        "effect), those of several phases and orders of presentation as one.",
        console,
    )


def _with_interval(row: Row | None) -> str:
    """Known ships named right, with the interval below."""
    if row is None or row["percent_correct"] is None:
        return NOTHING
    return f"{row['percent_correct']:.0f}\n{row['ci_low']:.0f}-{row['ci_high']:.0f}"

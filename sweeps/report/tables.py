"""Tables of the Adaptive Clustering Network on range profiles, ours beside the source's."""

from __future__ import annotations

import xarray as xr
from rich.console import Console

from sweeps.report.axes import shown
from sweeps.report.rows import (
    BIN,
    RULES,
    Row,
    beside_source,
    cells,
    grouped,
    of_one,
    score_rows,
    together,
)
from sweeps.report.screen import by_training, note, print_scores, settings, sheet, show
from sweeps.report.source import as_in_source, has_source_views, source_figures

__all__ = ["accuracy_rows", "category_rows", "has_source_views", "source_figures"]

PLACE = ("range", "target_free_ifovs", "pulse_width", "vigilance")  # always told in titles


def category_rows(tables: xr.Dataset) -> list[Row]:
    """Categories formed in each training (the article's Table 3), one row each.

    Axes, categories, training profiles, their ratio, whether the categories settled, the source's
    count where it has one.
    """
    source, rows = source_figures()["table3_categories"], []
    formed = tables[["category_count", "view_count", "settled"]]
    # Categories form before they are named.
    for axes, cell in cells(formed.drop_vars(RULES, errors="ignore")):
        categories, views = cell["category_count"], cell["view_count"]
        asked = as_in_source({"receiver": tables.attrs.get("receiver")} | axes)
        asked = asked and axes["vigilance"] == source["vigilance"]
        rows.append(
            axes
            | {
                "categories": categories,
                "training_profiles": views,
                "compression": round(views / categories, 2) if categories else None,
                "settled": bool(cell["settled"]),
                "source_categories": source["categories"].get(axes["pulse_width_ns"])
                if asked
                else None,
            }
        )
    return rows


def accuracy_rows(tables: xr.Dataset) -> list[Row]:
    """Percent correct by aspect bin (the article's Table 4), one row each, training profiles first.

    Which profiles, axes, percent correct with its Wilson interval, number, the source's figure.
    """
    rows = together(
        score_rows(tables, "training_", label={"profiles": "training"}),
        score_rows(tables, label={"profiles": "averaged"}),
    )
    return beside_source(rows, tables, "acn")


def print_categories(rows: list[Row], console: Console) -> None:
    """Print how many categories formed: pulse widths down, vigilances across."""
    vigilances = sorted({row["vigilance"] for row in rows})
    theirs = source_figures()["table3_categories"]["vigilance"]
    for place, group in settings(rows, PLACE[:2], but=("pulse_width_ns", "vigilance")):
        table = sheet(
            f"Categories formed by the ACN ({place})",
            *("pulse width [ns]", "profiles", *(f"vigilance {one:g}" for one in vigilances)),
            dim=(f"source, {theirs:g}",),
        )
        for (width,), line in grouped(group, ("pulse_width_ns",)).items():
            formed = {row["vigilance"]: row for row in line}
            beside = [row["source_categories"] for row in line if row["source_categories"]]
            table.add_row(
                shown(width),
                str(line[0]["training_profiles"]),
                *(_count(formed.get(vigilance)) for vigilance in vigilances),
                str(beside[0]) if beside else "",
            )
        show(table, console)
        if not all(row["settled"] for row in group if row["categories"]):
            note("* categories still changed in the last pass", console)


def print_accuracy(rows: list[Row], console: Console) -> None:
    """Print percent correct with its interval: numbers of frames down, aspect bins across.

    One vigilance is printed, the source's if it is there; the CSV has them all.
    """
    figures = source_figures()["table4_percent_correct"]
    vigilances = {row["vigilance"] for row in rows}
    chosen = figures["vigilance"] if figures["vigilance"] in vigilances else max(vigilances)
    printed = [row for row in of_one(rows) if row["vigilance"] == chosen]
    for place, group in settings(printed, PLACE, but=("frame_count", BIN)):
        tests = by_training(grouped(group, ("frame_count",)).items())
        lines = [((str(count or "training"),), line) for (count,), line in tests]
        print_scores(f"Percent correct, ACN ({place})", ("frames",), lines, console)
    if any(row["source_percent"] is not None for row in printed):
        note(f"Source: {figures['note']}", console)
    others = "; other vigilances are in the CSV" if len(vigilances) > 1 else ""
    note(f"95 % Wilson intervals{others}", console)


def _count(row: Row | None) -> str:
    if row is None:
        return ""
    if not row["categories"]:
        return "failed"
    return f"{row['categories']}" + ("" if row["settled"] else "*")

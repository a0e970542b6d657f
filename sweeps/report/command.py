"""The command `ncti-report`: print the tables of a store and write them as CSV."""

from __future__ import annotations

import argparse
import csv
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from sweeps import store
from sweeps.layout import TABLES
from sweeps.report.tables import (
    Row,
    accuracy_rows,
    category_rows,
    has_source_views,
    source_figures,
)

SOURCE = "source"
WIDTH = 100  # columns that the widest table needs; narrower and its figures would be cut


def main() -> None:
    """Run the command line; exits with 2 when the store cannot be read."""
    parser = argparse.ArgumentParser(
        prog="ncti-report",
        description="Print the tables of a sweep beside the source's, and write them as CSV.",
    )
    parser.add_argument("store", type=Path, help="store of a sweep, such as sweep.zarr")
    path = parser.parse_args().store.absolute()
    try:
        report(path, Console())
    except (OSError, KeyError, ValueError):
        print(
            f"ncti-report: store is {str(path)!r}, but must be the zarr store of a sweep with its "
            "tables written",
            file=sys.stderr,
        )
        sys.exit(2)


def report(path: Path, console: Console) -> None:
    """Print the tables of a store and write them beside it.

    Parameters
    ----------
    path : Path
        The store.
    console : rich.console.Console
        Where to print.

    Raises
    ------
    OSError
        If the store has no tables.
    """
    written: dict[str, list[Row]] = {}
    if store.has_group(path, TABLES):
        tables = store.read_group(path, TABLES).load()
        written |= {"categories": category_rows(tables), "accuracy": accuracy_rows(tables)}
        print_categories(written["categories"], console)
        print_accuracy(written["accuracy"], console)
        if not has_source_views(tables):
            console.print(
                "The source's figures are of its own 124 views, four ships from bow to beam.",
                style="dim",
            )
    if not written:
        raise FileNotFoundError(path)
    folder = store.tables_folder(path)
    folder.mkdir(exist_ok=True)
    for name, rows in written.items():
        write_csv(folder / f"{name}.csv", rows)
    console.print(f"store   {path}", soft_wrap=True, highlight=False)
    files = ", ".join(f"{name}.csv" for name in written)
    console.print(f"tables  {folder}: {files}", soft_wrap=True, highlight=False)


def write_csv(path: Path, rows: list[Row]) -> None:
    """Write rows with their keys as header; an absent value is an empty field."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def print_categories(rows: list[Row], console: Console) -> None:
    """Print how many categories formed: pulse widths down, vigilances across."""
    console.width = max(console.width, WIDTH)
    for setting, group in _grouped(rows, ("range_km", "target_free_ifovs")).items():
        vigilances = sorted({row["vigilance"] for row in group})
        table = Table(title=f"Categories formed by the ACN ({_setting(setting, group[0])})")
        table.add_column("pulse width [ns]", justify="right")
        table.add_column("profiles", justify="right")
        for vigilance in vigilances:
            table.add_column(f"vigilance {vigilance:g}", justify="right")
        figures = source_figures()["table3_categories"]
        table.add_column(f"{SOURCE}, {figures['vigilance']:g}", justify="right", style="dim")
        for (pulse_width,), cells in _grouped(group, ("pulse_width_ns",)).items():
            formed = {row["vigilance"]: row for row in cells}
            theirs = [row["source_categories"] for row in cells if row["source_categories"]]
            table.add_row(
                f"{pulse_width:g}",
                str(cells[0]["training_profiles"]),
                *(_count(formed[vigilance]) for vigilance in vigilances),
                str(theirs[0]) if theirs else "",
            )
        console.print(table)
        if not all(row["settled"] for row in group if row["categories"]):
            console.print("* categories still changed in the last pass", style="dim")


def print_accuracy(rows: list[Row], console: Console) -> None:
    """Print percent correct with its interval: numbers of frames down, aspect bins across.

    One vigilance is printed, the source's if it is there; the CSV has them all.
    """
    console.width = max(console.width, WIDTH)
    figures = source_figures()["table4_percent_correct"]
    keys = ("range_km", "target_free_ifovs", "pulse_width_ns", "vigilance")
    vigilances = {row["vigilance"] for row in rows}
    shown = figures["vigilance"] if figures["vigilance"] in vigilances else max(vigilances)
    noted = False
    printed = [row for row in rows if row["vigilance"] == shown]
    for setting, group in _grouped(printed, keys).items():
        bins = list(dict.fromkeys(row["aspect_bin_deg"] for row in group))
        title = f"Percent correct, ACN ({_setting(setting[:2], group[0])}, {setting[2]:g} ns, "
        table = Table(title=title + f"vigilance {setting[3]:g})")
        table.add_column("frames", justify="right")
        beside = any(row["source_percent"] is not None for row in group)
        for label in bins:
            table.add_column(label if label == "overall" else f"{label}°", justify="right")
            if beside and label != "overall":
                table.add_column(SOURCE, justify="right", style="dim")
        tests = _grouped(group, ("frame_count",))
        first = [key for key in tests if key[0] is None]
        for key in first + sorted((key for key in tests if key[0] is not None), reverse=True):
            cells = {row["aspect_bin_deg"]: row for row in tests[key]}
            line = ["training" if key[0] is None else str(key[0])]
            for label in bins:
                row = cells[label]
                line.append(_percent_text(row))
                if beside and label != "overall":
                    theirs = row["source_percent"]
                    line.append("" if theirs is None else str(theirs))
            table.add_row(*line)
        console.print(table)
        noted = noted or beside
    if noted:
        console.print(f"Source: {figures['note']}", style="dim")
    if len(vigilances) > 1:
        console.print("95 % Wilson intervals; other vigilances are in the CSV", style="dim")
    else:
        console.print("95 % Wilson intervals", style="dim")


def _grouped(rows: list[Row], keys: tuple[str, ...]) -> dict[tuple[object, ...], list[Row]]:
    groups: dict[tuple[object, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[key] for key in keys), []).append(row)
    return groups


def _setting(setting: tuple[object, ...], row: Row) -> str:
    slant_range, floor = setting[:2]
    return f"{slant_range:g} km, {floor} target-free IFOVs"


def _count(row: Row) -> str:
    if not row["categories"]:
        return "failed"
    return f"{row['categories']}" + ("" if row["settled"] else "*")


def _percent_text(row: Row) -> str:
    if row["percent_correct"] is None:
        return "no profiles"
    return f"{row['percent_correct']:.0f} [{row['ci_low']:.0f}-{row['ci_high']:.0f}]"

"""The command `ncti-report`: print the tables of a store and write them as CSV."""

from __future__ import annotations

import argparse
import csv
import sys
from pathlib import Path

from rich.console import Console

from sweeps import store
from sweeps.classifier_schema import ACN, CLASSIFIERS, FUSION
from sweeps.flight_variables import TABLES_MEASURED, VALIDATION
from sweeps.report.classifiers import classifier_rows, print_classifiers
from sweeps.report.flight_pictures import MISSING, write_pictures
from sweeps.report.flights import flight_rows, print_flights
from sweeps.report.fusion import fusion_rows, print_fusion
from sweeps.report.measured import measured_rows, print_measured
from sweeps.report.rejection import curve_rows, print_rejection, rejection_rows
from sweeps.report.screen import (
    print_accuracy,
    print_categories,
    print_detection,
    print_reconstruction,
    print_sensor,
    print_silhouette_accuracy,
    print_silhouette_categories,
)
from sweeps.report.silhouettes import (
    detection_rows,
    reconstruction_rows,
    sensor_rows,
    silhouette_accuracy_rows,
    silhouette_category_rows,
)
from sweeps.report.tables import Row, accuracy_rows, category_rows, has_source_views
from sweeps.variables import (
    DETECTION,
    IMAGES,
    RECONSTRUCTION,
    REJECTION,
    TABLES,
    TABLES_INFRARED,
    TABLES_OF,
)

OTHER_VIEWS = "The source's figures are of its own 124 views, four ships from bow to beam."


def main() -> None:
    """Run the command line; exits with 2 when the store cannot be read."""
    parser = argparse.ArgumentParser(
        prog="ncti-report",
        description="Print the tables of a sweep beside the source's, and write them as CSV.",
    )
    parser.add_argument("store", type=Path, help="store of a sweep, such as sweep.zarr")
    parser.add_argument(
        "--pictures",
        action="store_true",
        help="also draw every stage of the corrections of flights, beside the tables",
    )
    arguments = parser.parse_args()
    path, console = arguments.store.absolute(), Console()
    try:
        report(path, console)
    except (OSError, KeyError, ValueError):
        print(
            f"ncti-report: store is {str(path)!r}, but must be the zarr store of a sweep with its "
            "tables written",
            file=sys.stderr,
        )
        sys.exit(2)
    if arguments.pictures:
        try:
            write_pictures(path, console)
        except (ImportError, OSError, ValueError) as error:
            why = MISSING if isinstance(error, ImportError) else error
            print(f"ncti-report: pictures are not drawn: {why}", file=sys.stderr)
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
    written = _range_tables(path, console)
    written |= _classifier_tables(path, console)
    written |= _infrared_tables(path, console)
    written |= _rejection_tables(path, console)
    written |= _flight_tables(path, console)
    if not written and not store.has_group(path, VALIDATION):
        raise FileNotFoundError(path)
    folder = store.tables_folder(path)
    folder.mkdir(exist_ok=True)
    for name, rows in written.items():
        write_csv(folder / f"{name}.csv", rows)
    console.print(f"store   {path}", soft_wrap=True, highlight=False)
    files = ", ".join(f"{name}.csv" for name in written)
    console.print(f"tables  {folder}: {files}", soft_wrap=True, highlight=False)


def _range_tables(path: Path, console: Console) -> dict[str, list[Row]]:
    """Print the tables of the range channel, if there are any, and return their rows by name."""
    if not store.has_group(path, TABLES):
        return {}
    tables = store.read_group(path, TABLES).load()
    rows = {"categories": category_rows(tables), "accuracy": accuracy_rows(tables)}
    print_categories(rows["categories"], console)
    print_accuracy(rows["accuracy"], console)
    if not has_source_views(tables):
        console.print(OTHER_VIEWS, style="dim")
    return rows


def _classifier_tables(path: Path, console: Console) -> dict[str, list[Row]]:
    """Print all classifiers of range profiles beside one another, if there is more than the ACN."""
    there = {
        name: store.read_group(path, TABLES_OF[name]).load()
        for name in CLASSIFIERS
        if store.has_group(path, TABLES_OF[name])
    }
    rows: dict[str, list[Row]] = {}
    together = there.pop(FUSION, None)
    if there and set(there) != {ACN}:
        rows["classifiers"] = classifier_rows(there)
        print_classifiers(rows["classifiers"], console)
    if together is not None:
        rows["fusion"] = fusion_rows(together)
        print_fusion(rows["fusion"], console)
    return rows


def _infrared_tables(path: Path, console: Console) -> dict[str, list[Row]]:
    """Print the tables of the infrared channel, if there are any, and return their rows."""
    if not store.has_group(path, DETECTION):
        return {}
    configuration = store.read_attributes(path)["configuration"]["infrared"]
    rows = {"infrared_sensor": sensor_rows(store.read_group(path, IMAGES), configuration)}
    print_sensor(rows["infrared_sensor"], console)
    if store.has_group(path, TABLES_INFRARED):  # not where the ACN names no silhouettes
        classified = store.read_group(path, TABLES_INFRARED).load()
        rows["infrared_categories"] = silhouette_category_rows(classified)
        rows["infrared_accuracy"] = silhouette_accuracy_rows(classified)
        print_silhouette_categories(rows["infrared_categories"], console)
        print_silhouette_accuracy(rows["infrared_accuracy"], console)
        if not has_source_views(classified):
            console.print(OTHER_VIEWS, style="dim")
    found, restored = (
        store.read_group(path, group).load() for group in (DETECTION, RECONSTRUCTION)
    )
    rows["infrared_detection"] = detection_rows(found)
    rows["infrared_super_resolution"] = reconstruction_rows(restored)
    print_detection(rows["infrared_detection"], configuration["false_alarm"], console)
    print_reconstruction(rows["infrared_super_resolution"], console)
    return rows


def _rejection_tables(path: Path, console: Console) -> dict[str, list[Row]]:
    """Print what unknown ships come to, if there are any, and return their rows."""
    tables = {
        name: store.read_group(path, group).load()
        for name, (_, group) in REJECTION.items()
        if store.has_group(path, group)
    }
    if not tables:
        return {}
    curve = curve_rows(tables)
    print_rejection(curve, console)
    return {"rejection": rejection_rows(tables), "rejection_curve": curve}


def _flight_tables(path: Path, console: Console) -> dict[str, list[Row]]:
    """Print what flights measure, if there are any, and return their rows."""
    if not store.has_group(path, VALIDATION):
        return {}
    flights = store.read_group(path, VALIDATION)
    images = ("profile", "signature", "intensity", "range_image", "infrared_image")
    flights = flights.drop_vars(images).load()
    rows = {"flights": flight_rows(flights)}
    print_flights(flights, console)
    if store.has_group(path, TABLES_MEASURED):
        rows["measured"] = measured_rows(store.read_group(path, TABLES_MEASURED).load())
        print_measured(rows["measured"], console)
    return rows


def write_csv(path: Path, rows: list[Row]) -> None:
    """Write rows with their keys as header; an absent value is an empty field."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)

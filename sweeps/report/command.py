"""The command `ncti-report`: print the tables of a store and write them as CSV."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import xarray as xr
from rich.console import Console

from sweeps.engine.errors import ConfigurationError
from sweeps.report import (
    classifiers,
    flights,
    fusion,
    measured,
    others,
    rejection,
    silhouettes,
    stored,
    tables,
)
from sweeps.report.axes import OF_ARRAYS, printable
from sweeps.report.output import FILES, complain, page, write_tables
from sweeps.report.rows import Row
from sweeps.report.screen import explain, note, plain, unforeseen
from sweeps.report.source import has_source_views

OTHER_VIEWS = "The source's figures are of its own 124 views, four ships from bow to beam."
REJECTION = "rejection_"
OWN = {"acn_infrared", "fusion", "detection", "super_resolution", "measured"}
"""Groups of tables that are reported in a way of their own."""
CLASSIFIERS = ("acn", "mnn", "correlation", "likelihood")  # of range profiles, the known ones first

# Name of a file, its rows, and what prints them; a table has any of them.
Part = tuple[str, list[Row], Callable[[Console], None] | None]


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
    except ConfigurationError as error:
        complain(str(error))
        sys.exit(2)
    except OSError as error:
        complain(f"tables are not written: {error}")
        sys.exit(2)
    if arguments.pictures:
        _draw(path, console)


def _draw(path: Path, console: Console) -> None:
    """Draw the flights of a store; exits with 2 when that cannot be done."""
    # Here, since nothing else needs what flies, which takes longer to import than tables to print.
    from sweeps.report.flight_pictures import MISSING, write_pictures

    try:
        write_pictures(path, console)
    except (ImportError, OSError, ValueError) as error:
        complain(f"pictures are not drawn: {MISSING if isinstance(error, ImportError) else error}")
        sys.exit(2)


def report(path: Path, console: Console) -> None:
    """Write the tables of a store beside it, then print them as far as the console can take it.

    Raises ConfigurationError if the store cannot be read or has no tables, and OSError if tables
    cannot be written beside it; they are printed all the same.
    """
    try:
        parts = list(_parts(path))
    # Whatever zarr and xarray raise of files that are damaged or of something else.
    except Exception as error:
        why = f"{type(error).__name__}: {error}".split("\n")[0]
        raise ConfigurationError(f"{_no_store(path)} ({why})") from error
    if not parts:
        raise ConfigurationError(_no_store(path))
    failed, files, folder = None, [], stored.tables_folder(path)
    try:
        files = write_tables(folder, {name: rows for name, rows, _ in parts})
    except OSError as error:
        failed = error
    with page(console) as aside:
        for _, _, show in parts:
            if show:
                show(aside)
        explain(unforeseen([row for _, rows, _ in parts for row in rows]), aside)
        aside.print(plain(f"store   {printable(str(path))}"), soft_wrap=True)
        where = f"tables  {printable(str(folder))}: {', '.join(files)}"
        aside.print(plain(where), soft_wrap=True)
    if failed:
        raise failed


def _no_store(path: Path) -> str:
    return f"store is {str(path)!r}, but must be the zarr store of a sweep with its tables written"


def _parts(path: Path) -> Iterator[Part]:
    """Everything that a store has tables of."""
    top, names = stored.groups(path), stored.groups(path, "tables")
    read = {name: stored.read(path, f"tables/{name}").load() for name in names}
    if "acn" in read:
        yield _part("categories", tables.category_rows(read["acn"]), tables.print_categories)
        yield _part("accuracy", tables.accuracy_rows(read["acn"]), tables.print_accuracy)
        yield from _other_views(read["acn"])
    named = [name for name in set(names) - OWN if classifiers.names_profiles(read[name])]
    if set(named) - {"acn"}:
        named.sort(key=lambda name: ([*CLASSIFIERS, name].index(name), name))
        rows = classifiers.classifier_rows({name: read[name] for name in named})
        yield _part("classifiers", rows, classifiers.print_classifiers)
    if "fusion" in read:
        yield _part("fusion", fusion.fusion_rows(read["fusion"]), fusion.print_fusion)
    if "infrared" in top and "detection" in read:
        yield from _infrared(path, read)
    rejected = {name: read[name] for name in names if name.startswith(REJECTION)}
    if rejected:
        by_name = {name.removeprefix(REJECTION): table for name, table in rejected.items()}
        yield "rejection", rejection.rejection_rows(by_name), None
        curve = rejection.curve_rows(by_name)
        yield _part("rejection_curve", curve, rejection.print_rejection)
    if "validation" in top:
        flown = stored.read(path, "validation")
        arrays = [name for name in flown.data_vars if set(flown[name].dims) & set(OF_ARRAYS)]
        flown = flown.drop_vars(arrays).load()
        yield "flights", flights.flight_rows(flown), partial(flights.print_flights, flown)
    if "measured" in read:
        yield _part("measured", measured.measured_rows(read["measured"]), measured.print_measured)
    for name in names:
        rows = [] if {name} & {*named, *OWN, *rejected} else others.other_rows(read[name])
        if rows:
            title = str(read[name].attrs.get("title", name.replace("_", " ").capitalize()))
            file = f"{name}_table" if name in FILES else name
            yield _part(file, rows, partial(others.print_other, title))


def _part(name: str, rows: list[Row], write: Callable[[list[Row], Console], None]) -> Part:
    return name, rows, partial(write, rows)


def _other_views(table: xr.Dataset) -> Iterator[Part]:
    """A word on the source's figures, where the views are not the source's."""
    if not has_source_views(table):
        yield "", [], partial(note, OTHER_VIEWS)


def _infrared(path: Path, read: dict[str, xr.Dataset]) -> Iterator[Part]:
    """Tables of the infrared channel."""
    given = stored.attributes(path)["configuration"]["infrared"]
    rows = silhouettes.sensor_rows(stored.read(path, "infrared"), given)
    yield _part("infrared_sensor", rows, silhouettes.print_sensor)
    if "acn_infrared" in read:  # not where the network names no silhouettes
        formed = silhouettes.silhouette_category_rows(read["acn_infrared"])
        yield _part("infrared_categories", formed, silhouettes.print_silhouette_categories)
        right = silhouettes.silhouette_accuracy_rows(read["acn_infrared"])
        yield _part("infrared_accuracy", right, silhouettes.print_silhouette_accuracy)
        yield from _other_views(read["acn_infrared"])
    found = silhouettes.detection_rows(read["detection"])
    alarms = stored.setting(read["detection"], given, "false_alarm")
    show = partial(silhouettes.print_detection, found, alarms)
    yield "infrared_detection", found, show
    restored = silhouettes.reconstruction_rows(read["super_resolution"])
    yield _part("infrared_super_resolution", restored, silhouettes.print_reconstruction)

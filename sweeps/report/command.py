"""The command `ncti-report`: print the tables of a store and write them as CSV."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import xarray as xr
from rich.console import Console
from rich.progress import track

from sweeps.engine.errors import ConfigurationError
from sweeps.report import flights, rows, scans, silhouettes, tables
from sweeps.report.axes import OF_ARRAYS, Column, printable, shown
from sweeps.report.rows import Row
from sweeps.report.screen import (
    FILES,
    complain,
    explain,
    line,
    note,
    page,
    sheet,
    show,
    unforeseen,
    write_tables,
    write_whole,
)

if TYPE_CHECKING:
    import trimesh
    from matplotlib.figure import Figure

__all__ = ["main", "report", "write_pictures"]

OTHER_VIEWS = "The source's figures are of its own 124 views, four ships from bow to beam."
REJECTION = "rejection_"
OWN = {"acn_infrared", "fusion", "detection", "super_resolution", "measured", "scan"}
"""Groups of tables that are reported in a way of their own."""
CLASSIFIERS = ("acn", "mnn", "correlation", "likelihood")  # of range profiles, the known ones first
TOLD = 6  # names of pictures; the folder has the others
MOST = 60  # rows of any other table on the screen; the file has all

# Of groups of tables: names of files, and what makes and prints their rows.
TABLES: dict[str, tuple[tuple[str, Callable[..., list[Row]], Callable[..., None]], ...]] = {
    "acn": (
        ("categories", tables.category_rows, tables.print_categories),
        ("accuracy", tables.accuracy_rows, tables.print_accuracy),
    ),
    "fusion": (("fusion", silhouettes.fusion_rows, silhouettes.print_fusion),),
    "acn_infrared": (
        (
            "infrared_categories",
            silhouettes.silhouette_category_rows,
            silhouettes.print_silhouette_categories,
        ),
        (
            "infrared_accuracy",
            silhouettes.silhouette_accuracy_rows,
            silhouettes.print_silhouette_accuracy,
        ),
    ),
    "super_resolution": (
        (
            "infrared_super_resolution",
            silhouettes.reconstruction_rows,
            silhouettes.print_reconstruction,
        ),
    ),
    "measured": (("measured", flights.measured_rows, flights.print_measured),),
    "scan": (("scan", scans.scan_rows, scans.print_scan),),
}
BESIDE = {"acn", "acn_infrared"}  # figures of the source's views

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
    parser.add_argument(
        "--html", action="store_true", help="also write the report page beside the store"
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
        try:
            write_pictures(path, console)
        except (OSError, ValueError) as error:
            complain(f"pictures are not drawn: {error}")
            sys.exit(2)
    if arguments.html:
        try:
            print(write_report(path))
        except (OSError, ValueError) as error:
            complain(f"the report page is not written: {error}")
            sys.exit(2)


def write_report(path: Path) -> Path:
    """Write the report page of a store beside it; returns its path.

    Raises OSError or ValueError if it cannot.
    """
    # Here, since they take longer to import than tables take to print.
    from sweeps.report.figures import draw
    from sweeps.report.page.write import write_page

    return write_page(path, draw)


def report(path: Path, console: Console) -> None:
    """Write the tables of a store beside it, then print them as far as the console can take it.

    Raises ConfigurationError if the store cannot be read or has no tables, and OSError if tables
    cannot be written beside it; they are printed all the same.
    """
    refusal = (
        f"store is {str(path)!r}, but must be the zarr store of a sweep with its tables written"
    )
    try:
        parts = list(_parts(path))
    # Whatever zarr and xarray raise of files that are damaged or of something else.
    except Exception as error:
        why = f"{type(error).__name__}: {error}".split("\n")[0]
        raise ConfigurationError(f"{refusal} ({why})") from error
    if not parts:
        raise ConfigurationError(refusal)
    failed, files, folder = None, [], rows.tables_folder(path)
    try:
        files = write_tables(folder, {name: found for name, found, _ in parts})
    except OSError as error:
        failed = error
    with page(console) as aside:
        for _, _, write in parts:
            if write:
                write(aside)
        explain(unforeseen([row for _, found, _ in parts for row in found]), aside)
        line(f"store   {printable(str(path))}", aside)
        line(f"tables  {printable(str(folder))}: {', '.join(files)}", aside)
    if failed:
        raise failed


def write_pictures(
    path: Path, console: Console, *, ship: Callable[[str], trimesh.Trimesh] | None = None
) -> None:
    """Draw every stage of the corrections of each flight, and near-stern profiles.

    Of each ship flown past, range and aspect one flight, nominal on any other axis. `ship` gives
    the mesh of a label, in place of the known ship of that name. Raises ValueError if the store has
    no flights, or its ships are no longer known.
    """
    # Here, since nothing else needs what flies, which takes longer to import than to print.
    from sweeps.report.flight_figures import draw_flight, draw_validation, flights_of, known_ship

    store = rows.opened(path)
    if "validation" not in store:
        raise ValueError(f"{str(path)!r} has no flights, but must be the store of a sweep of irar")
    given, flights, folder = store.attrs, rows.read(store, "validation"), rows.tables_folder(path)
    folder.mkdir(exist_ok=True)
    load, places = ship or partial(known_ship, given), flights_of(flights)
    meshes = {place.ship: load(place.ship) for place in places}
    drawn: dict[str, Callable[[], Figure]] = {}
    for place in places:
        label = re.sub(r"[^\w.-]", "_", place.ship)
        name = f"flight_{label}_{place.range:g}km_{place.aspect:g}deg.png"
        drawn[name] = partial(draw_flight, given, flights, place, meshes[place.ship])
    if flights.stern_to_hangar.notnull().any():
        drawn["validation.png"] = partial(draw_validation, flights)
    aside = Console(stderr=True)
    for name, make in track(drawn.items(), description="  pictures        ", console=aside):
        write_whole(folder / name, partial(make().savefig, format="png"))
    names = list(drawn)
    more = f" and {len(names) - TOLD} more" if len(names) > TOLD else ""
    with page(console) as there:
        line(f"pictures  {printable(str(folder))}: {', '.join(names[:TOLD])}{more}", there)


def _parts(path: Path) -> Iterator[Part]:
    """Everything that a store has tables of."""
    store = rows.opened(path)
    top, names = rows.groups(store), rows.groups(store, "tables")
    read = {name: rows.read(store, f"tables/{name}").load() for name in names}
    yield from _of(read, "acn")
    named = [name for name in set(names) - OWN if tables.names_profiles(read[name])]
    if set(named) - {"acn"}:
        named.sort(key=lambda name: ([*CLASSIFIERS, name].index(name), name))
        found = tables.classifier_rows({name: read[name] for name in named})
        yield "classifiers", found, partial(tables.print_classifiers, found)
    yield from _of(read, "fusion")
    if "infrared" in top and "detection" in read:
        given = store.attrs["configuration"]["infrared"]
        found = silhouettes.sensor_rows(rows.read(store, "infrared"), given)
        yield "infrared_sensor", found, partial(silhouettes.print_sensor, found)
        yield from _of(read, "acn_infrared")  # not where the network names no silhouettes
        found = silhouettes.detection_rows(read["detection"])
        alarms = rows.setting(read["detection"], given, "false_alarm")
        yield "infrared_detection", found, partial(silhouettes.print_detection, found, alarms)
        yield from _of(read, "super_resolution")
    rejected = {name: read[name] for name in names if name.startswith(REJECTION)}
    if rejected:
        by_name = {name.removeprefix(REJECTION): table for name, table in rejected.items()}
        yield "rejection", tables.rejection_rows(by_name), None
        found = tables.curve_rows(by_name)
        yield "rejection_curve", found, partial(tables.print_rejection, found)
    if "validation" in top:
        flown = without_arrays(rows.read(store, "validation")).load()
        yield "flights", flights.flight_rows(flown), partial(flights.print_flights, flown)
    yield from _of(read, "measured")
    yield from _of(read, "scan")
    for name in names:
        found = [] if {name} & {*named, *OWN, *rejected} else other_rows(read[name])
        if found:
            title = str(read[name].attrs.get("title", name.replace("_", " ").capitalize()))
            file = f"{name}_table" if name in FILES else name
            yield file, found, partial(print_other, title, found)


def _of(read: Mapping[str, xr.Dataset], group: str) -> Iterator[Part]:
    """The tables of a group, if a store has it, and a word where its views are not the source's."""
    if group in read:
        for file, made, write in TABLES[group]:
            found = made(read[group])
            yield file, found, partial(write, found)
        if group in BESIDE and not rows.has_source_views(read[group]):
            yield "", [], partial(note, OTHER_VIEWS)


def without_arrays(dataset: xr.Dataset) -> xr.Dataset:
    """Return a data set without profiles and images, which are no figures."""
    return dataset.drop_vars([name for name in dataset if set(dataset[name].dims) & set(OF_ARRAYS)])


def other_rows(table: xr.Dataset) -> list[Row]:
    """Return a row for each cell of any table: its place on the axes, draws among them, figures."""
    figures = without_arrays(table)
    columns = {str(name): Column(array) for name, array in figures.data_vars.items()}
    return [
        axes | {column: rows.known(cell[name]) for name, column in columns.items()}
        for axes, cell in rows.cells(figures, but=OF_ARRAYS)
        if columns
    ]


def print_other(title: str, found: list[Row], console: Console) -> None:
    """Print a table of any kind: axes of several values to the left, figures to the right."""
    axes = [axis for axis in rows.several(found, none=True) if not axis.number]
    figures = [key for key in found[0] if type(key) is Column]
    table = sheet(title, *(one.heading for one in figures), left=[one.heading for one in axes])
    for row in found[:MOST]:
        values = (row[key] for key in (*axes, *figures))
        table.add_row(*(f"{one:.4g}" if isinstance(one, float) else shown(one) for one in values))
    show(table, console)
    if len(found) > MOST:
        note(f"{len(found) - MOST} more rows are in the CSV.", console)
    explain(figures, console)

"""Tables of a store: file name, rows and printing function of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple
from functools import partial
from pathlib import Path
from typing import NamedTuple

import xarray as xr
from rich.console import Console

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.folders import verify
from sweeps.report import flights, rows, scans, silhouettes, tables
from sweeps.report.axes import OF_ARRAYS, printable
from sweeps.report.fair import read_compared
from sweeps.report.others import other_rows, print_other
from sweeps.report.own import is_free
from sweeps.report.places import page_file, tables_folder
from sweeps.report.rows import Row
from sweeps.report.screen import FILES, line, write_tables
from sweeps.report.work import COLUMNS, print_work, read_work

READ = ("tables", "infrared", "validation")  # groups that tables are made of
REJECTION = "rejection_"
OWN = {"acn_infrared", "fusion", "detection", "super_resolution", "measured", "scan"}
"""Groups of tables with a special layout."""
CLASSIFIERS = ("acn", "mnn", "correlation", "likelihood")  # of range profiles, the known ones first

# By group of tables: names of files, and functions that make and print their rows.
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


class Part(NamedTuple):
    """A table of a store.

    A table that is not `listed` repeats figures of another one; it is printed on request.
    `whole` prints all rows, if `write` leaves some out.
    """

    name: str
    rows: list[Row]
    write: Callable[[Console], None]
    listed: bool = True
    whole: Callable[[Console], None] | None = None


def check_whole(path: Path, *, groups: Iterable[str] | None = READ) -> None:
    """Refuse a store of which files are damaged, missing or of something else.

    By default, in the groups that tables are made of; with None, everywhere. Raises
    ConfigurationError.
    """
    try:
        bad = verify(path, groups)
    except (OSError, ConfigurationError) as error:
        raise ConfigurationError(_refusal(path, str(error))) from error
    if bad:
        many = f"{len(bad):,} of its files are" if len(bad) > 1 else "one of its files is"
        why = f"{many} damaged, missing or of something else: {bad[0]}"
        raise ConfigurationError(_refusal(path, why))


def _refusal(path: Path, why: str) -> str:
    refusal = "but must be the zarr store of a sweep with its tables written"
    return f"store is {str(path)!r}, {refusal}" + (f" ({why})" if why else "")


def parts_of(path: Path) -> list[Part]:
    """Return the tables of a store. Raises ConfigurationError if it has none or cannot be read."""
    try:
        found = [part for part in _parts(path) if part.rows]
    # zarr and xarray raise various errors for damaged or other files.
    except Exception as error:
        why = f"{type(error).__name__}: {error}".split("\n")[0]
        raise ConfigurationError(_refusal(path, why)) from error
    if not found:
        raise ConfigurationError(_refusal(path, ""))
    work = [dict(zip(COLUMNS, astuple(one), strict=True)) for one in read_work(path)]
    if work:
        found.append(Part("stages", work, partial(print_work, work), listed=False))
    return found


def chosen(parts: Iterable[Part], name: str) -> Part:
    """Return the table of a name. Raises ConfigurationError, which lists the names."""
    by_name = {part.name: part for part in parts}
    if name not in by_name:
        raise ConfigurationError(f"table is {name!r}, but must be one of {', '.join(by_name)}")
    return by_name[name]


def failed_cells(path: Path) -> dict[str, str]:
    """Return the names of cells that failed, with the reason of each, as a store has them."""
    return dict(rows.attributes(rows.opened(path)).get("failures", {}))


def write_parts(path: Path, parts: Iterable[Part]) -> tuple[list[Path], OSError | None]:
    """Write the tables of a store as CSV files beside it.

    Returns the paths at which other files are in the way, and the error if it fails.
    """
    try:
        return write_tables(tables_folder(path), {part.name: part.rows for part in parts}), None
    except OSError as error:
        return [], error


def print_places(path: Path, parts: Sequence[Part], console: Console) -> None:
    """Print where a store, its tables and its page are, and how many of its cells failed."""
    line("", console)
    if failed := failed_cells(path):
        count = f"{len(failed):,} cell" + "s" * (len(failed) > 1)
        line(f"failed  {count}: the tables cover the others", console)
    line(f"store   {located(path)}", console)
    count = f"{len(parts)} CSV file" + "s" * (len(parts) > 1)
    line(f"tables  {located(tables_folder(path))} ({count})", console)
    if page_file(path).is_file() and is_free(page_file(path)):  # else it is not of a report
        line(f"report  {located(page_file(path))}", console)


def located(path: Path) -> str:
    """Return the shortest path from the current folder, with control characters escaped."""
    here = Path.cwd()
    return printable(str(path.relative_to(here) if path.is_relative_to(here) else path))


def _parts(path: Path) -> Iterator[Part]:
    store = rows.opened(path)
    top, names = rows.groups(store), rows.groups(store, "tables")
    read = {name: read_compared(store, f"tables/{name}").load() for name in names}
    named = [name for name in set(names) - OWN if tables.names_profiles(read[name])]
    several = bool(set(named) - {"acn"})
    for part in _of(read, "acn"):
        yield part._replace(listed=part.name != "accuracy" or not several)
    if several:
        named.sort(key=lambda name: ([*CLASSIFIERS, name].index(name), name))
        found = tables.classifier_rows({name: read[name] for name in named})
        yield Part("classifiers", found, partial(tables.print_classifiers, found))
    yield from _of(read, "fusion")
    if "infrared" in top and "detection" in read:
        given = rows.attributes(store)["configuration"]["infrared"]
        found = silhouettes.sensor_rows(rows.read(store, "infrared"), given)
        yield Part("infrared_sensor", found, partial(silhouettes.print_sensor, found))
        yield from _of(read, "acn_infrared")  # absent if the network identifies no silhouettes
        found = silhouettes.detection_rows(read["detection"])
        alarms = rows.setting(read["detection"], given, "false_alarm")
        write = partial(silhouettes.print_detection, found, alarms)
        yield Part("infrared_detection", found, write)
        yield from _of(read, "super_resolution")
    rejected = {name: read[name] for name in names if name.startswith(REJECTION)}
    if rejected:
        by_name = {name.removeprefix(REJECTION): table for name, table in rejected.items()}
        found = tables.rejection_rows(by_name)
        yield Part("rejection", found, partial(tables.print_rates, found), listed=False)
        found = tables.curve_rows(by_name)
        yield Part("rejection_curve", found, partial(tables.print_rejection, found))
    if "validation" in top:
        flown = without_arrays(rows.read(store, "validation")).load()
        found = flights.flight_rows(flown)
        yield Part("flights", found, partial(flights.print_flights, flown))
    yield from _of(read, "measured")
    yield from _of(read, "scan")
    for name in names:
        if {name} & {*named, *OWN, *rejected}:
            continue
        found = other_rows(without_arrays(read[name]))
        title = str(read[name].attrs.get("title", name.replace("_", " ").capitalize()))
        file = f"{name}_table" if name in FILES else name
        yield _other(file, title, found)


def _other(name: str, title: str, found: list[Row]) -> Part:
    """Return a table that is printed by its own names."""
    write = partial(print_other, title, found)
    return Part(name, found, write, whole=partial(write, most=None))


def _of(read: Mapping[str, xr.Dataset], group: str) -> Iterator[Part]:
    """Yield the tables of a group."""
    if group in read:
        for file, made, write in TABLES[group]:
            found = made(read[group])
            yield Part(file, found, partial(write, found))


def without_arrays(dataset: xr.Dataset) -> xr.Dataset:
    """Return a data set without profiles and images."""
    return dataset.drop_vars([name for name in dataset if set(dataset[name].dims) & set(OF_ARRAYS)])

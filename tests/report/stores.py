"""Helpers that make finished stores, and that run and read their reports."""

import csv
import warnings
from pathlib import Path
from typing import Any
from zlib import crc32

import zarr
from commands import swept
from once import made_once

from sweeps.engine.cache.packs import seal
from sweeps.engine.store.manifest import MANIFEST
from sweeps.report import stores as of_stores
from sweeps.report.command import main
from sweeps.report.outputs import tables_folder

COARSE = ["render.pixel=0.5", "render.engine=embree"]
# Flights of coarse pixels and few lines, which take a tenth of a second each.
SMALL = {"ifov": 500.0, "samples": 60, "line_rate": 60.0, "detectors": 3, "pulse_rate": 4000.0}
FLIGHTS = [
    "sensor=irar",
    "grid.ship=[roberts,duncan]",
    "grid.pulse_width=[30,50]",
    "irar.range=3",
    "classifier.name=[acn,correlation]",
    *(f"irar.{key}={value:g}" for key, value in SMALL.items()),
    *COARSE,
]


def swept_once(factory: Any, name: str, *overrides: str) -> Path:
    """Return the path of a store that one of the test processes sweeps, without its report."""

    def make(folder: Path) -> None:
        assert not swept(folder / "s.zarr", folder / "cache", *overrides).failures

    return made_once(factory, name, make) / "s.zarr"


def signed(path: Path) -> Path:
    """Add a sweep's metadata and manifest to a store that xarray wrote, and return its path."""
    with warnings.catch_warnings(action="ignore"):
        zarr.consolidate_metadata(path)
    (path / MANIFEST).unlink(missing_ok=True)
    files = [file for file in path.rglob("*") if file.is_file()]
    sizes = {str(file.relative_to(path)): file.stat().st_size for file in files}
    chunks = {name: ("", {"0": crc32((path / name).read_bytes())}) for name in sizes}
    (path / MANIFEST).write_bytes(seal({"files": sizes, "chunks": chunks}))
    return path


def reported(monkeypatch, *arguments: object) -> int:
    """Run `ncti-report` with some arguments and return its exit status."""
    monkeypatch.setattr("sys.argv", ["ncti-report", *map(str, arguments)])
    try:
        main()
    except SystemExit as error:
        return error.code
    return 0


def rows_of(path: Path, name: str) -> list[dict[str, str]]:
    """Return the rows of a store's table from its CSV file."""
    with (tables_folder(path) / f"{name}.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def attributes_of(path: Path) -> dict[str, Any]:
    """Return the attributes of a store's root group."""
    return of_stores.attributes(zarr.open_group(path, mode="r"))


def contents(folder: Path) -> dict[str, bytes]:
    """Return the bytes of every file below a folder that is not hidden, by relative path."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.name.startswith(".")
    }

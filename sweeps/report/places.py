"""Where the report of a store is written: beside it."""

from __future__ import annotations

from pathlib import Path

SUFFIX = ".zarr"


def tables_folder(path: Path) -> Path:
    """Return the folder of a store's tables: of `q.zarr` `q-tables`, of `q` `q.tables`."""
    return _beside(path, "tables")


def page_file(path: Path) -> Path:
    """Return the file of a store's page: of `q.zarr` `q-report.html`, of `q` `q.report.html`."""
    return _beside(path, "report.html")


def _beside(path: Path, what: str) -> Path:
    if path.name.endswith(SUFFIX):
        return path.with_name(f"{path.name.removesuffix(SUFFIX)}-{what}")
    return path.with_name(f"{path.name}.{what}")


def located(path: Path) -> str:
    """Return the shortest path from the current folder, with control characters escaped."""
    from sweeps.report.words import printable

    here = Path.cwd()
    return printable(str(path.relative_to(here) if path.is_relative_to(here) else path))

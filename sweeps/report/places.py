"""Where the report of a store is written: beside the store. Imports nothing that takes long."""

from __future__ import annotations

from pathlib import Path

SUFFIX = ".zarr"


def beside(path: Path) -> tuple[Path, Path]:
    """Return the folder of tables and the file of the page of a store."""
    return tables_folder(path), page_file(path)


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

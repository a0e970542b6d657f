"""Where the report of a store is written: beside the store. Imports nothing that takes long."""

from __future__ import annotations

from pathlib import Path

from sweeps.engine.declare.paths import PathOrUrl, path_beside

SUFFIX = ".zarr"


def report_paths(path: PathOrUrl) -> tuple[Path, Path]:
    """Return the folder of tables and the file of the page of a store."""
    return tables_folder(path), page_file(path)


def tables_folder(path: PathOrUrl) -> Path:
    """Return the folder of a store's tables: of `q.zarr` `q-tables`, of `q` `q.tables`."""
    return _sibling_path(path, "tables")


def page_file(path: PathOrUrl) -> Path:
    """Return the file of a store's page: of `q.zarr` `q-report.html`, of `q` `q.report.html`."""
    return _sibling_path(path, "report.html")


def _sibling_path(path: PathOrUrl, suffix: str) -> Path:
    neighbour = path_beside(path)
    if neighbour.name.endswith(SUFFIX):
        return neighbour.with_name(f"{neighbour.name.removesuffix(SUFFIX)}-{suffix}")
    return neighbour.with_name(f"{neighbour.name}.{suffix}")

"""A store as the report reads it: its groups, its attributes, and the folder of its tables."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import xarray as xr
import zarr

SUFFIX = ".zarr"


def groups(path: Path, under: str = "") -> list[str]:
    """Names of the groups of a store, or of those inside one of its groups; sorted.

    Raises
    ------
    OSError
        If there is no store.
    """
    root: Any = zarr.open_group(path, mode="r")
    if under and under not in root:
        return []
    return sorted((root[under] if under else root).group_keys())


def read(path: Path, group: str) -> xr.Dataset:
    """Return a group of a store, each variable read when it is used."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # metadata in one file are quicker, no more
        return xr.open_zarr(path, group=group, chunks=None)


def attributes(path: Path) -> dict[str, Any]:
    """Root attributes of a store."""
    return dict(zarr.open_group(path, mode="r").attrs)


def setting(dataset: xr.Dataset, configuration: Mapping[str, Any], name: str) -> Any:
    """Return the value of a setting: the coordinate of that name, else what the configuration says.

    None where null was given, which a coordinate has as NaN.
    """
    if name in dataset.coords and not dataset[name].dims:
        value = dataset[name].item()
        return None if value != value else value
    value = configuration[name]
    return value[0] if isinstance(value, list) else value


def tables_folder(path: Path) -> Path:
    """Folder beside a store for its tables; of `q.zarr` it is `q-tables`, of `q` `q.tables`."""
    if path.name.endswith(SUFFIX):
        return path.with_name(path.name.removesuffix(SUFFIX) + "-tables")
    return path.with_name(path.name + ".tables")

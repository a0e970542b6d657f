"""Finished stores: their groups, attributes and damage."""

from __future__ import annotations

import errno
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

import xarray as xr
import zarr

from ncti.text import printable
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.paths import PathOrUrl, path_or_url, resolve_path
from sweeps.engine.declare.storable import decode_attrs
from sweeps.engine.objects import Objects
from sweeps.engine.store.arrays import METADATA
from sweeps.engine.store.manifest import verify
from sweeps.engine.store.tables import restore_scalars
from sweeps.engine.store.writing import zarr_store
from sweeps.report.words import MAIN, preferred_value

PROFILE_ERROR = "range_profile/profile_error"
PRINTED_GROUPS = ("tables", PROFILE_ERROR)  # of which the report prints figures
# Dimensions of profiles and images.
ARRAY_DIMS = (
    *("down_range", "lag", "row", "column", "col", "angle", "radius"),
    *("horizontal", "vertical"),
)


def open_store(path: PathOrUrl) -> Any:
    """Return a store with its metadata. Raises OSError if there is none."""
    location = resolve_path(path_or_url("store", path))
    return _open_group(location, Objects(location).get(METADATA))


@lru_cache(maxsize=2)
def _open_group(location: PathOrUrl, metadata: bytes | None) -> Any:
    """Return a store, opened again only when its metadata change."""
    return zarr.open_group(zarr_store(location), mode="r")


def attributes(store: Any) -> dict[str, Any]:
    """Return the decoded attributes of a store or a group."""
    return decode_attrs(store.attrs)


def list_groups(store: Any, under: str = "") -> list[str]:
    """Return the names of groups of a store, or of subgroups of one."""
    inside = store.get(under) if under else store
    return sorted(inside.group_keys()) if inside is not None else []


def read_group(store: Any, group: str) -> xr.Dataset:
    """Return a group of a store, each variable read lazily. Raises KeyError without it."""
    return restore_scalars(xr.open_dataset(xr.backends.ZarrStore(store[group], mode="r")))


def check_whole(path: PathOrUrl, groups: Iterable[str] | None = None) -> None:
    """Raise ConfigurationError if a store has damaged, missing or foreign files.

    With `groups`, check only these.
    """
    try:
        faulty_files = verify(path, groups)
    except (OSError, ConfigurationError) as error:
        is_store = not isinstance(path, Path) or (path / METADATA).exists()
        raise refusal(path, error if is_store else "") from error
    if faulty_files:
        raise refusal(path, f"damaged, missing or foreign files, such as {faulty_files[0]}")


def refusal(path: PathOrUrl, reason: str | Exception = "") -> ConfigurationError:
    """Return the error that a store is not one of a sweep with tables, or cannot be read now."""
    if isinstance(path, Path) and not path.exists():
        return ConfigurationError(f"store is {str(path)!r}, which does not exist")
    if isinstance(reason, OSError) and reason.errno not in {None, errno.ENOENT, errno.ENOTDIR}:
        return ConfigurationError(
            f"store is {str(path)!r}, which cannot be read: {reason.strerror}"
        )
    if isinstance(reason, Exception) and not isinstance(reason, ConfigurationError):
        reason = error_reason(reason)
    sentence = f"store is {str(path)!r}, but must be the zarr store of a sweep with tables"
    return ConfigurationError(sentence + (f" ({reason})" if reason else ""))


def error_reason(error: Exception) -> str:
    """Return the kind of another library's error and the first line of its message."""
    return f"{type(error).__name__}: {error}".partition("\n")[0]


def failed_cells(store: Any) -> dict[str, str]:
    """Return the reasons of failed cells by their names, as stored."""
    return dict(attributes(store).get("failures", {}))


def select_preferred(dataset: xr.Dataset, *, keep: Iterable[str]) -> xr.Dataset:
    """Return a dataset at the preferred value of every axis, or else the first value.

    Dimensions in `keep`, and those of profiles and images, stay.
    """
    indices = {}
    for dim in set(map(str, dataset.dims)) - {*keep, *ARRAY_DIMS}:
        names = [str(name) for name in dataset.coords if dataset[name].dims == (dim,)]
        name = min(names, key=lambda name: name not in MAIN, default="")
        values = dataset[name].values.tolist() if name else []
        indices[dim] = values.index(preferred_value(name, values)) if values else 0
    return dataset.isel(indices)


def relative_path(path: PathOrUrl) -> str:
    """Return a path, relative if below the current folder, with control characters escaped."""
    if isinstance(path, Path) and path.is_relative_to(folder := Path.cwd()):
        path = path.relative_to(folder)
    return printable(str(path))

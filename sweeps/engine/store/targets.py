"""Checks of the paths and URLs of stores and caches, before anything is written."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Collection, Iterable
from contextlib import suppress
from pathlib import Path

from sweeps.engine.cache.packs import CELLS_FOLDER
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.paths import (
    PathOrUrl,
    ancestors,
    is_private,
    join,
    path_beside,
    path_or_url,
    resolve_path,
)
from sweeps.engine.objects import Objects
from sweeps.engine.store.arrays import METADATA
from sweeps.engine.store.manifest import read_manifest, refuse_foreign

ZARR_FILES = (METADATA, ".zgroup", ".zarray")  # files that only a folder of zarr has
LONGEST_NAME = ".{}." + 32 * "0" + ".partial"  # as long as any name beside a store


def check_store_path(path: PathOrUrl) -> None:
    """Refuse a path that is neither new nor a store with a readable manifest and no other files.

    Also refuse a store inside another store.
    """
    resolved = _resolve_checked("store", path, inside=True)
    try:
        sizes = Objects(resolved).sizes()
    except OSError as error:
        raise _path_error("store", resolved, f"which cannot be read: {error.strerror}") from error
    if sizes:
        refuse_foreign(path, sizes, read_manifest(resolved))


def check_cache_path(path: PathOrUrl) -> None:
    """Refuse a cache that is in a store, cannot be a folder, or is writable by others.

    Permissions of a bucket are not checked.
    """
    resolved = _resolve_checked("cache", path, inside=False)
    for folder in (resolved, join(resolved, CELLS_FOLDER)):
        if isinstance(folder, Path) and not is_private(folder):
            reason = f"but others own {str(folder)!r} or may write there; a cache must be private"
            raise _path_error("cache", path, f"{reason}: chmod go-w, or give another folder")


def check_targets(
    stores: Collection[PathOrUrl],
    cache: PathOrUrl,
    report_paths: Callable[[Path], Iterable[Path]] = lambda store: (),
) -> None:
    """Refuse stores and a cache that are unusable, nested, or in the way of a report.

    `report_paths` returns the paths that the report of a store writes to. They must not be stores,
    and no two reports may share a path.
    """
    for path in stores:
        check_store_path(path)
    check_cache_path(cache)
    stores_by_path = {resolve_path(path): path for path in stores}
    reports: dict[Path, PathOrUrl] = {}
    for path in stores_by_path.values():
        for report in report_paths(path_beside(path)):
            if resolve_path(report) in stores_by_path or is_store(report):
                reason = f"whose report would be written into the store {str(report)!r}"
                raise _path_error("store", path, f"{reason}; give another path")
            if (other := reports.setdefault(report, path)) != path:
                reason = f"whose report would replace that of {str(other)!r}"
                raise _path_error("store", path, f"{reason}; give another name")
    for key, path in (("cache", cache), *(("store", path) for path in stores_by_path.values())):
        resolved = resolve_path(path)
        outside = [resolved, *ancestors(resolved)][key == "store" :]
        if store := next(
            (stores_by_path[ancestor] for ancestor in outside if ancestor in stores_by_path), None
        ):
            raise _path_error(key, path, f"but must not be in the store {str(store)!r}")


def is_store(path: PathOrUrl) -> bool:
    """Return whether a path is a zarr store or part of one."""
    with suppress(OSError):  # unreadable
        return any(Objects(path).get(name) is not None for name in ZARR_FILES)
    return False


def _path_error(key: str, path: PathOrUrl, reason: str) -> ConfigurationError:
    return ConfigurationError(f"{key} is {str(path)!r}, {reason}")


def _resolve_checked(key: str, value: PathOrUrl, *, inside: bool) -> PathOrUrl:
    """Return the real path; refuse an impossible one, or one in a store.

    With `inside`, the path itself may be a store.
    """
    path = path_or_url(key, value)
    resolved = _resolve_folder(key, value, path, inside=inside) if isinstance(path, Path) else path
    if store := next(filter(is_store, [resolved, *ancestors(resolved)][inside:]), None):
        raise _path_error(key, value, f"but must not be in the store {str(store)!r}")
    return resolved


def _resolve_folder(key: str, value: PathOrUrl, path: Path, *, inside: bool) -> Path:
    """Return the real path; refuse an impossible name or an unwritable folder."""
    try:
        resolved = Path(os.path.realpath(path))
        with suppress(FileNotFoundError, NotADirectoryError):
            os.lstat(
                resolved.with_name(LONGEST_NAME.format(resolved.name))
                if resolved.name
                else resolved
            )
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise _path_error(key, value, f"which cannot be used: {reason}") from error
    for link in (path, *path.parents):
        if link.is_symlink() and not link.exists():
            raise _path_error(key, value, f"but {str(link)!r} is a dangling symlink")
    if not str(value) or not resolved.name:
        raise _path_error(key, value, "but must be the name of a folder")
    nearest = next(folder for folder in (resolved, *resolved.parents) if folder.exists())
    if not nearest.is_dir():
        raise _path_error(key, value, f"but {str(nearest)!r} is not a folder")
    if inside and nearest == resolved:
        nearest = resolved.parent
    try:
        tempfile.TemporaryFile(dir=nearest).close()
    except OSError as error:
        reason = f"but nothing can be written in {str(nearest)!r}: {error.strerror}"
        raise _path_error(key, value, reason) from error
    return resolved

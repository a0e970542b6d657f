"""Checks of the paths that a sweep is to write to, before any work; nothing there is touched."""

from __future__ import annotations

import os
import re
import tempfile
from pathlib import Path

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.manifest import MANIFEST, read_manifest
from sweeps.engine.replacement import PARTIAL, hidden

# Of a URL in a Path one slash is left; several schemes may be chained.
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.:-]*:/")


def real_place(path: Path) -> Path:
    """Absolute path without links: a store behind a link is replaced where it is."""
    return Path(os.path.realpath(path))


def check_target(path: str | Path) -> None:
    """Refuse a path that is neither new nor of a store with a readable manifest.

    Raises
    ------
    ConfigurationError
        Naming the path and what is wrong with it.
    """
    place = _checked_place("store", path)
    if place.exists():
        if not (place / MANIFEST).is_file():
            raise _wrong(
                "store",
                path,
                "which exists and is no store of a sweep; it must be a new path or such a store",
            )
        read_manifest(place)
    _check_writable("store", path, place.parent)


def check_folder(key: str, path: str | Path) -> None:
    """Refuse a path, of a setting, that is no folder and cannot become one.

    Raises
    ------
    ConfigurationError
        Naming the key, the path and what is wrong with it.
    """
    _check_writable(key, path, _checked_place(key, path))


def _wrong(key: str, path: str | Path, reason: str) -> ConfigurationError:
    return ConfigurationError(f"{key} is {str(path)!r}, {reason}")


def _checked_place(key: str, path: str | Path) -> Path:
    """Real place of a path that is no URL, dangling link or impossible name."""
    if _URL.match(str(path)):
        raise _wrong(key, path, "but must be a folder on a file system: URLs are not supported")
    try:
        place = real_place(Path(path))
        for part in (Path(path), *Path(path).parents):
            if part.is_symlink() and not part.exists():
                raise _wrong(key, path, f"but {str(part)!r} is a link to nothing")
        if not str(path) or not place.name:
            raise _wrong(key, path, "but must be the name of a folder")
        # The name of the unfinished copy is longer.
        most = os.pathconf(_nearest(place.parent), "PC_NAME_MAX")
        most -= len(hidden(place, PARTIAL).name) - len(place.name)
        length = len(os.fsencode(place.name))
    except ConfigurationError:
        raise
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise _wrong(key, path, f"which cannot be used: {reason}") from error
    if length > most:
        raise _wrong(key, path, f"whose name has {length} bytes, but must have at most {most}")
    return place


def _nearest(folder: Path) -> Path:
    """The nearest folder or file on the way to a path that exists."""
    return next(part for part in (folder, *folder.parents) if part.exists())


def _check_writable(key: str, path: str | Path, folder: Path) -> None:
    """Refuse a path unless files can be made in a folder, or the folder itself."""
    nearest = _nearest(folder)
    if not nearest.is_dir():
        raise _wrong(key, path, f"but {str(nearest)!r} is no folder")
    try:
        with tempfile.TemporaryFile(dir=nearest):
            pass
    except OSError as error:
        reason = f"but nothing can be written in {str(nearest)!r}: {error.strerror}"
        raise _wrong(key, path, reason) from error

"""Folders of stores: where one may be, one writer at a time, put in place whole, with checksums.

A store has a manifest, the checksum of every file. A checksum within each chunk tells a changed
chunk, but neither a missing one, which zarr reads as fill values, nor changed metadata.
"""

from __future__ import annotations

import ctypes
import fcntl
import json
import os
import re
import shutil
import socket
import tempfile
import uuid
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.results import seal, unseal

MANIFEST = "manifest"
PARTIAL = "partial"  # suffix of what is not whole yet, or being deleted
ASIDE = "aside"  # suffix of what stood in the place, where two folders cannot be exchanged

Remove = Callable[[Path], object]  # of a folder

# Of a URL in a Path one slash is left; several schemes may be chained.
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.:-]*:/")
_HERE = -100  # AT_FDCWD: paths are relative to the working directory
_EXCHANGE = 2  # RENAME_EXCHANGE


def real_place(path: Path) -> Path:
    """Absolute path without links: a store behind a link is replaced where it is."""
    return Path(os.path.realpath(path))


def check_target(path: str | Path) -> None:
    """Refuse a path that is neither new nor of a store with a readable manifest."""
    place = _checked_place("store", path)
    if place.exists():
        if not (place / MANIFEST).is_file():
            reason = (
                "which exists and is no store of a sweep; it must be a new path or such a store"
            )
            raise _wrong("store", path, reason)
        read_manifest(place)
    _check_writable("store", path, place.parent)


def check_folder(key: str, path: str | Path) -> None:
    """Refuse a path, of a setting, that is no folder and cannot become one."""
    _check_writable(key, path, _checked_place(key, path))


def _wrong(key: str, path: str | Path, reason: str) -> ConfigurationError:
    return ConfigurationError(f"{key} is {str(path)!r}, {reason}")


def _checked_place(key: str, path: str | Path) -> Path:
    """Real place of a path that is no URL, dangling link or impossible name."""
    if _URL.match(str(path)):
        raise _wrong(key, path, "but must be a folder on a file system: URLs are not supported")
    try:
        place = real_place(Path(path))
        links = [part for part in (Path(path), *Path(path).parents) if part.is_symlink()]
        dangling = [part for part in links if not part.exists()]
        # The name of the unfinished copy is longer.
        most = os.pathconf(_nearest(place.parent), "PC_NAME_MAX")
        most -= len(hidden(place, PARTIAL).name) - len(place.name) if place.name else 0
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise _wrong(key, path, f"which cannot be used: {reason}") from error
    if dangling:
        raise _wrong(key, path, f"but {str(dangling[0])!r} is a link to nothing")
    if not str(path) or not place.name:
        raise _wrong(key, path, "but must be the name of a folder")
    if (length := len(os.fsencode(place.name))) > most:
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
        tempfile.TemporaryFile(dir=nearest).close()
    except OSError as error:
        reason = f"but nothing can be written in {str(nearest)!r}: {error.strerror}"
        raise _wrong(key, path, reason) from error


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold the lock of a store, which need not exist; remove what killed writers of it left.

    The lock is a file beside the store that is locked by the operating system, which lets go of
    it when the process that holds it ends in any way. It is advisory, and holds between the nodes
    of a cluster only if its file system has `flock` across them. ConfigurationError if another
    process or thread holds it, or nothing can be locked there.
    """
    place = real_place(path)
    file = place.with_name(f".{place.name}.lock")
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        held = _acquire(file)
    except BlockingIOError:
        raise ConfigurationError(
            f"store is {str(path)!r}, which is being written by {_holder(file)}; "
            "wait for its end or give another path"
        ) from None
    except OSError as error:
        raise ConfigurationError(
            f"store is {str(path)!r}, but {str(file)!r} cannot be locked: {error.strerror}"
        ) from error
    try:
        since = datetime.now(UTC).isoformat(timespec="seconds")
        holder = {"pid": os.getpid(), "host": socket.gethostname(), "since": since}
        os.ftruncate(held, 0)
        os.pwrite(held, json.dumps(holder).encode(), 0)
        _remove_orphans(place)
        yield
    finally:
        # Removed while it is locked: who gets it next finds out that it is not there any more.
        file.unlink(missing_ok=True)
        os.close(held)


def _acquire(file: Path) -> int:
    """Descriptor of a locked file; raises BlockingIOError if another holds it."""
    while True:
        descriptor = os.open(file, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.samestat(os.fstat(descriptor), file.stat()):
                return descriptor
        except FileNotFoundError:  # its holder removed it before letting go of it
            pass
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _holder(file: Path) -> str:
    """Words for the holder of a lock."""
    try:
        holder = json.loads(file.read_bytes())
        return f"process {holder['pid']} on {holder['host']} since {holder['since']}"
    except (OSError, ValueError):
        return "another process"  # which has not signed yet, or has just ended


def _remove_orphans(place: Path) -> None:
    """Remove what killed writers left beside a place; what one set aside goes back if need be."""
    pattern = re.compile(rf"\.{re.escape(place.name)}\.[0-9a-f]{{32}}\.({PARTIAL}|{ASIDE})")
    for found in sorted(place.parent.iterdir()):
        match = pattern.fullmatch(found.name)
        if match and match[1] == ASIDE and not os.path.lexists(place):
            found.rename(place)
        elif match:
            remove_folder(found)


def hidden(place: Path, suffix: str) -> Path:
    """New name beside a place, hidden and unlike any other."""
    return place.with_name(f".{place.name}.{uuid.uuid4().hex}.{suffix}")


def remove_folder(folder: Path) -> None:
    """Remove a folder with all that is in it, as far as that is possible."""
    shutil.rmtree(folder, ignore_errors=True)


def put_in_place(partial: Path, place: Path) -> None:
    """Put a folder in its place; what was there before is then at `partial`.

    Readers see the old folder or the new one at any time; where the file system cannot exchange
    two folders they see none for a moment.
    """
    if not os.path.lexists(place):
        partial.rename(place)
    elif not _exchange(partial, place):
        aside = hidden(place, ASIDE)
        try:
            place.rename(aside)
            partial.rename(place)
        except BaseException:
            if not os.path.lexists(place):
                aside.rename(place)
            raise
        aside.rename(partial)


def _exchange(one: Path, other: Path) -> bool:
    """Exchange two folders at once; False where that is not supported."""
    renameat2 = getattr(ctypes.CDLL(None), "renameat2", None)  # which only Linux has
    given = _HERE, os.fsencode(one), _HERE, os.fsencode(other), ctypes.c_uint(_EXCHANGE)
    return renameat2 is not None and renameat2(*given) == 0


def write_file(file: Path, content: bytes) -> int:
    """Write a file, with any folders that it needs, and return its checksum."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(content)
    return zlib.crc32(content)


def write_manifest(path: Path, known: Mapping[str, int]) -> None:
    """Write the manifest of a store, given the checksums that are known from writing files."""
    names = sorted(_names(path))
    files = {name: known[name] if name in known else _checksum(path / name) for name in names}
    write_file(path / MANIFEST, seal(files))


def read_manifest(path: Path) -> dict[str, int]:
    """Checksum of every file of a store, by name relative to it.

    ConfigurationError if there is no manifest, or a damaged one.
    """
    try:
        files: dict[str, int] = unseal((path / MANIFEST).read_bytes())
    except (OSError, ValueError) as error:
        raise ConfigurationError(
            f"store is {str(path)!r}, whose {MANIFEST} cannot be read; "
            "give another path, or remove it if it is a damaged store"
        ) from error
    return files


def verify(path: Path) -> list[str]:
    """Sorted names of files of a store that are missing, changed or not of it.

    A file that is not in the manifest counts as damage, because zarr would read it as a chunk.
    """
    files, there = read_manifest(path), set(_names(path))
    damaged = there ^ set(files)
    for name in there - damaged:
        try:
            if _checksum(path / name) != files[name]:
                damaged.add(name)
        except OSError:
            damaged.add(name)
    return sorted(damaged)


def _names(path: Path) -> Iterator[str]:
    for folder, _, files in os.walk(path):
        for file in files:
            name = f"{folder}/{file}"[len(str(path)) + 1 :]
            if name != MANIFEST:
                yield name


def _checksum(file: Path) -> int:
    return zlib.crc32(file.read_bytes())

"""Folders of stores: checks of paths, locks, atomic replacement, and checksums.

A store has a manifest, the checksum of every file. A checksum within each chunk detects a changed
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
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.packs import raise_shortage, undamaged, unseal
from sweeps.engine.places import OPEN, make_folder
from sweeps.engine.zarr_array import METADATA

MANIFEST = "manifest"
PARTIAL = "partial"  # suffix of a folder that is incomplete or being deleted
ASIDE = "aside"  # suffix of the old folder, where two folders cannot be exchanged
READABLE = 0o644  # mode of files of a store: others may read them
OF_ZARR = (METADATA, ".zgroup", ".zarray")  # files that only a folder of zarr has

# A Path keeps one slash of a URL; several schemes may be chained.
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.:-]*:/")
_HERE = -100  # AT_FDCWD: paths are relative to the working directory
_EXCHANGE = 2  # RENAME_EXCHANGE


def real_place(path: Path) -> Path:
    """Return the absolute path without links: a store behind a link is replaced in place."""
    return Path(os.path.realpath(path))


def check_target(path: str | Path) -> None:
    """Refuse a path that is neither new nor a store with a readable manifest and its files alone.

    A store is replaced whole, with everything in it. Nor may it be inside another one.
    """
    place = _checked_place("store", path, inside=True)
    if place.exists():
        if not (place / MANIFEST).is_file():
            reason = (
                "which exists but is not a store of a sweep; it must be a new path or such a store"
            )
            raise _wrong("store", path, reason)
        if foreign := sorted(set(_names(place)) - set(read_manifest(place))):
            more = f" and {len(foreign) - 1:,} more" if len(foreign) > 1 else ""
            reason = f"in which no sweep wrote {foreign[0]!r}{more}; move that elsewhere"
            raise _wrong("store", path, reason)


def check_folder(key: str, path: str | Path) -> None:
    """Refuse a setting's path that is in a store, or is not a folder and cannot become one."""
    _checked_place(key, path, inside=False)


def check_apart(
    stores: Iterable[Path], cache: Path | str, beside: Callable[[Path], Iterable[Path]]
) -> None:
    """Refuse stores of one command in one another, around its cache, or where reports are written.

    `check_target` and `check_folder` refuse those that are there already. `beside` returns the
    paths that the report of a store writes to, which may be a store that is there, too.
    """
    places = {real_place(path): path for path in stores}
    for path in places.values():
        for written in beside(path):
            if real_place(written) in places or is_store(written):
                reason = f"whose report would be written into the store {str(written)!r}"
                raise _wrong("store", path, f"{reason}; give another path")
    for key, path in (("cache", Path(cache)), *(("store", path) for path in places.values())):
        place = real_place(path)
        around = [place, *place.parents][key == "store" :]
        if store := next((places[one] for one in around if one in places), None):
            raise _wrong(key, path, f"but must not be in the store {str(store)!r}")


def is_store(folder: Path) -> bool:
    """Return whether a folder is a zarr store or part of one."""
    return any((folder / name).is_file() for name in OF_ZARR)


def _wrong(key: str, path: str | Path, reason: str) -> ConfigurationError:
    return ConfigurationError(f"{key} is {str(path)!r}, {reason}")


def _checked_place(key: str, path: str | Path, *, inside: bool) -> Path:
    """Return the real path; refuse a URL, an impossible name, or a folder that cannot be written.

    That is the folder of this path, or the one that it is `inside`.
    """
    if _URL.match(str(path)):
        raise _wrong(key, path, "but must be a folder on a file system: URLs are not supported")
    try:
        place = real_place(Path(path))
        with suppress(FileNotFoundError, NotADirectoryError):
            os.lstat(hidden(place, PARTIAL) if place.name else place)  # the longest name beside it
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise _wrong(key, path, f"which cannot be used: {reason}") from error
    for link in (Path(path), *Path(path).parents):
        if link.is_symlink() and not link.exists():
            raise _wrong(key, path, f"but {str(link)!r} is a link to nothing")
    if not str(path) or not place.name:
        raise _wrong(key, path, "but must be the name of a folder")
    around = [place, *place.parents][inside:]
    if store := next(filter(is_store, around), None):
        raise _wrong(key, path, f"but must not be in the store {str(store)!r}")
    nearest = next(part for part in around if part.exists())
    if not nearest.is_dir():
        raise _wrong(key, path, f"but {str(nearest)!r} is not a folder")
    try:
        tempfile.TemporaryFile(dir=nearest).close()
    except OSError as error:
        reason = f"but nothing can be written in {str(nearest)!r}: {error.strerror}"
        raise _wrong(key, path, reason) from error
    return place


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold the lock of a store, which need not exist; remove leftovers of killed writers.

    The lock is a file beside the store, locked by the operating system, which releases it when
    the process that holds it ends in any way. It is advisory, and holds between the nodes
    of a cluster only if its file system has `flock` across them. ConfigurationError if another
    process or thread holds it, or locking fails.
    """
    place = real_place(path)
    file = _lock_of(place)
    try:
        make_folder(place.parent, OPEN)
        held = _acquire(file)
    except BlockingIOError:
        raise ConfigurationError(
            f"store is {str(path)!r}, which is being written by {_holder(file)}; "
            "wait until it ends or give another path"
        ) from None
    except OSError as error:
        raise ConfigurationError(
            f"store is {str(path)!r}, but {str(file)!r} cannot be locked: {error.strerror}"
        ) from error
    try:
        since = datetime.now(UTC).isoformat(timespec="seconds")
        holder = {"pid": os.getpid(), "host": socket.gethostname(), "since": since}
        file.write_text(json.dumps(holder))
        _remove_orphans(place)
        yield
    finally:
        # Removed while locked: the next process to acquire it notices that it is gone.
        file.unlink(missing_ok=True)
        os.close(held)


def is_locked(path: Path) -> bool:
    """Return whether a process holds the lock of a store."""
    try:
        with open(_lock_of(real_place(path)), "rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True
    return False


def _lock_of(place: Path) -> Path:
    return place.with_name(f".{place.name}.lock")


def _acquire(file: Path) -> int:
    """Return the descriptor of a locked file; raise BlockingIOError if another holds it."""
    while True:
        descriptor = os.open(file, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.fstat(descriptor).st_nlink:
                return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)  # its holder removed it before releasing it


def _holder(file: Path) -> str:
    """Return a description of the holder of a lock."""
    try:
        holder = json.loads(file.read_bytes())
        return f"process {holder['pid']} on {holder['host']} since {holder['since']}"
    except (OSError, ValueError):
        return "another process"  # which has not signed yet, or has just ended


def _remove_orphans(place: Path) -> None:
    """Remove leftovers of killed writers beside a path; restore a folder set aside if needed."""
    pattern = re.compile(rf"\.{re.escape(place.name)}\.[0-9a-f]{{32}}\.({PARTIAL}|{ASIDE})")
    for found in sorted(place.parent.iterdir()):
        match = pattern.fullmatch(found.name)
        if match and match[1] == ASIDE and not os.path.lexists(place):
            found.rename(place)
        elif match:
            remove_folder(found)


def hidden(place: Path, suffix: str) -> Path:
    """Return a new, unique hidden name beside a path."""
    return place.with_name(f".{place.name}.{uuid.uuid4().hex}.{suffix}")


def remove_folder(folder: Path) -> None:
    """Remove a folder and its contents, as far as possible."""
    shutil.rmtree(folder, ignore_errors=True)


def put_in_place(partial: Path, place: Path) -> None:
    """Move a folder to its place; the previous one, if any, is then at `partial`.

    Readers see the old folder or the new one at any time; if the file system cannot exchange
    two folders, they see none for a moment.
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
    """Exchange two folders atomically; return False if that is not supported."""
    renameat2 = getattr(ctypes.CDLL(None), "renameat2", None)  # which only Linux has
    given = _HERE, os.fsencode(one), _HERE, os.fsencode(other), ctypes.c_uint(_EXCHANGE)
    return renameat2 is not None and renameat2(*given) == 0


def write_file(file: Path, content: bytes) -> int:
    """Write a file, with any folders that it needs, and return its checksum.

    Others may read it as far as the umask lets them, and never write it.
    """
    make_folder(file.parent, OPEN)
    with open(file, "wb", opener=lambda name, flags: os.open(name, flags, READABLE)) as opened:
        opened.write(content)
    return zlib.crc32(content)


def read_manifest(path: Path) -> dict[str, int]:
    """Return the checksum of every file of a store, by name relative to it.

    Raises ConfigurationError if the manifest is missing or damaged, and OSError if it cannot be
    read for want of descriptors or memory.
    """
    try:
        files = unseal((path / MANIFEST).read_bytes())
        return {str(name): int(checksum) for name, checksum in files.items()}
    except (OSError, ValueError, TypeError, AttributeError) as error:
        raise_shortage(error)
        raise ConfigurationError(
            f"store is {str(path)!r}, whose {MANIFEST} cannot be read; "
            "give another path, or remove it if it is a damaged store"
        ) from error


def verify(path: Path, groups: Iterable[str] | None = None) -> list[str]:
    """Return sorted names of files of a store that are missing, changed or unexpected.

    A file that is not in the manifest counts as damage, because zarr would read it as a chunk. If
    `groups` are given, only their files and all metadata are verified. Raises OSError where files
    cannot be read for want of descriptors or memory.
    """
    files = read_manifest(path)
    inside = tuple(f"{group}/" for group in groups or ())
    return sorted(
        name
        for name in {*files, *_names(path)}
        if groups is None or name.startswith(inside) or name.endswith(METADATA)
        if name not in files or _checksum(path / name) != files[name]
    )


def _names(path: Path) -> Iterator[str]:
    """Yield files of a store, and links to folders, by name relative to it."""
    for folder, inner, files in os.walk(path, onerror=raise_shortage):
        links = (one for one in inner if os.path.islink(f"{folder}/{one}"))
        for file in (*files, *links):
            name = f"{folder}/{file}"[len(str(path)) + 1 :]
            if name != MANIFEST:
                yield name


def _checksum(file: Path) -> int | None:
    """Return the checksum of a file; None if it cannot be read."""
    with undamaged():
        return zlib.crc32(file.read_bytes())
    return None

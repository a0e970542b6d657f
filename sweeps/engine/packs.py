"""Packs: files on disk, each with finished results of many cells; and which pack has which cell.

A pack has two sealed lines, one with its stage, the keys of its cells and the time that they took,
one with the place, checksum and layout of each, followed by the records: the arrays of a cell, one
after another. Packs and their folders are made for this user alone, and folders of other users are
not read.
"""

from __future__ import annotations

import errno
import json
import os
import re
import time
import uuid
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from time import time_ns
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

ROOM = "cells"
ALIGNED = 16  # bytes: arrays begin at multiples of this in a record
PRIVATE = 0o700  # mode of the folders of a cache

# Errors of this process or machine, not of a file: what they hide is not damaged.
SHORTAGES = frozenset({errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EAGAIN, errno.EINTR})

Arrays = dict[str, NDArray[Any]]


class Spot(NamedTuple):
    """A finished cell on disk: path of its pack, its row there, and its key."""

    path: str
    row: int
    key: str


def seal(document: Any) -> bytes:
    """Return a line of bytes of a JSON document, which begins with its checksum."""
    text = json.dumps(document, separators=(",", ":")).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def unseal(line: bytes) -> Any:
    """Return the document of a line made by `seal`; raise ValueError if the line was changed."""
    text = line[9:-1]
    if line != b"%08x %s\n" % (zlib.crc32(text), text):
        raise ValueError("its checksum differs")
    return json.loads(text)


@dataclass(frozen=True)
class Pack:
    """A file of finished cells: path relative to its folder, bytes, keys in the order of rows."""

    path: str
    size: int = 0
    keys: tuple[str, ...] = ()
    stage: str = "(unreadable)"
    seconds: float = 0.0  # that all cells took


def write_pack(
    folder: Path,
    stage: str,
    cells: Sequence[tuple[str, Mapping[str, NDArray[Any]]]],
    seconds: float = 0.0,
) -> Pack:
    """Write cells, given by key (32 hexadecimal digits), to a new file below a folder.

    If this fails, nothing of the file is left. TypeError if an array holds objects, fields or
    strings of variable width.
    """
    layouts: dict[Any, int] = {}
    rows, records, end = [], [], 0
    for _, outputs in cells:
        layout, record = _record(outputs)
        number = layouts.setdefault(layout, len(layouts))
        rows.append((end, len(record), zlib.crc32(record), number))
        records.append(record)
        end += len(record)
    keys = tuple(key for key, _ in cells)
    header = seal([stage, seconds, keys]) + seal([rows, list(layouts)])
    # A name begins with the time, so that the newest of equal cells is known.
    path = f"{ROOM}/{time_ns():016x}{uuid.uuid4().hex[:16]}.pack"
    write_whole(folder, path, (header, *records))
    return Pack(path, len(header) + end, keys, stage, seconds)


def _record(outputs: Mapping[str, NDArray[Any]]) -> tuple[Any, bytes]:
    """Return name, dtype, shape and offset of each array of a cell, and the bytes of all."""
    layout, record = [], bytearray()
    for name, values in outputs.items():
        array = np.asarray(values)
        layout.append((name, _plain(array.dtype).str, array.shape, len(record)))
        record += array.tobytes() + bytes(-array.nbytes % ALIGNED)
    return tuple(layout), bytes(record)


@cache
def _plain(code: str | np.dtype[Any]) -> np.dtype[Any]:
    """Return a dtype; TypeError unless the bytes of an array are its values: no pointers."""
    dtype = np.dtype(code)
    if dtype.hasobject or dtype.names or dtype.subdtype:
        raise TypeError(f"arrays of dtype {dtype} cannot be kept")
    return dtype


def make_folder(path: Path, mode: int) -> None:
    """Make a folder and its missing parents, with at most this mode; the umask may say less."""
    if path.is_dir():
        return
    for part in reversed((path, *path.parents)):
        if not part.is_dir():
            with suppress(FileExistsError):  # made by another process just now
                part.mkdir(mode)


def is_own(file: Path) -> bool:
    """Return whether a file or folder belongs to the user of this process.

    Another user might have written anything into it.
    """
    return not hasattr(os, "geteuid") or os.stat(file).st_uid == os.geteuid()


def write_whole(folder: Path, path: str, parts: Iterable[bytes]) -> None:
    """Write a file of a folder under another name first, so that readers see all or nothing."""
    partial = folder / ROOM / f"{uuid.uuid4().hex}.partial"
    make_folder(partial.parent, PRIVATE)
    try:
        with open(partial, "xb", opener=lambda name, flags: os.open(name, flags, 0o600)) as file:
            file.writelines(parts)
        partial.replace(folder / path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise


@contextmanager
def undamaged() -> Iterator[None]:
    """Suppress errors of absent or damaged files, but not of a process that lacks something."""
    try:
        yield
    except Exception as error:
        raise_shortage(error)


def raise_shortage(error: Exception) -> None:
    """Raise an error of the process or the machine, which says nothing about a file."""
    if isinstance(error, MemoryError) or getattr(error, "errno", None) in SHORTAGES:
        raise error


def read_cells(folder: Path, requests: Sequence[Spot]) -> list[Arrays | None]:
    """Return outputs of cells; open each pack once.

    None for a cell that is absent, is another than that of its key, or differs from its checksum;
    no content of a file makes it raise. Arrays are writable and share no element.

    Raises
    ------
    OSError
        If this process or machine lacks something, such as file descriptors.
    """
    found: list[Arrays | None] = [None] * len(requests)
    places: dict[str, list[tuple[int, int, str]]] = defaultdict(list)
    for place, (path, row, key) in enumerate(requests):
        places[path].append((row, place, key))
    for path, wanted in places.items():
        with undamaged(), (folder / path).open("rb") as file:
            (_, _, keys), (rows, layouts) = unseal(file.readline()), unseal(file.readline())
            first, last = file.tell(), os.fstat(file.fileno()).st_size
            for row, place, key in sorted(wanted):
                start, size, checksum, layout = rows[row]
                if keys[row] != key or first + start + size > last:
                    continue
                # Memory of its own for each cell: arrays are aligned, writable and apart.
                record = np.empty(size, dtype=np.uint8)
                file.seek(first + start)
                whole = file.readinto(record) == size  # type: ignore[arg-type]
                if whole and zlib.crc32(record.data) == checksum:
                    found[place] = {
                        name: np.ndarray(shape, _plain(code), record, offset)
                        for name, code, shape, offset in layouts[layout]
                    }
    return found


def described_pack(folder: Path, path: str, size: int) -> Pack:
    """Return what the first line of a pack says of it; no cells, if that cannot be read."""
    with undamaged(), (folder / path).open("rb") as file:
        stage, seconds, keys = unseal(file.readline())
        if not (seconds >= 0 and all(isinstance(key, str) for key in keys)):
            raise ValueError("it is not a pack")
        return Pack(path, size, tuple(keys), str(stage), seconds)
    return Pack(path, size)


def files_of(folder: Path, kind: str) -> dict[str, os.stat_result]:
    """Return status of the packs, or partial files, of a folder, by path relative to it."""
    found: dict[str, os.stat_result] = {}
    with undamaged(), os.scandir(folder / ROOM) as entries:
        for entry in entries:
            if re.fullmatch(rf"[0-9a-f]{{32}}\.{kind}", entry.name) and entry.is_file():
                with suppress(FileNotFoundError):  # deleted by another process just now
                    found[f"{ROOM}/{entry.name}"] = entry.stat()
    return found


# the cells of a folder ----------------------------------------------------------------------------


ORPHANED = 86400.0  # s, after which a partial file counts as abandoned
RECENT = 10  # packs of a stage, whose costs count


class CellIndex:
    """Packs of a folder, which may be absent, by path; `say` is called with a warning.

    No method raises for damage or a full disk.
    """

    def __init__(self, folder: Path, say: Callable[[str], None]) -> None:
        self.folder = folder
        self._say = say
        self.packs: dict[str, Pack] = {}
        self._spots: dict[str, Spot] = {}
        with suppress(OSError):
            if not is_own(folder):
                say(f"Results in {folder} are not read: the folder belongs to another user.")
                return
        for path, status in sorted(files_of(folder, "pack").items()):  # in the order of their time
            self.add(described_pack(folder, path, status.st_size))
        if lost := sum(not pack.keys for pack in self.packs.values()):
            say(f"results in the cache are damaged (files: {lost:,})")

    def find(self, keys: Sequence[str]) -> dict[str, Spot]:
        """Return the spot of each key found, the newest of equal ones."""
        return {key: self._spots[key] for key in keys if key in self._spots}

    def add(self, pack: Pack) -> None:
        """Record a new pack."""
        self.packs[pack.path] = pack
        self._spots |= {key: Spot(pack.path, row, key) for row, key in enumerate(pack.keys)}

    def forget(self, keys: Iterable[str]) -> None:
        """Drop keys of damaged cells, including older copies; packs stay."""
        for key in keys:
            self._spots.pop(key, None)

    def costs(self) -> dict[str, tuple[float, float]]:
        """Return seconds and bytes per cell by stage: means of the latest packs."""
        latest: dict[str, list[Pack]] = defaultdict(list)
        for pack in self.packs.values():
            if pack.keys:
                latest[pack.stage].append(pack)
        sums = {
            stage: [(len(one.keys), one.seconds, one.size) for one in packs[-RECENT:]]
            for stage, packs in latest.items()
        }
        totals = {stage: list(map(sum, zip(*of, strict=True))) for stage, of in sums.items()}
        return {stage: (spent / n, size / n) for stage, (n, spent, size) in totals.items()}

    def used(self, paths: Iterable[str]) -> None:
        """Mark packs, by path, as used now."""
        for path in set(paths):
            with suppress(OSError):
                os.utime(self.folder / path)

    def size(self) -> tuple[int, int]:
        """Return the number of cells and of bytes."""
        packs = self.packs.values()
        return sum(len(pack.keys) for pack in packs), sum(pack.size for pack in packs)

    def shrink(self, limit_bytes: int, keep_since: float) -> None:
        """Delete the least recently used packs until the rest is small enough.

        Those used since a time (s, epoch) stay. Partial files older than a day are deleted, too.
        """
        stale = time.time() - ORPHANED
        partials = files_of(self.folder, "partial").items()
        self._delete(path for path, status in partials if status.st_mtime < stale)
        packs = files_of(self.folder, "pack")
        excess = sum(status.st_size for status in packs.values()) - limit_bytes
        for path in sorted(packs, key=lambda path: (packs[path].st_mtime, path)):
            if excess <= 0 or packs[path].st_mtime >= keep_since or not self._delete([path]):
                break
            excess -= packs[path].st_size

    def clear(self) -> None:
        """Delete all packs, and nothing else in the folder."""
        if self._delete([*files_of(self.folder, "pack"), *files_of(self.folder, "partial")]):
            with suppress(OSError):  # another process writes there
                (self.folder / ROOM).rmdir()

    def _delete(self, paths: Iterable[str]) -> bool:
        """Delete files of the folder; return False, after a warning, if one cannot be deleted."""
        try:
            for path in paths:
                (self.folder / path).unlink(missing_ok=True)
                for key in self.packs.pop(path, Pack(path)).keys:
                    if self._spots.get(key, ("",))[0] == path:
                        del self._spots[key]
        except OSError as error:
            self._say(f"Finished results in {self.folder} cannot be deleted ({error}).")
            return False
        return True

"""Packs: files on disk, each with finished results of many cells; and which pack has which cell.

A pack has a sealed line with its stage, the time that its cells took and the layouts of their
arrays, then the keys of the cells, and the place, checksum and layout of each, and then the
records: the arrays of a cell, one after another. Packs and their folders are made for this user
alone, and folders of other users are not read.
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
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from time import time_ns
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.keys import Keys
from sweeps.engine.places import make_folder

ROOM = "cells"
ALIGNED = 16  # bytes: arrays begin at multiples of this in a record
MISSING = -1  # instead of the number of a pack
PRIVATE = 0o700  # mode of the folders of a cache
KEY = np.dtype(("<u8", 2))
ROW = np.dtype([("start", "<u8"), ("size", "<u8"), ("checksum", "<u4"), ("layout", "<u4")])

# Errors of this process or machine, not of a file: what they hide is not damaged.
SHORTAGES = frozenset({errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EAGAIN, errno.EINTR})

Arrays = dict[str, NDArray[Any]]
Numbers = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Spots:
    """Where cells are on disk: arrays of one shape, of which an index takes some.

    Paths of packs; which of them has each cell, negative if none; its row there; and its key, on a
    further axis of two.
    """

    paths: Sequence[str]
    pack: Numbers
    row: Numbers
    keys: Keys

    def __getitem__(self, index: Any) -> Spots:
        pack, row = np.asarray(self.pack[index]), np.asarray(self.row[index])
        return Spots(self.paths, pack, row, self.keys[index])

    def __len__(self) -> int:
        return len(self.pack)

    @property
    def present(self) -> NDArray[np.bool_]:
        """Whether each cell is on disk."""
        return self.pack >= 0

    def alone(self) -> Spots:
        """Return the same with no further paths, to be sent away."""
        used, pack = np.unique(self.pack, return_inverse=True)
        absent = int((used < 0).sum())
        pack = np.maximum(pack.reshape(self.pack.shape) - absent, MISSING)
        paths = [self.paths[number] for number in used[absent:].tolist()]
        return replace(self, paths=paths, pack=pack.astype(np.int32))


NO_SPOTS = Spots((), np.empty(0, np.int32), np.empty(0, np.int32), np.empty((0, 2), np.uint64))


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
    """A file of finished cells: path relative to its folder, bytes, number of cells."""

    path: str
    size: int = 0
    cells: int = 0
    stage: str = "(unreadable)"
    seconds: float = 0.0  # that all cells took


@dataclass
class Packing:
    """A pack that is being made: the records of its cells so far."""

    layouts: dict[Any, int] = field(default_factory=dict)
    rows: list[tuple[int, int, int, int]] = field(default_factory=list)
    records: list[bytes] = field(default_factory=list)
    end: int = 0

    def add(self, outputs: Mapping[str, NDArray[Any]]) -> None:
        """Add a cell; TypeError if an array holds objects, fields or texts of variable width."""
        layout, parts, size = [], [], 0
        for name, values in outputs.items():
            array = np.asarray(values)
            layout.append((name, _code(array.dtype), array.shape, size))
            parts.append(array.tobytes() + bytes(-array.nbytes % ALIGNED))
            size += len(parts[-1])
        record = b"".join(parts)
        number = self.layouts.setdefault(tuple(layout), len(self.layouts))
        self.rows.append((self.end, size, zlib.crc32(record), number))
        self.records.append(record)
        self.end += size

    def write(self, folder: Path, stage: str, keys: Keys, seconds: float = 0.0) -> Pack:
        """Write the cells, whose keys are (cell, 2), to a new file below a folder.

        If this fails, nothing of the file is left.
        """
        tables = keys.astype(KEY.base).tobytes(), np.array(self.rows, ROW).tobytes()
        line = seal([stage, seconds, len(keys), [*map(zlib.crc32, tables)], list(self.layouts)])
        # A name begins with the time, so that the newest of equal cells is known.
        path = f"{ROOM}/{time_ns():016x}{uuid.uuid4().hex[:16]}.pack"
        write_whole(folder, path, (line, *tables, *self.records))
        size = len(line) + sum(map(len, tables)) + self.end
        return Pack(path, size, len(keys), stage, seconds)


@cache
def _code(dtype: np.dtype[Any]) -> str:
    """Return the code of a dtype, as `_plain` reads it."""
    return _plain(dtype).str


@cache
def _plain(code: str | np.dtype[Any]) -> np.dtype[Any]:
    """Return a dtype; TypeError unless the bytes of an array are its values: no pointers."""
    dtype = np.dtype(code)
    if dtype.hasobject or dtype.names or dtype.subdtype:
        raise TypeError(f"arrays of dtype {dtype} cannot be kept")
    return dtype


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


def _table(file: IO[bytes], cells: int, dtype: np.dtype[Any], checksum: int) -> NDArray[Any]:
    """Return the next table of a pack, with a row for each cell; ValueError if it was changed."""
    content = file.read(min(cells * dtype.itemsize, os.fstat(file.fileno()).st_size))
    if zlib.crc32(content) != checksum or len(content) != cells * dtype.itemsize:
        raise ValueError("its checksum differs")
    return np.frombuffer(content, dtype.base).reshape(cells, *dtype.shape)


def read_cells(folder: Path, spots: Spots) -> list[Arrays | None]:
    """Return outputs of some cells, (cell,); open each pack once.

    None for a cell that is absent, is another than that of its key, or differs from its checksum;
    no content of a file makes it raise. Arrays are writable and share no element.

    Raises
    ------
    OSError
        If this process or machine lacks something, such as file descriptors.
    """
    found: list[Arrays | None] = [None] * len(spots)
    order = np.lexsort((spots.row, spots.pack))
    order = order[spots.pack[order] >= 0]
    begins = np.flatnonzero(np.diff(spots.pack[order], prepend=-1))
    for places in np.split(order, begins[1:]) if order.size else ():
        wanted, path = spots.row[places], spots.paths[spots.pack[places[0]]]
        with undamaged(), (folder / path).open("rb") as file:
            _, _, cells, (of_keys, of_rows), layouts = unseal(file.readline())
            keys, rows = _table(file, cells, KEY, of_keys), _table(file, cells, ROW, of_rows)
            first, last = file.tell(), os.fstat(file.fileno()).st_size
            inside = np.flatnonzero(wanted < cells)
            right = inside[(keys[wanted[inside]] == spots.keys[places[inside]]).all(axis=1)]
            for place, row in zip(places[right].tolist(), wanted[right].tolist(), strict=True):
                start, size, checksum, layout = rows[row].tolist()
                if first + start + size > last:
                    continue
                # Memory of its own for each cell: arrays are aligned, writable and apart.
                record = np.empty(size, dtype=np.uint8)
                file.seek(first + start)
                whole = file.readinto(record) == size
                if whole and zlib.crc32(record.data) == checksum:
                    found[place] = {
                        name: np.ndarray(shape, _plain(code), record, offset)
                        for name, code, shape, offset in layouts[layout]
                    }
    return found


def described_pack(folder: Path, path: str, size: int) -> tuple[Pack, Keys]:
    """Return what a pack says of itself, and its keys; no cells, if that cannot be read."""
    with undamaged(), (folder / path).open("rb") as file:
        stage, seconds, cells, (of_keys, _), _ = unseal(file.readline())
        keys = _table(file, cells, KEY, of_keys)
        if not seconds >= 0:
            raise ValueError("it is not a pack")
        return Pack(path, size, cells, str(stage), seconds), keys
    return Pack(path, size), np.empty((0, 2), np.uint64)


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
AT_ONCE = 2**20  # keys that are looked up together


class CellIndex:
    """Packs of a folder, which may be absent, by number; `say` is called with a warning.

    No method raises for damage or a full disk.
    """

    def __init__(self, folder: Path, say: Callable[[str], None]) -> None:
        self.folder = folder
        self._say = say
        self.packs: list[Pack] = []
        self.paths: list[str] = []  # of all packs, by number
        self._new: dict[int, Keys | None] = {}  # keys of packs not yet in what follows, if read
        # All cells, sorted by the first half of their key, the newest of equal ones last.
        self._spots = replace(NO_SPOTS, paths=self.paths)
        with suppress(OSError):
            if not is_own(folder):
                say(f"Results in {folder} are not read: the folder belongs to another user.")
                return
        for path, status in sorted(files_of(folder, "pack").items()):  # in the order of their time
            self.add(*described_pack(folder, path, status.st_size))
        if lost := sum(not pack.cells for pack in self.packs):
            say(f"results in the cache are damaged (files: {lost:,})")

    def add(self, pack: Pack, keys: Keys | None = None) -> int:
        """Record a new pack; return its number. Its cells are found after the next `refresh`."""
        number = len(self.packs)
        self.packs.append(pack)
        self.paths.append(pack.path)
        self._new[number] = keys
        return number

    def refresh(self) -> None:
        """Let `find` know the cells of packs that were added."""
        if not self._new:
            return
        keys, packs, rows = [self._spots.keys], [self._spots.pack], [self._spots.row]
        for number, known in self._new.items():
            pack = self.packs[number]
            if known is None:
                _, known = described_pack(self.folder, pack.path, pack.size)
            keys.append(known)
            packs.append(np.full(len(known), number, np.int32))
            rows.append(np.arange(len(known), dtype=np.int32))
        self._new.clear()
        every = np.concatenate(keys)
        del keys
        order = np.argsort(every[:, 0], kind="stable")
        # Each half is searched on its own.
        halves = [np.ascontiguousarray(every[:, half])[order] for half in range(2)]
        del every
        of_pack, row = np.concatenate(packs)[order], np.concatenate(rows)[order]
        self._spots = Spots(self.paths, of_pack, row, np.array(halves).T)

    def find(self, keys: Keys) -> Spots:
        """Return where the cells of some keys, (cell, 2), are: the newest of equal ones.

        A later one whose key has the same first half hides another: by chance once in 10^19 pairs.
        """
        pack, row = np.full((2, len(keys)), MISSING, dtype=np.int32)
        known = self._spots
        for start in range(0, len(keys) if len(known) else 0, AT_ONCE):
            asked = keys[start : start + AT_ONCE]
            order = np.argsort(asked[:, 0])  # neighbours are found faster
            at = np.searchsorted(known.keys[:, 0], asked[order, 0], side="right") - 1
            right = (at >= 0) & (known.keys[at] == asked[order]).all(axis=1)
            pack[start + order] = np.where(right, known.pack[at], MISSING)
            row[start + order] = known.row[at]
        return Spots(self.paths, pack, row, keys)

    def forget(self, keys: Keys) -> None:
        """Drop keys of damaged cells, (cell, 2), including older copies; packs stay."""
        self.refresh()
        for key in keys:
            first, last = np.searchsorted(self._spots.keys[:, 0], [key[0], key[0] + np.uint64(1)])
            same = (self._spots.keys[first:last] == key).all(axis=1)
            self._spots.pack[first:last][same] = MISSING

    def costs(self) -> dict[str, tuple[float, float]]:
        """Return seconds and bytes per cell by stage: means of the latest packs."""
        latest: dict[str, list[Pack]] = defaultdict(list)
        for pack in self.packs:
            if pack.cells:
                latest[pack.stage].append(pack)
        sums = {
            stage: [(one.cells, one.seconds, one.size) for one in packs[-RECENT:]]
            for stage, packs in latest.items()
        }
        totals = {stage: list(map(sum, zip(*of, strict=True))) for stage, of in sums.items()}
        return {stage: (spent / n, size / n) for stage, (n, spent, size) in totals.items()}

    def used(self, packs: Iterable[int]) -> None:
        """Mark packs, by number, as used now."""
        for number in set(packs) - {MISSING}:
            with suppress(OSError):
                os.utime(self.folder / self.paths[number])

    def size(self) -> tuple[int, int]:
        """Return the number of cells and of bytes."""
        return sum(pack.cells for pack in self.packs), sum(pack.size for pack in self.packs)

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
                if path in self.paths:
                    number = self.paths.index(path)
                    self.packs[number] = Pack(path)
                    self._new.pop(number, None)
                    self._spots.pack[self._spots.pack == number] = MISSING
        except OSError as error:
            self._say(f"Finished results in {self.folder} cannot be deleted ({error}).")
            return False
        return True

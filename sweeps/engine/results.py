"""Finished results on disk: packs, each a file with results of many cells, and their index.

Their folders and files are made for this user alone, and files of other users are not read.

A pack is a sealed line with its stage, the keys of its cells, the checksums of their records and
their layout, followed by the records: the arrays of a cell, one after another. Everything needed to
cell stands in the packs, and when a pack was last used is the time of its file. The index saves
reading every pack: without it, or if it is damaged, they are read. So nothing is lost with it, and
several processes may use one folder.
"""

from __future__ import annotations

import errno
import json
import math
import os
import re
import time
import uuid
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

ROOM, INDEX = "cells", "cells.index"
ALIGNED = 16  # bytes: arrays begin at multiples of this in a record
UNREADABLE = "(unreadable)"
FORGOTTEN = 32 * "0"  # replaces the key of a damaged cell
PRIVATE = 0o700  # mode of the folders of a cache
ORPHANED = 86400.0  # s, after which a partial file counts as abandoned

# Weight of earlier costs when the next is added: about ten of them matter.
FADING = 0.9

Cell = dict[str, NDArray[Any]]

_NAME = re.compile(r"[0-9a-f]{32}\.(pack|partial)")


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
    size: int
    keys: tuple[str, ...]


def write_pack(
    folder: Path, stage: str, cells: Sequence[tuple[str, Mapping[str, NDArray[Any]]]]
) -> Pack:
    """Write cells, given by key (32 hexadecimal digits), to a new file below a folder.

    If this fails, nothing of the file is left. TypeError if an array holds objects, fields or
    strings of variable width.
    """
    layouts: dict[Any, int] = {}
    described = [_record(outputs) for _, outputs in cells]
    records = [record for _, record in described]
    keys = tuple(key for key, _ in cells)
    layout_of = [layouts.setdefault(layout, len(layouts)) for layout, _ in described]
    document = {
        "stage": stage,
        "keys": keys,
        "checksums": list(map(zlib.crc32, records)),
        "layout_of": layout_of,
        "layouts": list(layouts),
    }
    header = seal(document)
    # A name begins with the time, so that the newest of equal cells is known.
    path = f"{ROOM}/{time.time_ns():016x}{uuid.uuid4().hex[:16]}.pack"
    write_whole(folder, path, (header, *records))
    return Pack(path, len(header) + sum(map(len, records)), keys)


def _record(outputs: Mapping[str, NDArray[Any]]) -> tuple[Any, bytes]:
    """Return name, dtype and shape of each array of a cell, and the bytes of all."""
    layout, parts = [], []
    for name, values in outputs.items():
        array = np.asarray(values)
        if array.dtype.hasobject or array.dtype.names:
            raise TypeError(
                f"output {name} has dtype {array.dtype}, but must be of numbers, truth values, "
                "times or strings of fixed width"
            )
        layout.append((name, array.dtype.str, array.shape))
        parts += [array.tobytes(), bytes(-array.nbytes % ALIGNED)]
    return tuple(layout), b"".join(parts)


def make_folder(path: Path, mode: int) -> None:
    """Make a folder and its missing parents, with at most this mode; the umask may say less."""
    for part in reversed((path, *path.parents)):
        if not part.is_dir():
            with suppress(FileExistsError):  # made by another process just now
                part.mkdir(mode)


def is_own(file: int | Path) -> bool:
    """Return whether a file, given by its path or descriptor, belongs to the user of this process.

    Another user might have written anything into it.
    """
    return not hasattr(os, "geteuid") or os.stat(file).st_uid == os.geteuid()


def write_whole(folder: Path, path: str, parts: Iterable[bytes]) -> None:
    """Write a file of a folder under another name first, so that readers see all or nothing."""
    partial = folder / ROOM / f"{uuid.uuid4().hex}.partial"
    make_folder(partial.parent, PRIVATE)
    try:
        with open(partial, "xb", opener=_private) as file:
            file.writelines(parts)
        partial.replace(folder / path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise


def _private(name: str, flags: int) -> int:
    """Open a new file that others may neither read nor write."""
    return os.open(name, flags, 0o600)


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    """Open a file to read it; raise PermissionError if it is another user's."""
    with path.open("rb") as file:
        if not is_own(file.fileno()):
            raise PermissionError(errno.EPERM, "belongs to another user", str(path))
        yield file


def read_cells(folder: Path, requests: Sequence[tuple[str, int]]) -> list[Cell | None]:
    """Return outputs of cells, given by path of a pack and row in it; open each pack once.

    None for a cell that is absent, differs from its checksum or is in a file of another user; no
    content of a file makes it raise. Arrays are writable and share no element.
    """
    found: list[Cell | None] = [None] * len(requests)
    places: dict[str, list[tuple[int, int]]] = defaultdict(list)
    for place, (path, row) in enumerate(requests):
        places[path].append((row, place))
    for path, wanted in places.items():
        with suppress(Exception), _opened(folder / path) as file:
            header = unseal(file.readline())
            layouts = list(map(_laid_out, header["layouts"]))
            of = header["layout_of"]
            starts = list(accumulate((layouts[number][1] for number in of), initial=file.tell()))
            for row, place in sorted(wanted):
                layout, size = layouts[of[row]]
                # Memory of its own for each cell: arrays are aligned, writable and apart.
                record = np.empty(size, dtype=np.uint8)
                file.seek(starts[row])
                whole = file.readinto(record) == size  # type: ignore[arg-type]
                if whole and zlib.crc32(record.data) == header["checksums"][row]:
                    found[place] = {
                        name: np.ndarray(shape, dtype, record, start)
                        for name, shape, dtype, start in layout
                    }
    return found


def _laid_out(described: Any) -> tuple[list[tuple[Any, ...]], int]:
    """Return name, shape, dtype and offset of each array, and the size of the record [byte]."""
    layout, place = [], 0
    for name, code, shape in described:
        layout.append((name, tuple(shape), np.dtype(code), place))
        size = np.dtype(code).itemsize * math.prod(shape)
        place += size + -size % ALIGNED
    return layout, place


def list_files(folder: Path) -> tuple[set[str], set[str]]:
    """Return paths of all packs of a folder and of partial files, relative to it."""
    packs: set[str] = set()
    partials: set[str] = set()
    with suppress(OSError), os.scandir(folder / ROOM) as entries:
        for entry in entries:
            if _NAME.fullmatch(entry.name) and entry.is_file():
                into = packs if entry.name.endswith(".pack") else partials
                into.add(f"{ROOM}/{entry.name}")
    return packs, partials


class Kept(NamedTuple):
    """Stored results of a stage: number of cells, and bytes."""

    stage: str
    cells: int
    bytes: int


Known = tuple[str, int, Sequence[str]]  # stage of a pack, its bytes, and keys of its cells


@contextmanager
def open_index(folder: Path, say: Callable[[str], None]) -> Iterator[CellIndex]:
    """Open the index of a folder, which may be absent; `say` is called with a warning."""
    index = CellIndex(folder, say)
    try:
        yield index
    finally:
        index.save()


class CellIndex:
    """Index of the packs of a folder. No method raises for damage or a full disk."""

    def __init__(self, folder: Path, say: Callable[[str], None]) -> None:
        self.folder = folder
        self._say = say
        self._changed = False
        self._costs: dict[str, list[float]] = {}
        known: dict[str, Known] = {}
        # It may be absent, damaged or another user's.
        with suppress(OSError, ValueError), _opened(folder / INDEX) as file:
            self._costs, known = _checked_index(unseal(file.read()))
        packs: dict[str, Known] = {}
        for path in sorted(list_files(folder)[0]):  # in the order of their time
            with suppress(FileNotFoundError):  # deleted by another process just now
                packs[path] = known.get(path) or _described(folder / path)
        self._set(packs)

    def _set(self, packs: dict[str, Known]) -> None:
        self._packs = packs
        self._spots = {
            key: (path, row) for path, (_, _, keys) in packs.items() for row, key in enumerate(keys)
        }

    def save(self) -> None:
        """Write the index file, if it has changed."""
        if self._changed:
            with suppress(OSError):
                write_whole(self.folder, INDEX, [seal([self._costs, self._packs])])

    def find(self, keys: Sequence[str]) -> dict[str, tuple[str, int]]:
        """Return the pack's path and row of each key found, the newest of equal ones."""
        return {key: self._spots[key] for key in keys if key in self._spots}

    def add(self, stage: str, packs: Sequence[Pack], seconds: float) -> None:
        """Record new packs of a stage, and the time [s] that all of them took."""
        cells = sum(len(pack.keys) for pack in packs)
        size = sum(pack.size for pack in packs)
        before = self._costs.get(stage, (0.0, 0.0, 0.0))
        cost = zip(before, (cells, seconds, size), strict=True)
        self._costs[stage] = [FADING * old + new for old, new in cost]
        for pack in packs:
            self._packs[pack.path] = stage, pack.size, pack.keys
            self._spots |= {key: (pack.path, row) for row, key in enumerate(pack.keys)}
        self._changed = True

    def forget(self, keys: Iterable[str]) -> None:
        """Drop keys of damaged cells, including older copies; packs stay."""
        gone = dict.fromkeys(keys, FORGOTTEN)
        self._set(
            {
                path: (stage, size, [gone.get(key, key) for key in there])
                for path, (stage, size, there) in self._packs.items()
            }
        )
        self._changed = True

    def costs(self) -> dict[str, tuple[float, float]]:
        """Return seconds and bytes per cell by stage: means in which older values fade."""
        return {
            stage: (seconds / cells, size / cells)
            for stage, (cells, seconds, size) in self._costs.items()
        }

    def used(self, paths: Iterable[str]) -> None:
        """Mark packs, by path, as used now."""
        for path in set(paths):
            with suppress(OSError):
                os.utime(self.folder / path)

    def summary(self) -> list[Kept]:
        """Return stored results by stage, sorted by name."""
        found: dict[str, Kept] = {}
        for stage, size, keys in self._packs.values():
            before = found.get(stage, Kept(stage, 0, 0))
            found[stage] = Kept(stage, before.cells + len(keys), before.bytes + size)
        return [found[stage] for stage in sorted(found)]

    def shrink(self, limit_bytes: int, keep_since: float) -> None:
        """Delete the least recently used packs until the rest is small enough.

        Those used since a time (s, epoch) stay. Partial files older than a day are deleted, too.
        """
        there, partials = list_files(self.folder)
        self._delete(path for used, path in self._ages(partials) if used < time.time() - ORPHANED)
        packs = {path: known for path, known in self._packs.items() if path in there}
        excess = sum(size for _, size, _ in packs.values()) - limit_bytes
        for used, path in self._ages(packs) if excess > 0 else ():
            if excess <= 0 or used >= keep_since or not self._delete([path]):
                break
            excess -= packs.pop(path)[1]
            self._changed = True
        self._set(packs)

    def clear(self) -> None:
        """Delete all packs and the index, and nothing else in the folder."""
        packs, partials = list_files(self.folder)
        if self._delete([*sorted(packs | partials), INDEX]):
            with suppress(OSError):  # another process writes there
                (self.folder / ROOM).rmdir()
        self._set({})
        self._changed = False

    def _delete(self, paths: Iterable[str]) -> bool:
        """Delete files of the folder; return False, after a warning, if one cannot be deleted."""
        try:
            for path in paths:
                (self.folder / path).unlink(missing_ok=True)
        except OSError as error:
            self._say(f"Finished results in {self.folder} cannot be deleted ({error}).")
            return False
        return True

    def _ages(self, paths: Iterable[str]) -> list[tuple[float, str]]:
        """Return when existing files were last used (s, epoch), oldest first."""
        ages = []
        for path in paths:
            with suppress(OSError):
                ages.append(((self.folder / path).stat().st_mtime, path))
        return sorted(ages)


def _checked_index(document: Any) -> tuple[dict[str, list[float]], dict[str, Known]]:
    """Return the costs and packs of an index file; raise ValueError if it holds anything else."""
    match document:
        case [dict(costs), dict(packs)] if all(map(_is_cost, costs.values())):
            if all(map(_is_known, packs.values())):
                return costs, packs
    raise ValueError("it is not an index")


def _is_cost(found: Any) -> bool:
    match found:
        case [int() | float() as cells, int() | float() as seconds, int() | float() as size]:
            return cells > 0 and min(seconds, size) >= 0 and math.isfinite(cells + seconds + size)
    return False


def _is_known(found: Any) -> bool:
    match found:
        case [str(), int(size), [*keys]]:
            return size >= 0 and all(isinstance(key, str) for key in keys)
    return False


def _described(path: Path) -> Known:
    """Return stage, bytes and keys of a pack from its header."""
    size = path.stat().st_size
    with suppress(OSError, ValueError), _opened(path) as file:
        match unseal(file.readline()):
            case {"stage": str(stage), "keys": [*keys]} if _is_known([stage, size, keys]):
                return stage, size, keys
    # Indexed without cells, so that it is not read each time and can be evicted.
    return UNREADABLE, size, ()

"""Index of finished cells: which pack keeps the cell of a key, and what cells cost.

All that finds a cell stands in the packs themselves, and when a pack was last used is the time of
its file. The index file saves reading every pack: without it, or if it is damaged, they are read.
So nothing is lost with it, and several processes may use one folder.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.packs import KEY, ROOM, Pack, list_files, read_keys, write_whole
from sweeps.engine.sealed import seal, unseal

INDEX = "cells.index"
UNREADABLE = "(unreadable)"
FORGOTTEN = KEY * "0"  # in the place of the key of a cell that proved damaged
ORPHANED = 86400.0  # s, after which nobody writes to a partial file any more
SAVED = 60.0  # s between savings of the index

# What counts of earlier costs when the next is added: about ten of them matter.
FADING = 0.9


class Kept(NamedTuple):
    """What is kept of a stage: number of cells, and bytes."""

    stage: str
    cells: int
    bytes: int


class _Known(NamedTuple):
    """What the index knows of a pack; keys one after another."""

    stage: str
    size: int
    keys: str


class _Table(NamedTuple):
    """Halves of the keys of all packs in the order of the first, and the row of each."""

    first: NDArray[np.uint64]
    second: NDArray[np.uint64]
    rows: NDArray[np.intp]
    ends: NDArray[np.intp]  # of each pack, in rows
    paths: list[str]


@contextmanager
def open_index(folder: Path, say: Callable[[str], None]) -> Iterator[CellIndex]:
    """Index of a folder, which may be absent; `say` takes a sentence about what went wrong."""
    index = CellIndex(folder, say)
    try:
        yield index
    finally:
        index.save()


class CellIndex:
    """Index of the packs of a folder. Neither damage nor a full disk makes a method raise."""

    def __init__(self, folder: Path, say: Callable[[str], None]) -> None:
        self.folder = folder
        self._say = say
        self._changed, self._saved = False, time.monotonic()
        self._costs: dict[str, list[float]] = {}
        known: dict[str, Any] = {}
        with suppress(OSError, ValueError):  # absent or damaged
            self._costs, known = unseal((folder / INDEX).read_bytes())
        self._packs: dict[str, _Known] = {}
        for path in sorted(list_files(folder)[0]):  # in the order of their time
            with suppress(FileNotFoundError):  # deleted by another process just now
                found = known.get(path) or _described(folder / path)
                self._packs[path] = _Known(*found)
        self._added: dict[str, tuple[str, int]] = {}
        self._table: _Table | None = None

    def save(self) -> None:
        """Write the index file, if there is something new."""
        if self._changed:
            with suppress(OSError):
                write_whole(self.folder, INDEX, [seal([self._costs, self._packs])])
        self._changed, self._saved = False, time.monotonic()

    def find(self, keys: Sequence[str]) -> dict[str, tuple[str, int]]:
        """Path of the pack and row of each key that is there, the newest of equal ones."""
        found = {key: self._added[key] for key in keys if key in self._added}
        others = [key for key in keys if key not in found]
        if others:
            table = self._table = self._table or self._tabulate()
            first, second = _halves("".join(others))
            last = table.first.searchsorted(first, side="right") - 1
            there = (table.first[last] == first) & (table.second[last] == second)
            rows = table.rows[last]
            packs = table.ends.searchsorted(rows, side="right")
            rows -= np.append(0, table.ends)[packs]
            for place in np.flatnonzero(there):
                found[others[place]] = table.paths[packs[place]], int(rows[place])
        return found

    def add(self, stage: str, packs: Sequence[Pack], seconds: float) -> None:
        """Record packs of a stage that were written, and the time [s] that all of them took."""
        cells = sum(len(pack.keys) for pack in packs)
        size = sum(pack.size for pack in packs)
        before = self._costs.get(stage, (0.0, 0.0, 0.0))
        cost = zip(before, (cells, seconds, size), strict=True)
        self._costs[stage] = [FADING * old + new for old, new in cost]
        for pack in packs:
            self._packs[pack.path] = _Known(stage, pack.size, "".join(pack.keys))
            self._added |= {key: (pack.path, row) for row, key in enumerate(pack.keys)}
        self._changed = True
        if time.monotonic() > self._saved + SAVED:
            self.save()

    def forget(self, keys: Sequence[str]) -> None:
        """Drop keys whose cells proved damaged; their packs stay until they are evicted."""
        while found := self.find(keys):  # older cells of the same key, too
            for path, row in found.values():
                known = self._packs[path]
                before, after = known.keys[: KEY * row], known.keys[KEY * (row + 1) :]
                self._packs[path] = known._replace(keys=before + FORGOTTEN + after)
            self._added, self._table, self._changed = {}, None, True

    def costs(self) -> dict[str, tuple[float, float]]:
        """Seconds and bytes a cell by stage: means in which older ones fade."""
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
        """What is kept of each stage, by name of the stage."""
        found: dict[str, Kept] = {}
        for stage, size, keys in self._packs.values():
            before = found.get(stage, Kept(stage, 0, 0))
            found[stage] = Kept(stage, before.cells + len(keys) // KEY, before.bytes + size)
        return [found[stage] for stage in sorted(found)]

    def shrink(self, limit_bytes: int, keep_since: float) -> None:
        """Delete the packs not used for longest until the rest is small enough.

        Those used since a time (s, epoch) stay. Partial files older than a day go, too.
        """
        packs, partials = list_files(self.folder)
        old = [path for used, path in self._ages(partials) if used < time.time() - ORPHANED]
        self._delete(old)
        self._packs = {path: known for path, known in self._packs.items() if path in packs}
        excess = sum(known.size for known in self._packs.values()) - limit_bytes
        for used, path in self._ages(self._packs) if excess > 0 else ():
            if excess <= 0 or used >= keep_since or not self._delete([path]):
                break
            excess -= self._packs.pop(path).size
            self._changed = True
        self._added, self._table = {}, None

    def clear(self) -> None:
        """Delete all packs and the index, and nothing else in the folder."""
        packs, partials = list_files(self.folder)
        if self._delete([*sorted(packs | partials), INDEX]):
            with suppress(OSError):  # another process writes there
                (self.folder / ROOM).rmdir()
        self._packs, self._added, self._table, self._changed = {}, {}, None, False

    def _delete(self, paths: Iterable[str]) -> bool:
        """Delete files of the folder; false, and a sentence, if one cannot be deleted."""
        try:
            for path in paths:
                (self.folder / path).unlink(missing_ok=True)
        except OSError as error:
            self._say(f"Finished results in {self.folder} cannot be deleted ({error}).")
            return False
        return True

    def _ages(self, paths: Iterable[str]) -> list[tuple[float, str]]:
        """When files were last used (s, epoch), oldest first; those that are gone left out."""
        ages = []
        for path in paths:
            with suppress(OSError):
                ages.append(((self.folder / path).stat().st_mtime, path))
        return sorted(ages)

    def _tabulate(self) -> _Table:
        keys = [known.keys for known in self._packs.values()]
        first, second = _halves("".join([*keys, FORGOTTEN]))  # never empty
        # Packs come in the order of their time, so the newest of equal keys stays last.
        rows = first.argsort(kind="stable")
        ends = np.cumsum([len(one) // KEY for one in keys], dtype=np.intp)
        return _Table(first[rows], second[rows], rows, ends, list(self._packs))


def _halves(keys: str) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
    """Halves, as numbers, of keys that stand one after another."""
    numbers = np.frombuffer(bytes.fromhex(keys), dtype=np.uint64)
    return numbers[::2], numbers[1::2]


def _described(path: Path) -> _Known:
    """What a pack says of itself."""
    size = path.stat().st_size
    try:
        stage, keys = read_keys(path)
    except (OSError, ValueError):
        # Kept without cells, so that it is not read each time and can be evicted.
        return _Known(UNREADABLE, size, "")
    return _Known(stage, size, keys)

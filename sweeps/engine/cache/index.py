"""The index of a cache: which pack has which cell."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from sweeps.engine.cache.objects import MARKER, Objects
from sweeps.engine.cache.packs import (
    NO_LOCATIONS,
    NO_PACK,
    PACK,
    Locations,
    Pack,
    array_kinds,
    read_pack,
)
from sweeps.engine.declare.stage import Output
from sweeps.engine.resolve.keys import Keys

READERS = 16  # packs whose heads are read at once
RECENT_PACKS = 10  # packs of a stage, whose costs count
LOOKUP_KEYS = 2**20  # keys that are looked up together


class CellIndex:
    """Index of the packs of a cache, or of some of its folders; `say` is called with warnings."""

    def __init__(
        self, cells: Objects, say: Callable[[str], None], folders: Iterable[str] = ("",)
    ) -> None:
        self.cells, self._say = cells, say
        self.packs: list[Pack] = []
        self.paths: list[str] = []  # of all packs, by number
        self._new: dict[int, Keys | None] = {}  # keys, if read, of packs that are not indexed yet
        # All cells, sorted by the first half of their key, the newest of equal ones last.
        self._locations = replace(NO_LOCATIONS, paths=self.paths)
        found = [one for part in cells.map(cells.sizes, folders) for one in part.items()]
        packs = [one for one in found if one[0].endswith(PACK)]
        packs.sort(key=lambda one: one[0].rpartition("/")[2])  # by their time
        with ThreadPoolExecutor(READERS) as pool:  # each waits for a bucket's answer
            for pack, keys in pool.map(lambda one: read_pack(cells, *one), packs):
                self.add(pack, keys)
        if lost := sum(not pack.cells for pack in self.packs):
            say(f"{lost:,} files of results in the cache are damaged, or of another version")

    def add(self, pack: Pack, keys: Keys | None = None) -> int:
        """Record a new pack; return its number. Its cells are found after the next `refresh`."""
        number = len(self.packs)
        self.packs.append(pack)
        self.paths.append(pack.path)
        self._new[number] = keys
        return number

    def refresh(self) -> None:
        """Index the cells of packs that were added."""
        if not self._new:
            return
        keys, packs, rows = [self._locations.keys], [self._locations.pack], [self._locations.row]
        for number, known in self._new.items():
            pack = self.packs[number]
            if known is None:
                _, known = read_pack(self.cells, pack.path, pack.size)
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
        self._locations = Locations(self.paths, of_pack, row, np.array(halves).T)

    def find(self, keys: Keys, outputs: Sequence[Output]) -> Locations:
        """Return the locations of keys, (cell, 2), in the newest pack that has them.

        A later one whose key has the same first half hides another: by chance once in 10^19 pairs.
        Those of a pack whose arrays are not as `outputs` declares them are damaged.
        """
        pack, row = np.full((2, len(keys)), NO_PACK, dtype=np.int32)
        known = self._locations
        for start in range(0, len(keys) if len(known) else 0, LOOKUP_KEYS):
            asked = keys[start : start + LOOKUP_KEYS]
            order = np.argsort(asked[:, 0])  # neighbours are found faster
            at = np.searchsorted(known.keys[:, 0], asked[order, 0], side="right") - 1
            right = (at >= 0) & (known.keys[at] == asked[order]).all(axis=1)
            pack[start + order] = np.where(right, known.pack[at], NO_PACK)
            row[start + order] = known.row[at]
        kinds, met = array_kinds(outputs), np.unique(pack[pack >= 0]).tolist()
        other = [one for one in met if kinds is not None and self.packs[one].kinds != kinds]
        if other:
            wrong = np.isin(pack, other)
            pack[wrong] = NO_PACK
            lost = f"{int(wrong.sum()):,} results in the cache differ from the declaration of"
            self._say(f"{lost} their stage, and are computed again")
        return Locations(self.paths, pack, row, keys)

    def drop(self, keys: Keys) -> None:
        """Drop keys of damaged cells, (cell, 2), including older copies; packs stay."""
        self.refresh()
        for key in keys:
            halves, last_key = self._locations.keys[:, 0], key[0] + np.uint64(1)
            first, last = np.searchsorted(halves, [key[0], last_key])
            same = (self._locations.keys[first:last] == key).all(axis=1)
            self._locations.pack[first:last][same] = NO_PACK

    def costs(self) -> dict[str, tuple[float, float]]:
        """Return seconds and bytes per cell by stage: means of the latest packs."""
        latest: dict[str, list[Pack]] = defaultdict(list)
        for pack in self.packs:
            if pack.cells:
                latest[pack.stage].append(pack)
        sums = {
            stage: [(one.cells, one.seconds, one.size) for one in packs[-RECENT_PACKS:]]
            for stage, packs in latest.items()
        }
        totals = {stage: list(map(sum, zip(*of, strict=True))) for stage, of in sums.items()}
        return {stage: (spent / n, size / n) for stage, (n, spent, size) in totals.items()}

    def prune(self, limit: float) -> tuple[int, int]:
        """Delete the oldest packs until the others have at most `limit` bytes.

        Returns the number of cells and of bytes that are gone.
        """
        newest_first = np.cumsum([pack.size for pack in reversed(self.packs)])
        count = int(np.searchsorted(newest_first, limit, side="right"))
        old = self.packs[: len(self.packs) - count]
        self.cells.delete(pack.path for pack in old)
        self.cells.delete(name for name in self.cells.sizes() if name.endswith(MARKER))
        self.cells.delete_unfinished()
        self.cells.remove_empty_folders()
        return sum(pack.cells for pack in old), sum(pack.size for pack in old)

    def size(self) -> tuple[int, int]:
        """Return the number of cells and of bytes."""
        return sum(pack.cells for pack in self.packs), sum(pack.size for pack in self.packs)

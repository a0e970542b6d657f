"""The index of a cache: the pack of each cell."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from sweeps.engine.cache.packs import NO_LOCATIONS, NO_PACK, PACK, Locations, Pack, read_pack
from sweeps.engine.objects import Objects
from sweeps.engine.resolve.keys import Keys

if TYPE_CHECKING:
    from obstore import ObjectMeta

READERS = 16  # packs whose heads are read at once
RECENT_PACKS = 10  # latest packs of a stage over which its costs are averaged
LOOKUP_KEYS = 2**20  # keys that are looked up together
MARKER = ".mark"  # suffix of the object that workers look for in a shared cache


class CellIndex:
    """Index of the packs of a cache, or of some of its folders; `say` is called with warnings."""

    def __init__(
        self, objects: Objects, say: Callable[[str], None], folders: Iterable[str] = ("",)
    ) -> None:
        self.objects = objects
        self.packs: list[Pack] = []
        self.paths: list[str] = []  # of all packs, by number
        self._new: dict[int, Keys | None] = {}  # keys, if read, of packs that are not indexed yet
        # All cells, sorted by the first half of their key, the newest of equal cells last.
        self._locations = replace(NO_LOCATIONS, paths=self.paths)
        listings = objects.map(objects.list_objects, folders)
        files = [file for listing in listings for file in listing.values()]
        packs = [file for file in files if file["path"].endswith(PACK)]
        # In the order of writing, by the clock of the disk or bucket, then by that of the writer.
        packs.sort(key=lambda file: (file["last_modified"], file["path"].rpartition("/")[2]))

        def read(file: ObjectMeta) -> tuple[Pack, Keys]:
            return read_pack(objects, file["path"], file["size"])

        with ThreadPoolExecutor(READERS) as pool:  # each waits for a bucket's answer
            for pack, keys in pool.map(read, packs):
                self.add(pack, keys)
        if damaged := sum(not pack.cells for pack in self.packs):
            say(f"{damaged:,} files of results in the cache are damaged, or of another version")

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
        for number, pack_keys in self._new.items():
            pack = self.packs[number]
            if pack_keys is None:
                _, pack_keys = read_pack(self.objects, pack.path, pack.size)
            keys.append(pack_keys)
            packs.append(np.full(len(pack_keys), number, np.int32))
            rows.append(np.arange(len(pack_keys), dtype=np.int32))
        self._new.clear()
        all_keys = np.concatenate(keys)
        del keys
        order = np.argsort(all_keys[:, 0], kind="stable")
        # Each half is searched on its own.
        halves = [np.ascontiguousarray(all_keys[:, half])[order] for half in range(2)]
        del all_keys
        pack_numbers, row = np.concatenate(packs)[order], np.concatenate(rows)[order]
        self._locations = Locations(self.paths, pack_numbers, row, np.array(halves).T)

    def find(self, keys: Keys) -> Locations:
        """Return the locations of keys, (cell, 2), in the newest pack that has them.

        The search uses the first half of each key, so a later cell with the same first half hides
        an earlier one: by chance, one pair in 10^19.
        """
        pack, row = np.full((2, len(keys)), NO_PACK, dtype=np.int32)
        index = self._locations
        for start in range(0, len(keys) if len(index) else 0, LOOKUP_KEYS):
            batch = keys[start : start + LOOKUP_KEYS]
            order = np.argsort(batch[:, 0])  # neighbours are found faster
            positions = np.searchsorted(index.keys[:, 0], batch[order, 0], side="right") - 1
            hits = (positions >= 0) & (index.keys[positions] == batch[order]).all(axis=1)
            pack[start + order] = np.where(hits, index.pack[positions], NO_PACK)
            row[start + order] = index.row[positions]
        return Locations(self.paths, pack, row, keys)

    def drop(self, keys: Keys) -> None:
        """Drop keys of damaged cells, (cell, 2), including older copies; packs stay."""
        self.refresh()
        for key in keys:
            first_halves = self._locations.keys[:, 0]
            first = np.searchsorted(first_halves, key[0], side="left")
            last = np.searchsorted(first_halves, key[0], side="right")
            equal = (self._locations.keys[first:last] == key).all(axis=1)
            self._locations.pack[first:last][equal] = NO_PACK

    def costs(self) -> dict[str, tuple[float, float]]:
        """Return seconds and bytes per cell by stage: means of the latest packs."""
        latest: dict[str, list[Pack]] = defaultdict(list)
        for pack in self.packs:
            if pack.cells:
                latest[pack.stage].append(pack)
        sums = {
            stage: [(pack.cells, pack.seconds, pack.size) for pack in packs[-RECENT_PACKS:]]
            for stage, packs in latest.items()
        }
        totals = {
            stage: list(map(sum, zip(*columns, strict=True))) for stage, columns in sums.items()
        }
        return {stage: (spent / n, size / n) for stage, (n, spent, size) in totals.items()}

    def prune(self, limit: float) -> tuple[int, int]:
        """Delete the oldest packs until the others have at most `limit` bytes.

        Returns the number of deleted cells and bytes.
        """
        newest_first = np.cumsum([pack.size for pack in reversed(self.packs)])
        count = int(np.searchsorted(newest_first, limit, side="right"))
        oldest = self.packs[: len(self.packs) - count]
        self.objects.delete(pack.path for pack in oldest)
        self.objects.delete(name for name in self.objects.sizes() if name.endswith(MARKER))
        self.objects.delete_unfinished()
        self.objects.remove_empty_folders()
        return sum(pack.cells for pack in oldest), sum(pack.size for pack in oldest)

    def size(self) -> tuple[int, int]:
        """Return the number of cells and of bytes."""
        return sum(pack.cells for pack in self.packs), sum(pack.size for pack in self.packs)

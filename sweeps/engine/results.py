"""The cells that a cache has: which pack has which, what they cost, and which go first.

All of this stands in the first lines of the packs, and when a pack was last used is the time of
its file. So there is no file that could disagree with them, and several processes may use one
folder.
"""

from __future__ import annotations

import os
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from sweeps.engine.packs import ROOM, Pack, Spot, described_pack, files_of, is_own

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
            say(f"results in the cache are damaged, or another user's (files: {lost:,})")

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

    def summary(self) -> dict[str, tuple[int, int]]:
        """Return the number of cells, and bytes, by stage."""
        found: dict[str, tuple[int, int]] = {}
        for pack in self.packs.values():
            cells, size = found.get(pack.stage, (0, 0))
            found[pack.stage] = cells + len(pack.keys), size + pack.size
        return dict(sorted(found.items()))

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

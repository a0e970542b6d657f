"""The index of finished results on disk: which pack has which cells, and what they cost.

Everything needed to find a cell stands in the packs, and when a pack was last used is the time of
its file. The index saves reading every pack: without it, or if it is damaged, they are read. So
nothing is lost with it, and several processes may use one folder.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from sweeps.engine.packs import (
    ROOM,
    Pack,
    Spot,
    list_files,
    open_own,
    seal,
    undamaged,
    unseal,
    write_whole,
)

INDEX = "cells.index"
UNREADABLE = "(unreadable)"
FORGOTTEN = 32 * "0"  # replaces the key of a damaged cell
ORPHANED = 86400.0  # s, after which a partial file counts as abandoned

# Weight of earlier costs when the next is added: about ten of them matter.
FADING = 0.9


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
        with undamaged(OSError, ValueError), open_own(folder / INDEX) as file:
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

    def find(self, keys: Sequence[str]) -> dict[str, Spot]:
        """Return the spot of each key found, the newest of equal ones."""
        return {key: Spot(*self._spots[key], key) for key in keys if key in self._spots}

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
    with undamaged(OSError, ValueError), open_own(path) as file:
        match unseal(file.readline()):
            case {"stage": str(stage), "keys": [*keys]} if _is_known([stage, size, keys]):
                return stage, size, keys
    # Indexed without cells, so that it is not read each time and can be evicted.
    return UNREADABLE, size, ()

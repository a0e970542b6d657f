"""Finished cells taken over from a store that is there, when the cache has lost them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from sweeps.engine.blocks import read_block
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.experiment import Bound
from sweeps.engine.layout import Layout, layout_of
from sweeps.engine.manifest import verify
from sweeps.engine.packs import write_pack
from sweeps.engine.plan import Place, Plan
from sweeps.engine.provenance import choices_of
from sweeps.engine.tasks import Arrays, Spot

MOST_CELLS = 4096  # of a pack
AT_ONCE = 2**26  # bytes of results that are read before they are packed


class OldStore:
    """Cells that a store has, found by their keys.

    Files that are damaged give none, nor do stages that hand on more than the store has, or pad
    their arrays in it, or whose keys are others by now, as of a file that has changed.

    Parameters
    ----------
    plan : Plan
        The sweep that goes on with the store.
    path : Path
        The store.
    old : mapping
        Its attributes.
    say : callable
        Told, in a sentence, of damage.
    """

    def __init__(
        self, plan: Plan, path: Path, old: Mapping[str, Any], say: Callable[[str], None]
    ) -> None:
        self._plan = Plan(plan.experiment, choices_with_engine(plan, old))
        self._path = path
        self._old = old
        self._say = say

    def has(self, keys: Iterable[str]) -> set[str]:
        """Those of some keys whose cells are there."""
        return {key for key in keys if key in self._places}

    def find(self, keys: Iterable[str], folder: Path) -> dict[str, Spot]:
        """Spots of those cells that are there, put into packs in a folder."""
        of_stage: dict[Bound, list[str]] = defaultdict(list)
        for key in keys:
            if key in self._places:
                of_stage[self._places[key][0]].append(key)
        found: dict[str, Spot] = {}
        for bound, wanted in of_stage.items():
            for cells in self._read(bound, wanted):
                pack = write_pack(folder, bound.name, cells)
                for row, (key, _) in enumerate(cells):
                    found[key] = str(folder / pack.path), row
        return found

    @cached_property
    def _places(self) -> dict[str, tuple[Bound, Place]]:
        """Stage and place of every cell that the store has, by key."""
        damaged = verify(self._path)
        if damaged:
            self._say(f"{len(damaged)} files of the store are damaged ({damaged[0]})")
        failed: Mapping[str, str] = self._old.get("failures", {})
        known: Mapping[str, str] = self._old.get("cells", {})
        found: dict[str, tuple[Bound, Place]] = {}
        for bound in self._plan.targets:
            if known.get(bound.name) != self._plan.fingerprint(bound) or not self._is_whole(bound):
                continue
            if failed and _gathers(bound):  # it may have been made of what there was
                continue
            prefixes = tuple(
                f"{layout.group}/{layout.output.name}/" for layout in self._layouts(bound)
            )
            if any(name.startswith(prefixes) for name in damaged):
                continue
            for place in self._plan.cells(bound):
                if not failed or self._plan.described(bound, place) not in failed:
                    found[self._plan.key(bound, place)] = bound, place
        return found

    def _is_whole(self, bound: Bound) -> bool:
        """Whether the store has all that a stage gives, as it was given."""
        return not bound.stage.coordinates and all(
            one.stored and one.pad is None and not one.origin for one in bound.stage.outputs
        )

    def _layouts(self, bound: Bound) -> list[Layout]:
        return [layout_of(self._plan, bound, output) for output in bound.stage.outputs]

    def _read(self, bound: Bound, keys: list[str]) -> Iterator[list[tuple[str, Arrays]]]:
        """Cells of a stage, as many at a time as fit into memory."""
        layouts = self._layouts(bound)
        numbers = self._plan.axes_on(bound)
        cells: list[tuple[str, Arrays]] = []
        size = 0
        for key in keys:
            place = dict(zip(numbers, self._places[key][1], strict=True))
            arrays: Arrays = {}
            try:
                for layout in layouts:
                    name, dtype = layout.output.name, layout.output.dtype
                    block = read_block(self._path, layout.group, name, layout.index(place))
                    there = np.asarray(block)  # one value comes as itself
                    # A store has integers for truth values, and its own kind of texts.
                    arrays[name] = layout.from_store(there).astype(dtype, copy=False)
            except (OSError, ValueError, KeyError, ConfigurationError):
                continue
            cells.append((key, arrays))
            size += sum(array.nbytes for array in arrays.values())
            if size > AT_ONCE or len(cells) >= MOST_CELLS:
                yield cells
                cells, size = [], 0
        if cells:
            yield cells


def _gathers(bound: Bound) -> bool:
    """Whether a stage, or one behind it, looks at many cells at once."""
    return bool(bound.gather) or any(map(_gathers, bound.inputs))


def choices_with_engine(plan: Plan, old: Mapping[str, Any]) -> Any:
    """Choices that the store was made with; where it ran is as it is now."""
    before = choices_of(plan.experiment, old)
    return type(before)({**plan.choices.values, **before.values}, before.joint)

"""Reuse of finished cells from an existing store that the cache has lost."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import cached_property, lru_cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.cube import Layout, Spans, layouts_of, within
from sweeps.engine.folders import verify
from sweeps.engine.kinds import Value
from sweeps.engine.packs import Spot, write_pack
from sweeps.engine.plan import Place, Plan
from sweeps.engine.provenance import choices_of
from sweeps.engine.returned import Arrays
from sweeps.engine.settings import Choices
from sweeps.engine.stage import Bound
from sweeps.engine.store import RAGGED

AT_ONCE = 256  # cells that are read before they are packed
KEPT_CHUNKS = 64  # decoded ones, usually of at most 1 MiB


class OldStore:
    """Cells of a store, found by their keys; `say` is called with a sentence on damage.

    Damaged files give none, nor do stages with outputs that are not stored, or whose
    keys have changed, for example with an input file.
    """

    def __init__(
        self, plan: Plan, path: Path, old: Mapping[str, Any], say: Callable[[str], None]
    ) -> None:
        self._now = plan
        before = choices_of(plan.experiment, old)
        # Choices of the store; settings of where to run are the present ones.
        self._plan = Plan(plan.experiment, _as_now(before, plan.choices))
        self._path = path
        self._old = old
        self._say = say
        self._layouts = lru_cache(maxsize=None)(lambda bound: layouts_of(self._plan, bound))
        # Faster than zarr, which would open an array and decode a chunk for every cell.
        self._array = lru_cache(maxsize=None)(self._opened)
        self._chunk = lru_cache(KEPT_CHUNKS)(self._decoded)
        self._spans = lru_cache(maxsize=None)(self._spans_and_starts)

    def has(self, bound: Bound, keys: Iterable[str]) -> set[str]:
        """Return which of some keys of a stage have cells in the store."""
        possible = self._possible(bound).intersection(keys)
        return {key for key in possible if key in self._places}

    def find(self, bound: Bound, keys: Iterable[str], folder: Path) -> dict[str, Spot]:
        """Return spots of a stage's cells in the store, copied into packs in a folder."""
        there = self.has(bound, keys)
        wanted = [key for key in keys if key in there]
        found: dict[str, Spot] = {}
        for start in range(0, len(wanted), AT_ONCE):
            part = wanted[start : start + AT_ONCE]
            cells = [(key, self._cell(*self._places[key])) for key in part]
            pack = write_pack(folder, bound.name, cells)
            found |= {key: Spot(str(folder / pack.path), row, key) for row, key in enumerate(part)}
        return found

    def _possible(self, bound: Bound) -> set[str]:
        """Return keys of all cells of a stage at values that the store has, too.

        They are known from planning, whereas finding cells in the store takes reading all of it.
        """
        plan, before = self._now, self._plan.choices
        axes = [plan.axes[number] for number in plan.axes_on(bound)]
        both = [
            [
                at
                for at, point in enumerate(axis.points)
                if all(v in before[one] for one, v in zip(axis.settings, point, strict=True))
            ]
            for axis in axes
        ]
        return {plan.key(bound, place) for place in product(*both)}

    @cached_property
    def _places(self) -> dict[str, tuple[Bound, Place]]:
        """Return stage and place of every cell of the store, by key."""
        damaged = verify(self._path)
        if damaged:
            self._say(f"{len(damaged):,} files of the store are damaged ({damaged[0]})")
        failed: Mapping[str, str] = self._old.get("failures", {})
        known: Mapping[str, str] = self._old.get("cells", {})
        found: dict[str, tuple[Bound, Place]] = {}
        for bound in self._plan.targets:
            if known.get(bound.name) != self._plan.fingerprint(bound) or not _is_whole(bound):
                continue
            if failed and _gathers(bound):  # it may have been computed without them
                continue
            layouts = self._layouts(bound)
            files = [f"{one.group}/{one.output.name}/" for one in layouts]
            ragged = [f"{one.group}/{RAGGED}" for one in layouts if one.ragged]
            if any(name.startswith((*files, *ragged)) for name in damaged):
                continue
            if not all((self._path / name).exists() for name in ragged):  # an older store
                continue
            for place in self._plan.cells(bound):
                if not failed or self._plan.described(bound, place) not in failed:
                    found[self._plan.key(bound, place)] = bound, place
        return found

    def _cell(self, bound: Bound, place: Place) -> Arrays:
        """Return arrays of a cell as its stage returned them."""
        at = dict(zip(self._plan.axes_on(bound), place, strict=True))
        found: Arrays = {}
        for layout in self._layouts(bound):
            found |= self._values(layout, [at.get(number, 0) for number in layout.axes])
        # A store has integers for booleans, and its own type of strings.
        outputs = bound.stage.outputs
        return {one.name: found[one.name].astype(one.dtype, copy=False) for one in outputs}

    def _values(self, layout: Layout, lead: list[int]) -> Arrays:
        """Return an output, and its start, as the stage returned them, at a place on its axes."""
        output, count = layout.output, len(lead)
        index = [lead[k] if k < count else slice(None) for k in layout.order]
        own = [k - count for k in layout.order if k >= count]
        # A single value comes as a scalar.
        values = np.asarray(self._block(f"{layout.group}/{output.name}", index))
        values = values.transpose(np.argsort(own)) if own else values
        if not layout.ragged:
            return {output.name: values}
        all_spans, starts = self._spans(layout.group, output.name)
        shape = [len(self._plan.axes[number].points) for number in layout.axes]
        spans = all_spans[int(np.ravel_multi_index(lead, shape)) if lead else 0]
        assert spans is not None
        found = {output.name: values[within(spans, starts)]}
        for dim, (begin, _) in zip(output.dims, spans, strict=True):
            if dim in output.origin:
                found[output.origin[dim]] = np.asarray(begin)
        return found

    def _block(self, name: str, index: list[int | slice]) -> NDArray[Any]:
        """Return stored values of an array at an index of one chunk."""
        pairs = [
            (0, one) if isinstance(one, slice) else divmod(one, size)
            for one, size in zip(index, self._array(name).chunks, strict=True)
        ]
        chunk: NDArray[Any] = self._chunk(name, tuple(place for place, _ in pairs))
        return chunk[tuple(inside for _, inside in pairs)]

    def _spans_and_starts(self, group: str, name: str) -> tuple[list[Spans | None], list[int]]:
        """Return the extents of all cells of a ragged variable, and the variable's start."""
        spans = json.loads((self._path / group / RAGGED).read_bytes())[name]
        along = zip(*filter(None, spans), strict=True)
        return spans, [min(begin for begin, _ in one) for one in along]

    def _opened(self, name: str) -> Any:
        import zarr  # slow to import, and most sweeps read no store

        return zarr.open_array(self._path / name, mode="r")

    def _decoded(self, name: str, place: tuple[int, ...]) -> Any:
        array = self._array(name)
        return array.get_block_selection(place) if array.size else array[...]


def _as_now(before: Choices, now: Choices) -> Choices:
    """Return choices of a store, with its values replaced by equal ones of now.

    A value may hold more than its label in the store, such as a file with a name.
    """
    own = {key: {value: value for value in values} for key, values in now.values.items()}

    def point(keys: Iterable[str], values: Iterable[Value]) -> tuple[Value, ...]:
        return tuple(own[key].get(value, value) for key, value in zip(keys, values, strict=True))

    values = {key: point([key] * len(given), given) for key, given in before.values.items()}
    joint = (
        replace(one, points=tuple(point(one.keys, there) for there in one.points))
        for one in before.joint
    )
    return Choices({**now.values, **values}, tuple(joint))


def _is_whole(bound: Bound) -> bool:
    """Return whether the store has all outputs of a stage."""
    outputs = bound.stage.outputs
    begins = {name for one in outputs if one.stored for name in one.origin.values()}
    there = all(one.stored or one.name in begins for one in outputs)
    return there and not bound.stage.coordinates


def _gathers(bound: Bound) -> bool:
    """Return whether a stage, or one of its inputs, gathers cells."""
    return bool(bound.gather) or any(map(_gathers, bound.inputs))

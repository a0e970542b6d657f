"""The cube of a sweep: its cells laid out as labelled arrays, one dimension an axis."""

from __future__ import annotations

import math
import threading
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.coordinates import axis_coordinates, setting_coordinates
from sweeps.engine.errors import DeclarationError
from sweeps.engine.packs import Spot
from sweeps.engine.plan import Plan
from sweeps.engine.returned import Arrays, uneven
from sweeps.engine.stage import Bound, Output
from sweeps.engine.tasks import Damaged
from sweeps.engine.zarr_array import Array, Group, suggest_chunks

MISSING, FAILED, DONE = -1, 0, 1
STATE = {"flag_values": [MISSING, FAILED, DONE], "flag_meanings": "missing failed done"}

REMEMBERED = 2**28  # bytes of cells that stay in memory between variables
AT_ONCE = 512  # cells whose shapes are looked at

Reader = Callable[[Sequence[Spot]], list[Arrays | None]]
Spans = list[tuple[int, int]]  # begin and length along each own dimension of an output


MEASURED = "measured while the cell was computed; differs if computed again"


@dataclass(frozen=True)
class Layout:
    """Layout of a stage's output in the store."""

    bound: Bound
    output: Output
    group: str
    axes: tuple[int, ...]  # numbers of those that are dimensions, in their order
    order: tuple[int, ...]  # source of each dimension: these axes first, then its own

    @property
    def ragged(self) -> bool:
        """Return whether its arrays differ in shape or start."""
        return bool(self.output.dims) and (self.output.pad is not None or bool(self.output.origin))

    def spans(self, arrays: Arrays) -> Spans:
        """Return start and length of a cell on each own dimension."""
        output, shape = self.output, arrays[self.output.name].shape
        if len(shape) != len(output.dims):
            raise DeclarationError(
                f"stage {self.bound.name}: {output.name} has the shape {shape}, but the dimensions "
                f"{', '.join(output.dims)}"
            )
        begins = [
            int(arrays[output.origin[dim]]) if dim in output.origin else 0 for dim in output.dims
        ]
        return list(zip(begins, shape, strict=True))


def within(spans: Spans, starts: Sequence[int]) -> tuple[slice, ...]:
    """Return the slices of a cell in its variable, given the starts of its own dimensions."""
    pairs = zip(spans, starts, strict=True)
    return tuple(slice(begin - start, begin - start + size) for (begin, size), start in pairs)


def layouts_of(plan: Plan, bound: Bound) -> list[Layout]:
    """Return the layouts of a stage's stored outputs."""
    order = {name: place for place, name in enumerate(bound.stage.dims)}

    def rank(number: int) -> int:
        axis = plan.axes[number]
        renamed = bound.stage.names.get(axis.settings[0], "")
        words = [renamed, axis.name, *(one.name for one in axis.settings)]
        return min((order[word] for word in words if word in order), default=-1)

    layouts = []
    for output in bound.stage.outputs:
        if not output.stored:
            continue
        left_out = set(output.without)
        axes = [
            number
            for number in sorted(_dimensions(plan, bound), key=rank)
            if not {one.name for one in plan.axes[number].settings} <= left_out
        ]
        ranks = [*map(rank, axes), *(order.get(dim, len(order)) for dim in output.dims)]
        places = tuple(np.argsort(ranks, kind="stable").tolist())
        group = output.group or str(bound.stage.group)
        layouts.append(Layout(bound, output, group, tuple(axes), places))
    return layouts


def _shared(layouts: Sequence[Layout], extents: Sequence[Spans | None]) -> list[Spans]:
    """Return extents of the outputs of a group, in which each dimension has one length.

    Where cells of a stage failed, its padded arrays may be shorter than those of another stage.
    """
    longest: dict[str, tuple[int, int]] = {}
    for layout, spans in zip(layouts, extents, strict=True):
        for dim, span in zip(layout.output.dims, spans or (), strict=spans is not None):
            longest[dim] = max(longest.get(dim, span), span, key=lambda one: one[1])

    def extent(layout: Layout, spans: Spans | None, number: int, dim: str) -> tuple[int, int]:
        if spans is None:
            return longest.get(dim, (0, 0))
        start, length = spans[number]
        padded = layout.output.pad is not None and dim not in layout.output.origin
        return start, longest[dim][1] if padded else length

    return [
        [extent(layout, spans, number, dim) for number, dim in enumerate(layout.output.dims)]
        for layout, spans in zip(layouts, extents, strict=True)
    ]


def _dimensions(plan: Plan, *bounds: Bound) -> list[int]:
    """Return numbers of the axes that become dimensions, even with one value."""
    numbers = {plan.axis_number(key) for bound in bounds for key in bound.needs}
    axes = [(number, plan.axes[number]) for number in sorted(numbers)]
    return [n for n, axis in axes if axis.several or any(one.shown for one in axis.settings)]


class Cube:
    """The arrays of a store, made of the cells of a plan.

    By key, `spots` has the location of a cell, and `failed` the reason of its failure. `read` gives
    None for a damaged one.
    """

    def __init__(
        self,
        plan: Plan,
        spots: Mapping[str, Spot],
        failed: Mapping[str, str],
        read: Reader,
    ) -> None:
        self.plan = plan
        self.spots = spots
        self.failed = failed
        self._read_cells = read
        self._lock = threading.Lock()
        self._memory: dict[Spot, Arrays] = {}
        self._held = 0

    def groups(self) -> dict[str, Group]:
        """Return groups of the store by path; raise `Damaged` if a cell cannot be read back."""
        found: dict[str, Group] = {}
        members: dict[str, list[Layout]] = defaultdict(list)
        for bound in self.plan.targets:
            for layout in layouts_of(self.plan, bound):
                members[layout.group].append(layout)
        for name, layouts in members.items():
            names = self._names(layouts)
            group = found[name] = Group({}, {}, ragged={})
            extents = _shared(layouts, [self._extents(group, one) for one in layouts])
            for layout, extent in zip(layouts, extents, strict=True):
                self._add(group, layout, names, extent)
            group.coordinates.update(self._coordinates(layouts, names))
        for name, arrays, labels in self._statuses():
            group = found.setdefault(name, Group({}, {}))
            group.arrays.update(arrays)
            group.coordinates.update(labels)
        return dict(sorted(found.items()))

    def _names(self, layouts: Sequence[Layout]) -> dict[int, str]:
        """Return names of all axes that a group depends on; the whole key if the word is taken."""
        axes, number_of = self.plan.axes, self.plan.axis_number
        taken = {dim for one in layouts for dim in one.output.dims}
        gathered = {
            number_of(key)
            for one in layouts
            for key in one.bound.gather
            if axes[number_of(key)].name in one.output.dims
        }
        bounds = {number_of(key): one.bound for one in reversed(layouts) for key in one.bound.needs}
        names: dict[int, str] = {}
        for number in dict.fromkeys((*_dimensions(self.plan, *bounds.values()), *sorted(bounds))):
            setting = axes[number].settings[0]
            name = bounds[number].stage.names.get(setting) or axes[number].name
            if name in taken and number not in gathered:
                name = setting.key.replace(".", "_")
            names[number] = name
            taken.add(name)
        return names | {number: axes[number].name for number in gathered}

    def _add(self, group: Group, layout: Layout, names: Mapping[int, str], extents: Spans) -> None:
        """Add the variable of an output, and coordinates of its own dimensions, to its group."""
        output, plan = layout.output, self.plan
        starts, lengths = [start for start, _ in extents], [length for _, length in extents]
        for dim, start, length in zip(output.dims, starts, lengths, strict=True):
            if dim in output.origin:
                outputs = layout.bound.stage.outputs
                begin = next(one for one in outputs if one.name == output.origin[dim])
                about = {"units": begin.unit, "long_name": begin.label}
                group.coordinates[dim] = Array.of((dim,), start + np.arange(length), about)
        shape = (*(len(plan.axes[number].points) for number in layout.axes), *lengths)
        dims = (*(names[number] for number in layout.axes), *output.dims)
        dtype = np.dtype(output.dtype)
        chunks = suggest_chunks(shape, dtype.itemsize, whole=len(output.dims))
        words = dtype.kind == "U"
        attrs: dict[str, Any] = {} if words else {"units": output.unit}
        attrs |= {"long_name": output.label, **output.attrs}
        if output.measured:
            attrs["comment"] = MEASURED
        if output.step != 1:
            attrs["scale_factor"] = output.step  # the integers are then read as numbers
        back = np.argsort(layout.order)

        def read(region: tuple[slice, ...]) -> NDArray[Any]:
            natural = tuple(region[k] for k in back)
            return self._region(layout, starts, lengths, natural).transpose(layout.order)

        given: Any = (tuple(one[k] for k in layout.order) for one in (dims, shape, chunks))
        named, sizes, parts = given
        fill = None if words else output.empty
        found = Array(named, sizes, dtype, fill, attrs, parts, read)
        if words:  # few, and stored no wider than the longest
            found = replace(found, read=read(tuple(slice(0, size) for size in sizes)))
        into = group.coordinates if layout.bound.stage.coordinates else group.arrays
        into[output.name] = found

    def _keys(self, layout: Layout, ranges: Sequence[range]) -> list[str]:
        """Return keys of the cells in ranges of the variable's axes, the last fastest."""
        own = self.plan.axes_on(layout.bound)
        at = [layout.axes.index(number) if number in layout.axes else None for number in own]
        return [
            self.plan.key(layout.bound, tuple(0 if k is None else point[k] for k in at))
            for point in product(*ranges)
        ]

    def _extents(self, group: Group, layout: Layout) -> Spans | None:
        """Return start and length of an output's own dimensions over all cells; None if none."""
        dims = layout.output.dims
        numbers = self.plan.gathered(layout.bound)
        gathered = {self.plan.axes[n].name: len(self.plan.axes[n].points) for n in numbers}
        if set(dims) <= set(gathered):
            return [(0, gathered[dim]) for dim in dims]
        keys = self._keys(layout, [range(len(self.plan.axes[n].points)) for n in layout.axes])
        there = [key for key in dict.fromkeys(keys) if key in self.spots]
        spans: dict[str, Spans] = {}
        for start in range(0, len(there) if layout.ragged else min(len(there), 1), AT_ONCE):
            part = there[start : start + (AT_ONCE if layout.ragged else 1)]
            cells = self._cells([self.spots[key] for key in part])
            spans |= zip(part, map(layout.spans, cells), strict=True)
        if layout.ragged:
            group.ragged[layout.output.name] = [spans.get(key) for key in keys]
        if not spans:
            return None
        along = list(zip(*spans.values(), strict=True))
        starts = [min(begin for begin, _ in one) for one in along]
        ends = [max(begin + length for begin, length in one) for one in along]
        return [(start, end - start) for start, end in zip(starts, ends, strict=True)]

    def _region(
        self, layout: Layout, starts: list[int], lengths: list[int], region: tuple[slice, ...]
    ) -> NDArray[Any]:
        """Return values of a region of a variable, complete along its own dimensions."""
        output, count = layout.output, len(layout.axes)
        ranges = [range(one.start, one.stop) for one in region[:count]]
        shape = tuple(map(len, ranges))
        flat = np.full((math.prod(shape), *lengths), output.empty, dtype=output.dtype)
        wanted: dict[int, Spot] = {}
        for number, key in enumerate(self._keys(layout, ranges)):
            if key in self.spots:
                wanted[number] = self.spots[key]
            elif key in self.failed and output.failed is not None:
                flat[number] = output.failed
        for number, arrays in zip(wanted, self._cells(list(wanted.values())), strict=True):
            array = arrays[output.name]
            if layout.ragged:
                if output.pad is not None:
                    flat[number] = output.pad
                flat[number][within(layout.spans(arrays), starts)] = array
            elif array.shape == tuple(lengths):
                flat[number] = array
            else:
                raise uneven(layout.bound.name, output.name, array.shape, tuple(lengths))
        own: Any = (..., *region[count:])
        return flat.reshape((*shape, *lengths))[own]

    def _cells(self, spots: Sequence[Spot]) -> list[Arrays]:
        """Return arrays of cells, from memory if they were read recently."""
        with self._lock:
            found = {spot: self._memory[spot] for spot in spots if spot in self._memory}
        lacking = [spot for spot in dict.fromkeys(spots) if spot not in found]
        for spot, arrays in zip(lacking, self._read_cells(lacking), strict=True):
            if arrays is None:
                raise Damaged((spot.key,))
            found[spot] = arrays
        with self._lock:
            for spot in lacking:
                self._memory[spot] = found[spot]
                self._held += sum(array.nbytes for array in found[spot].values())
            if self._held > REMEMBERED:
                self._memory, self._held = {}, 0
        return [found[spot] for spot in spots]

    def _coordinates(self, layouts: Sequence[Layout], names: Mapping[int, str]) -> dict[str, Array]:
        """Return coordinates of all axes: along dimensions, or scalar if `noted`."""
        found: dict[str, Array] = {}
        dims = {dim for one in layouts for dim in one.output.dims}
        for number, name in names.items():
            axis = self.plan.axes[number]
            if name in dims or any(number in one.axes for one in layouts):
                found |= axis_coordinates(axis, name)
            elif not axis.several:
                for setting, value in zip(axis.settings, axis.points[0], strict=True):
                    if setting.noted:
                        label = setting.name if axis.is_joint else name
                        found |= setting_coordinates(setting, label, [value], scalar=True)
        return found

    def _statuses(self) -> Iterator[tuple[str, dict[str, Array], dict[str, Array]]]:
        """Yield group, variables and coordinates of the states of stages."""
        shared = {one.name: one for one in self.plan.experiment.statuses}
        of_shared: dict[str, list[Bound]] = defaultdict(list)
        for bound in self.plan.targets:
            if bound.stage.status in shared:
                of_shared[bound.stage.status].append(bound)
            elif not bound.stage.status and not bound.stage.coordinates:
                group = f"status_{bound.stage.group}".replace("/", "_")
                numbers = _dimensions(self.plan, bound)
                yield group, *self._status(bound.name, f"state of {bound.name}", [bound], numbers)
        for name, bounds in of_shared.items():
            group, _, variable = name.partition(":")
            numbers = [self.plan.axis_number(one.key) for one in shared[name].over]
            yield group, *self._status(variable, shared[name].label, bounds, numbers)

    def _status(
        self, name: str, label: str, bounds: Sequence[Bound], numbers: Sequence[int]
    ) -> tuple[dict[str, Array], dict[str, Array]]:
        plan = self.plan
        axes = [plan.axes[number] for number in numbers]
        worst = np.full([len(axis.points) for axis in axes], DONE, dtype=np.int8)
        for bound in bounds:
            own = plan.axes_on(bound)
            at = [own.index(number) if number in own else None for number in numbers]
            for place in plan.cells(bound):
                if (key := plan.key(bound, place)) not in self.spots:
                    point = tuple(slice(None) if k is None else place[k] for k in at)
                    state = FAILED if key in self.failed else MISSING
                    worst[point] = np.where(worst[point] == FAILED, FAILED, state)
        names: list[str] = []
        for axis in axes:
            taken = axis.name in (*names, name)
            names.append(axis.settings[0].key.replace(".", "_") if taken else axis.name)
        labels: dict[str, Array] = {}
        for axis, axis_name in zip(axes, names, strict=True):
            labels |= axis_coordinates(axis, axis_name)
        attrs = {"units": "1", "long_name": label, **STATE}
        return {name: Array.of(tuple(names), worst, attrs, MISSING)}, labels

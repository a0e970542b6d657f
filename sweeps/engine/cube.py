"""The cube of a sweep: its cells laid out as labelled arrays, one dimension an axis."""

from __future__ import annotations

import math
import threading
from collections import OrderedDict, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.experiment import Bound, DeclarationError
from sweeps.engine.layout import (
    Layout,
    axis_coordinates,
    is_dimension,
    joint_coordinates,
    layout_of,
    scalar_coordinates,
)
from sweeps.engine.plan import Place, Plan
from sweeps.engine.stage import Output
from sweeps.engine.tasks import Arrays, Damaged, Spot
from sweeps.engine.zarr_array import Array, Group, suggest_chunks

MISSING, FAILED, DONE = -1, 0, 1
STATE = {"flag_values": [MISSING, FAILED, DONE], "flag_meanings": "missing failed done"}

REMEMBERED = 2**28  # bytes of cells that stay in memory between variables
AT_ONCE = 512  # cells whose shapes are looked at

Reader = Callable[[Sequence[Spot]], list[Arrays | None]]


@dataclass
class Extents:
    """Lengths of an output's own dimensions, and where the first of them begins."""

    lengths: list[int]
    starts: list[int]


class Cube:
    """The arrays of a store, made of the cells of a plan.

    Parameters
    ----------
    plan : Plan
        What was wanted.
    spots : mapping of str to Spot
        Where cells are, by key.
    failed : mapping of str to str
        Why cells failed, by key.
    read : callable
        Reads cells; None for one that is damaged.
    kept_as : callable
        Key -> key that the cell is kept under.
    """

    def __init__(
        self,
        plan: Plan,
        spots: Mapping[str, Spot],
        failed: Mapping[str, str],
        read: Reader,
        kept_as: Callable[[str], str] = str,
    ) -> None:
        self.plan = plan
        self.spots = spots
        self.failed = failed
        self._read_cells = read
        self._kept_as = kept_as
        self._lock = threading.Lock()
        self._memory: OrderedDict[Spot, Arrays] = OrderedDict()
        self._held = 0

    def groups(self) -> dict[str, Group]:
        """Groups of the store by path.

        Raises
        ------
        Damaged
            If cells that are needed for the layout cannot be read back.
        """
        variables: dict[str, dict[str, Array]] = defaultdict(dict)
        coordinates: dict[str, dict[str, Array]] = defaultdict(dict)
        members: dict[str, list[Layout]] = defaultdict(list)
        for bound in self.plan.targets:
            for output in bound.stage.outputs:
                if output.stored:
                    layout = layout_of(self.plan, bound, output)
                    members[layout.group].append(layout)
        for group, layouts in members.items():
            names = self._names(layouts)
            for layout in layouts:
                into = coordinates if layout.bound.stage.coordinates else variables
                into[group][layout.output.name] = self._array(layout, names, coordinates[group])
            coordinates[group].update(self._coordinates(layouts, names))
        for path, arrays, labels in self._statuses():
            variables[path].update(arrays)
            coordinates[path].update(labels)
        return {
            group: Group(arrays, coordinates[group]) for group, arrays in sorted(variables.items())
        }

    # layout ---------------------------------------------------------------------------------

    def _names(self, layouts: Sequence[Layout]) -> dict[int, str]:
        """Names of all axes that a group depends on; the whole key where the word is taken."""
        names: dict[int, str] = {}
        taken: set[str] = {dim for one in layouts for dim in one.output.dims}
        gathered = {
            self.plan.axis_number(key)
            for one in layouts
            for key in one.bound.gather
            if self.plan.axes[self.plan.axis_number(key)].name in one.output.dims
        }
        needed: dict[int, Bound] = {}
        for one in layouts:
            for key in one.bound.needs:
                needed.setdefault(self.plan.axis_number(key), one.bound)
        dimensions = [number for number in needed if is_dimension(self.plan.axes[number])]
        others = [number for number in sorted(needed) if number not in dimensions]
        for number in (*sorted(dimensions), *others):
            axis = self.plan.axes[number]
            name = needed[number].stage.names.get(self.plan.axes[number].settings[0]) or axis.name
            if name in taken and number not in gathered:
                name = self.plan.axes[number].settings[0].key.replace(".", "_")
            names[number] = name
            taken.add(name)
        for number in gathered:
            names[number] = self.plan.axes[number].name
        return names

    # variables ------------------------------------------------------------------------------

    def _array(
        self, layout: Layout, names: Mapping[int, str], coordinates: dict[str, Array]
    ) -> Array:
        output, plan = layout.output, self.plan
        extents = self._extents(layout)
        lead = tuple(len(plan.axes[number].points) for number in layout.axes)
        shape = (*lead, *extents.lengths)
        dims = (*(names[number] for number in layout.axes), *output.dims)
        dtype = np.dtype(output.dtype)
        chunks = suggest_chunks(shape, dtype.itemsize, whole=len(output.dims))
        attrs: dict[str, Any] = {} if dtype.kind in "OU" else {"units": output.unit}
        attrs |= {"long_name": output.label, **output.attrs}
        if output.step != 1:
            attrs["scale_factor"] = output.step  # the integers are then read as numbers
        if output.origin:
            for place, dim in enumerate(output.dims):
                if dim in output.origin:
                    steps = extents.starts[place] + np.arange(extents.lengths[place])
                    begin = output_named(layout.bound, output.origin[dim])
                    about = {"units": begin.unit, "long_name": begin.label}
                    coordinates[dim] = Array.of((dim,), steps, about)
        back = np.argsort(layout.order)

        def read(region: tuple[slice, ...]) -> NDArray[Any]:
            natural = tuple(region[k] for k in back)
            return self._region(layout, extents, natural).transpose(layout.order)

        fill = None if dtype.kind in "OU" else output.empty
        ordered = [(dims[k], shape[k], chunks[k]) for k in layout.order]
        named, sizes, parts = (tuple(one[k] for one in ordered) for k in range(3))
        return Array(named, sizes, dtype, fill, attrs, parts, read)  # type: ignore[arg-type]

    def _cell_places(self, layout: Layout) -> list[Place]:
        """Place of a cell for every place of the variable's axes, the last of these fastest."""
        plan, bound = self.plan, layout.bound
        ranges = [range(len(plan.axes[number].points)) for number in layout.axes]
        own = plan.axes_on(bound)
        at = [layout.axes.index(number) if number in layout.axes else None for number in own]
        return [tuple(0 if k is None else point[k] for k in at) for point in product(*ranges)]

    def _extents(self, layout: Layout) -> Extents:
        """Sizes of an output's own dimensions: those of one cell, or of the largest."""
        output, bound = layout.output, layout.bound
        if not output.dims:
            return Extents([], [])
        gathered = {
            axis.name: len(axis.points)
            for axis in (self.plan.axes[n] for n in self.plan.gathered(bound))
        }
        if set(output.dims) <= set(gathered):
            return Extents([gathered[dim] for dim in output.dims], [0] * len(output.dims))
        keys = dict.fromkeys(self.plan.key(bound, place) for place in self._cell_places(layout))
        there = [self.spots[key] for key in keys if key in self.spots]
        ragged = output.pad is not None or bool(output.origin)
        lengths, starts, ends = [0] * len(output.dims), None, None
        for arrays in self._one_by_one(there if ragged else there[:1]):
            size = arrays[output.name].shape
            if len(size) != len(output.dims):
                raise DeclarationError(
                    f"stage {bound.name}: {output.name} has the shape {size}, but the dimensions "
                    f"{', '.join(output.dims)}"
                )
            if not output.origin:
                lengths = [max(pair) for pair in zip(lengths, size, strict=True)]
                continue
            first = [
                int(arrays[output.origin[dim]]) if dim in output.origin else 0
                for dim in output.dims
            ]
            last = [begin + length for begin, length in zip(first, size, strict=True)]
            starts = first if starts is None else list(map(min, starts, first))
            ends = last if ends is None else list(map(max, ends, last))
        if starts is None or ends is None:
            return Extents(lengths, [0] * len(lengths))
        return Extents([end - start for start, end in zip(starts, ends, strict=True)], starts)

    def _one_by_one(self, spots: Sequence[Spot]) -> Iterator[Arrays]:
        """Arrays of cells, read many at once."""
        for start in range(0, len(spots), AT_ONCE):
            yield from self._cells(spots[start : start + AT_ONCE])

    def _region(self, layout: Layout, extents: Extents, region: tuple[slice, ...]) -> NDArray[Any]:
        """Values of one region of a variable, whole along its own dimensions."""
        plan, output, bound = self.plan, layout.output, layout.bound
        lead = region[: len(layout.axes)]
        ranges = [range(one.start, one.stop) for one in lead]
        own = plan.axes_on(bound)
        at = [layout.axes.index(number) if number in layout.axes else None for number in own]
        shape = (*map(len, ranges), *extents.lengths)
        values = np.full(shape, output.empty, dtype=output.dtype)
        flat = values.reshape(math.prod(map(len, ranges)), *extents.lengths)
        wanted: dict[int, Spot] = {}
        for number, point in enumerate(product(*ranges)):
            key = plan.key(bound, tuple(0 if k is None else point[k] for k in at))
            if key in self.spots:
                wanted[number] = self.spots[key]
            elif key in self.failed and output.failed is not None:
                flat[number] = output.failed
        for number, arrays in zip(wanted, self._cells(list(wanted.values())), strict=True):
            array = arrays[output.name]
            if array.shape == tuple(extents.lengths) and not output.origin:
                flat[number] = array
                continue
            if output.pad is not None:
                flat[number] = output.pad
            elif not output.origin:
                raise DeclarationError(
                    f"stage {bound.name}: {output.name} has the shape {array.shape} in one cell "
                    f"and {tuple(extents.lengths)} in another, but no value to pad it with"
                )
            begin = [
                int(arrays[output.origin[dim]]) - extents.starts[k] if dim in output.origin else 0
                for k, dim in enumerate(output.dims)
            ]
            inside = tuple(slice(b, b + n) for b, n in zip(begin, array.shape, strict=True))
            flat[number][inside] = array
        own_region: Any = (..., *region[len(layout.axes) :])
        return values[own_region]

    def _cells(self, spots: Sequence[Spot]) -> list[Arrays]:
        """Arrays of cells, from memory where they were read a moment ago."""
        with self._lock:
            found = {spot: self._memory[spot] for spot in spots if spot in self._memory}
        lacking = [spot for spot in dict.fromkeys(spots) if spot not in found]
        for spot, arrays in zip(lacking, self._read_cells(lacking), strict=True):
            if arrays is None:
                raise Damaged(self._keys_at(spot))
            found[spot] = arrays
        with self._lock:
            for spot in lacking:
                if spot not in self._memory:  # another thread may have read it meanwhile
                    self._memory[spot] = found[spot]
                    self._held += sum(array.nbytes for array in found[spot].values())
            while self._held > REMEMBERED and self._memory:
                _, arrays = self._memory.popitem(last=False)
                self._held -= sum(array.nbytes for array in arrays.values())
        return [found[spot] for spot in spots]

    def _keys_at(self, spot: Spot) -> tuple[str, ...]:
        return tuple(self._kept_as(key) for key, there in self.spots.items() if there == spot)

    # coordinates ----------------------------------------------------------------------------

    def _coordinates(self, layouts: Sequence[Layout], names: Mapping[int, str]) -> dict[str, Array]:
        """Coordinates of all axes: along dimensions, or scalar where one value is worth noting."""
        found: dict[str, Array] = {}
        dims = {dim for one in layouts for dim in one.output.dims}
        for number, name in names.items():
            axis = self.plan.axes[number]
            there = any(number in one.axes for one in layouts) or name in dims
            if axis.is_joint and there:
                found.update(joint_coordinates(axis, name))
            elif there:
                found.update(axis_coordinates(axis, name))
            elif not axis.several:
                for position, setting in enumerate(axis.settings):
                    if setting.noted:
                        label = setting.name if axis.is_joint else name
                        found.update(scalar_coordinates(setting, label, axis.points[0][position]))
        return found

    # status ---------------------------------------------------------------------------------

    @cached_property
    def _shared(self) -> dict[str, Any]:
        return {one.name: one for one in self.plan.experiment.statuses}

    def _statuses(self) -> Iterator[tuple[str, dict[str, Array], dict[str, Array]]]:
        """Group, variables and coordinates of the states of stages."""
        of_shared: dict[str, list[Bound]] = defaultdict(list)
        for bound in self.plan.targets:
            if bound.stage.status in self._shared:
                of_shared[bound.stage.status].append(bound)
            elif not bound.stage.status and not bound.stage.coordinates:
                group = f"status_{bound.stage.group}".replace("/", "_")
                numbers = tuple(
                    number
                    for number in sorted({self.plan.axis_number(key) for key in bound.needs})
                    if is_dimension(self.plan.axes[number])
                )
                label = f"state of {bound.name}"
                yield group, *self._status(bound.name, label, [bound], numbers)
        for name, bounds in of_shared.items():
            status = self._shared[name]
            group, _, variable = name.partition(":")
            numbers = tuple(self.plan.axis_number(one.key) for one in status.over)
            yield group, *self._status(variable, status.label, bounds, numbers)

    def _status(
        self, name: str, label: str, bounds: Sequence[Bound], numbers: tuple[int, ...]
    ) -> tuple[dict[str, Array], dict[str, Array]]:
        plan = self.plan
        shape = tuple(len(plan.axes[number].points) for number in numbers)
        worst = np.full(shape, DONE, dtype=np.int8)
        for bound in bounds:
            own = plan.axes_on(bound)
            at = [own.index(number) if number in own else None for number in numbers]
            for place in plan.cells(bound):
                key = plan.key(bound, place)
                if key not in self.spots:
                    point = tuple(slice(None) if k is None else place[k] for k in at)
                    if key in self.failed:
                        worst[point] = FAILED
                    else:
                        worst[point] = np.where(worst[point] == FAILED, FAILED, MISSING)
        names: list[str] = []
        for number in numbers:
            axis = plan.axes[number]
            taken = axis.name in (*names, name)
            names.append(
                self.plan.axes[number].settings[0].key.replace(".", "_") if taken else axis.name
            )
        attrs = {"units": "1", "long_name": label, **STATE}
        arrays = {name: Array.of(tuple(names), worst, attrs, MISSING)}
        labels: dict[str, Array] = {}
        for number, axis_name in zip(numbers, names, strict=True):
            axis = plan.axes[number]
            labels |= (
                joint_coordinates(axis, axis_name)
                if axis.is_joint
                else axis_coordinates(axis, axis_name)
            )
        return arrays, labels


def output_named(bound: Bound, name: str) -> Output:
    """Output of a stage."""
    return next(one for one in bound.stage.outputs if one.name == name)

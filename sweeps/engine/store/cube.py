"""The cube of a sweep: its cells laid out as labelled arrays, with coordinates of their axes."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.cache.packs import Arrays, Locations, distinct_layouts
from sweeps.engine.declare.errors import DeclarationError
from sweeps.engine.declare.kinds import format_value
from sweeps.engine.declare.settings import DIMENSION, Setting
from sweeps.engine.declare.stage import (
    COORDINATE,
    FIRST_PREFIX,
    MEASURED,
    SHARE,
    STATE,
    STATUS,
    BoundStage,
    Output,
)
from sweeps.engine.declare.storable import DATES
from sweeps.engine.declare.undeclared import UndeclaredOutput, infer_outputs, longest_arrays
from sweeps.engine.objects import Objects
from sweeps.engine.resolve.plan import Axis, Cells, Plan
from sweeps.engine.run.schedule import Schedule
from sweeps.engine.run.tasks import iter_results, uneven_error
from sweeps.engine.store.arrays import Array, ArrayGroup, Region, suggest_chunks

MISSING, FAILED, DONE = -1, 0, 1
FLAGS = {"flag_values": [MISSING, FAILED, DONE], "flag_meanings": "missing failed done"}

MEASURED_COMMENT = "measured while the cell was computed; differs if computed again"


@dataclass(frozen=True)
class StoredVariable:
    """An output of a stage as a variable of the store."""

    bound: BoundStage
    output: Output
    group: str
    name: str  # in its group
    axes: tuple[int, ...]  # numbers of the axes that are dimensions, in their order
    order: tuple[int, ...]  # index of each dimension among `axes`, then inner dimensions

    @property
    def origin(self) -> dict[str, Output]:
        """The outputs with the index at which a cell begins, by inner dimension."""
        return self.bound.stage.origin(self.output)


@dataclass(frozen=True, eq=False)
class RegionReader:
    """Picklable recipe for one region of a variable.

    `present` and `failed` are flat positions, along the axes, of results and of failed cells.
    """

    packs: Objects
    locations: Locations  # of the results
    stage: str
    output: Output
    fixed_shape: bool  # whether all arrays have one shape
    shape: tuple[int, ...]  # along the axes
    inner_starts: tuple[int, ...]  # starts of inner dimensions
    inner_lengths: tuple[int, ...]  # and lengths
    inner_region: tuple[slice, ...]  # part of them in the region
    order: tuple[int, ...]  # of the dimensions, axes and inner
    present: Cells
    failed: Cells

    def read(self, region: Region) -> NDArray[Any]:
        """Return the values of the region; raise `DamagedResultsError` if a cell is damaged."""
        output, lengths = self.output, self.inner_lengths
        dtype, empty = output.store_dtype
        flat = np.full((math.prod(self.shape), *lengths), empty, dtype=dtype)
        flat[self.failed] = FAILED
        cells = iter_results(self.packs, self.locations)
        for number, arrays in zip(self.present.tolist(), cells, strict=True):
            array = arrays.get(output.name)
            if array is None:  # an undeclared output that this cell lacks
                continue
            if array.shape == lengths:
                flat[number] = array
                continue
            if self.fixed_shape:
                raise uneven_error(self.stage, output.name, array.shape, lengths)
            if output.pad is not None:
                flat[number] = output.pad
            corner = map(int.__sub__, _start_indices(output, arrays), self.inner_starts)
            ends = zip(corner, array.shape, strict=True)
            cell_region: Any = [slice(begin, begin + size) for begin, size in ends]
            flat[(number, *cell_region)] = array
        inner_index: Any = (..., *self.inner_region)
        return flat.reshape((*self.shape, *lengths))[inner_index].transpose(self.order)


def _start_indices(output: Output, arrays: Arrays) -> list[int]:
    """Return the index at which a cell begins on each inner dimension."""
    return [int(arrays.get(f"{FIRST_PREFIX}{dim}", 0)) for dim in output.dims]


def stored_variables(
    plan: Plan, bound: BoundStage, outputs: Iterable[Output]
) -> list[StoredVariable]:
    """Return the variables of a stage's stored outputs."""
    stage_group = bound.stage.group
    order = {name: number for number, name in enumerate(stage_group.dims)}

    def rank(number: int) -> int:
        axis = plan.axes[number]
        renamed = stage_group.names.get(axis.settings[0], "")
        words = [renamed, axis.name, *(setting.name for setting in axis.settings)]
        return min((order[word] for word in words if word in order), default=-1)

    variables = []
    for output in outputs:
        group, name = bound.stage.stored_as(output)
        if not group:
            continue
        left_out = set(output.without)
        axes = [
            number
            for number in sorted(_dimensions(plan, bound), key=rank)
            if not {setting.name for setting in plan.axes[number].settings} <= left_out
        ]
        ranks = [*map(rank, axes), *(order.get(dim, len(order)) for dim in output.dims)]
        sources = tuple(np.argsort(ranks, kind="stable").tolist())
        variables.append(StoredVariable(bound, output, group, name, tuple(axes), sources))
    return variables


def _dimensions(plan: Plan, *bounds: BoundStage) -> list[int]:
    """Return numbers of the axes that become dimensions, even with one value."""
    numbers = {plan.axis_number(key) for bound in bounds for key in bound.needs}
    axes = [(number, plan.axes[number]) for number in sorted(numbers)]
    fixed = {n for n, axis in axes if any(setting.role == DIMENSION for setting in axis.settings)}
    return [n for n, axis in axes if axis.is_swept or n in fixed]


@dataclass
class Cube:
    """The arrays of a store, read from the finished cells of a schedule."""

    schedule: Schedule
    packs: Objects
    # By group: starts of inner dimensions that have an origin, and lengths of all.
    _extents: dict[str, tuple[dict[str, int], dict[str, int]]] = field(default_factory=dict)

    @property
    def plan(self) -> Plan:
        """The plan of the cells."""
        return self.schedule.plan

    def groups(self) -> dict[str, ArrayGroup]:
        """Return groups of the store by path; raise `DamagedResultsError` if a cell is damaged."""
        members: dict[str, list[StoredVariable]] = defaultdict(list)
        group_coordinates: dict[str, dict[str, Array]] = defaultdict(dict)
        for bound in self.plan.targets:
            outputs, coordinates = self._outputs(bound)
            for variable in stored_variables(self.plan, bound, outputs):
                members[variable.group].append(variable)
            group_coordinates[bound.stage.group.path] |= coordinates
        groups = {name: self._group(variables) for name, variables in members.items()}
        for name, arrays in group_coordinates.items():
            groups[name].arrays.update(arrays)
        if states := self._states(members[STATUS]):
            groups.setdefault(STATUS, ArrayGroup()).arrays.update(states)
        return dict(sorted(groups.items()))

    def _outputs(self, bound: BoundStage) -> tuple[Sequence[Output], dict[str, Array]]:
        """Return the outputs of a stage, and the coordinates that all its results share.

        Infer the outputs that are not declared; only these have such coordinates.
        """
        output = bound.stage.outputs[0] if bound.stage.outputs else None
        if not isinstance(output, UndeclaredOutput):
            return bound.stage.outputs, {}
        results = np.unique(self.schedule.results[bound])
        locations = self.schedule.locations[results[self.schedule.locations.present[results]]]
        inferred = infer_outputs(output, distinct_layouts(self.packs, locations))
        names = [variable.name for variable in inferred if variable.role == COORDINATE]
        values = longest_arrays(iter_results(self.packs, locations), names) if names else {}
        coordinates = {}
        for variable in inferred:
            if values.get(variable.name) is not None:
                attrs = {"units": variable.unit, "long_name": variable.label, **variable.attrs}
                array = Array.from_values(
                    variable.dims, values[variable.name], attrs, coordinate=True
                )
                coordinates[variable.name] = array
            elif variable.name in variable.dims:
                raise DeclarationError(
                    f"{output.name} returned other labels of the dimension {variable.name!r} for "
                    "other arguments; return them as a variable of another name"
                )
        return [variable for variable in inferred if variable.name not in coordinates], coordinates

    def _group(self, variables: Sequence[StoredVariable]) -> ArrayGroup:
        """Return a group of its variables, and the coordinates of their dimensions."""
        names, arrays = self._names(variables), dict[str, Array]()
        starts, lengths = self._extents[variables[0].group] = self._find_extents(variables)
        for variable in variables:
            for dim, first in variable.origin.items():
                values = starts.get(dim, 0) + np.arange(lengths[dim])
                attrs = {"units": first.unit, "long_name": first.label}
                arrays[dim] = Array.from_values((dim,), values, attrs, coordinate=True)
            arrays[variable.name] = self._variable(variable, names)
        return ArrayGroup(arrays | self._coordinates(variables, names))

    def _names(self, variables: Sequence[StoredVariable]) -> dict[int, str]:
        """Return the names of all axes of a group: the full key if its last word is taken."""
        axes, number_of = self.plan.axes, self.plan.axis_number
        names = {
            number_of(key): axes[number_of(key)].name
            for variable in variables
            for key in variable.bound.gather
            if axes[number_of(key)].name in variable.output.dims
        }
        bounds = {
            number_of(key): variable.bound
            for variable in reversed(variables)
            for key in variable.bound.needs
        }
        for number in (*_dimensions(self.plan, *bounds.values()), *sorted(bounds)):
            setting = axes[number].settings[0]
            name = bounds[number].stage.group.names.get(setting) or axes[number].name
            is_taken = name in (*names.values(), *(variable.name for variable in variables))
            names.setdefault(number, setting.key.replace(".", "_") if is_taken else name)
        return names

    def _variable(self, variable: StoredVariable, names: Mapping[int, str]) -> Array:
        """Return the variable of an output."""
        output, (_, lengths) = variable.output, self._extents[variable.group]
        inner_lengths = [lengths[dim] for dim in output.dims]
        shape = (*(len(self.plan.axes[number].points) for number in variable.axes), *inner_lengths)
        dims = (*(names[number] for number in variable.axes), *output.dims)
        dtype, empty = output.store_dtype
        chunks = suggest_chunks(shape, dtype.itemsize, whole=len(inner_lengths))
        words = dtype.kind == "U"
        attrs: dict[str, Any] = {} if dtype.kind in "UM" else {"units": output.unit}
        attrs |= {"long_name": output.label, **output.attrs}
        if output.role == SHARE:  # xarray decodes it to numbers from 0 to 1, and NaN
            attrs["scale_factor"] = 1 / int(np.iinfo(output.dtype).max)
            attrs["_FillValue"] = empty
        if output.role == MEASURED:
            attrs["comment"] = MEASURED_COMMENT
        if output.role == STATE:
            attrs |= FLAGS
        ordered: Any = (
            tuple(values[k] for k in variable.order) for values in (dims, shape, chunks)
        )
        ordered_dims, sizes, chunk_shape = ordered
        make_reader, coordinate = partial(self._make_reader, variable), output.role == COORDINATE

        def read(region: Region) -> NDArray[Any]:
            return make_reader(region)(region)

        if words:  # texts are few, and stored no wider than the longest
            texts = read(tuple(slice(0, size) for size in sizes))
            return Array.from_values(ordered_dims, texts, attrs, coordinate=coordinate)
        return Array(
            *(ordered_dims, sizes, dtype, attrs, read, chunk_shape, empty, coordinate),
            source_bytes=partial(self._source_bytes, variable),
            remote_read=make_reader,
        )

    def _results(self, variable: StoredVariable, ranges: Sequence[range]) -> Cells:
        """Return numbers of the results in ranges of a variable's axes, the last fastest."""
        plan, bound = self.plan, variable.bound
        by_axis = dict(zip(variable.axes, ranges, strict=True))
        stage_axes = plan.axis_numbers(bound)
        results = self.schedule.results[bound]
        results = results.reshape([len(plan.axes[number].points) for number in stage_axes])
        results = results[np.ix_(*(by_axis.get(number, (0,)) for number in stage_axes))]
        order = [stage_axes.index(number) for number in variable.axes if number in stage_axes]
        remaining = [
            position for position, number in enumerate(stage_axes) if number not in by_axis
        ]
        return results.transpose(order + remaining).ravel()

    def _find_extents(
        self, variables: Sequence[StoredVariable]
    ) -> tuple[dict[str, int], dict[str, int]]:
        """Return starts of inner dimensions with an origin, and lengths of all, over all cells."""
        ends: dict[tuple[str, bool], tuple[int, int]] = {}  # by dimension and if it has an origin
        lengths: dict[str, int] = {}
        for variable in variables:
            output, axes = variable.output, self.plan.axes
            numbers = map(self.plan.axis_number, variable.bound.gather)
            gathered = {axes[n].name: len(axes[n].points) for n in numbers}
            lengths |= {dim: max(lengths.get(dim, 0), gathered.get(dim, 0)) for dim in output.dims}
            if gathered.keys() >= set(output.dims):
                continue
            origin, even = variable.origin, variable.bound.stage.has_fixed_shape(output)
            results = self._results(variable, [range(len(axes[n].points)) for n in variable.axes])
            results = results[self.schedule.locations.present[results]]
            results = results[:1] if even else np.unique(results)
            for arrays in iter_results(self.packs, self.schedule.locations[results]):
                if output.name not in arrays:
                    continue
                shape = arrays[output.name].shape
                begins = _start_indices(output, arrays)
                for dim, begin, size in zip(output.dims, begins, shape, strict=True):
                    low, high = ends.get((dim, dim in origin), (begin, begin))
                    ends[dim, dim in origin] = min(low, begin), max(high, begin + size)
        for (dim, _), (low, high) in ends.items():
            lengths[dim] = max(lengths[dim], high - low)
        return {dim: low for (dim, has_origin), (low, _) in ends.items() if has_origin}, lengths

    def _make_reader(
        self, variable: StoredVariable, region: Region
    ) -> Callable[[Region], NDArray[Any]]:
        """Return a picklable reader of a region of a variable."""
        output, (starts, lengths) = variable.output, self._extents[variable.group]
        ranges, inner_region, results = self._split_region(variable, region)
        state = output.role == STATE
        failed = np.flatnonzero(np.isin(results, [*self.schedule.failed])) if state else results[:0]
        present = np.flatnonzero(self.schedule.locations.present[results])
        return RegionReader(
            self.packs,
            self.schedule.locations[results[present]].compact(),
            variable.bound.name,
            output,
            variable.bound.stage.has_fixed_shape(output),
            shape=tuple(map(len, ranges)),
            inner_starts=tuple(
                starts.get(dim, 0) if dim in variable.origin else 0 for dim in output.dims
            ),
            inner_lengths=tuple(lengths[dim] for dim in output.dims),
            inner_region=inner_region,
            order=variable.order,
            present=present,
            failed=failed,
        ).read

    def _source_bytes(self, variable: StoredVariable, region: Region) -> bytes:
        """Return bytes that determine the values of a region: keys of cells and their layout."""
        output, (starts, lengths) = variable.output, self._extents[variable.group]
        _, inner_region, results = self._split_region(variable, region)
        locations, failed = self.schedule.locations, self.schedule.failed
        keys = np.where(locations.present[results, None], locations.keys[results], 0)
        flags = np.isin(results, [*failed]) if output.role == STATE else np.empty(0, bool)
        extents = [(dim, starts.get(dim), lengths[dim]) for dim in output.dims]
        layout = [output.name, output.pad, variable.order, extents, [*inner_region]]
        return repr(layout).encode() + flags.tobytes() + keys.tobytes()

    def _split_region(
        self, variable: StoredVariable, region: Region
    ) -> tuple[list[range], Region, Cells]:
        """Return the ranges of axes in a region, its inner dimensions, and its results."""
        natural = [region[k] for k in np.argsort(variable.order)]
        count = len(variable.axes)
        ranges = [range(span.start, span.stop) for span in natural[:count]]
        return ranges, tuple(natural[count:]), self._results(variable, ranges)

    def _coordinates(
        self, variables: Sequence[StoredVariable], names: Mapping[int, str]
    ) -> dict[str, Array]:
        """Return the coordinates of all axes; an axis that is no dimension has a scalar."""
        coordinates: dict[str, Array] = {}
        dims = {dim for variable in variables for dim in variable.output.dims}
        for number, name in names.items():
            axis = self.plan.axes[number]
            if name in dims or any(number in variable.axes for variable in variables):
                coordinates |= axis_coordinates(axis, name)
            elif not axis.is_swept:
                for setting, value in zip(axis.settings, axis.points[0], strict=True):
                    if setting.role == COORDINATE:
                        label = setting.name if axis.is_zipped else name
                        coordinates |= setting_coordinates(setting, label, [value], scalar=True)
        return coordinates

    def _states(self, variables: Sequence[StoredVariable]) -> dict[str, Array]:
        """Return the states of stages; `variables` are the states that stages return themselves."""
        members: dict[tuple[str, str, tuple[int, ...]], list[BoundStage]] = defaultdict(list)
        for bound in self.plan.targets:
            status = bound.stage.group.status
            if all(output.role == COORDINATE for output in bound.stage.outputs):
                continue
            if status is None:
                over = tuple(_dimensions(self.plan, bound))
                members[bound.name, f"state of {bound.name}", over].append(bound)
            elif status.over:
                over = tuple(self.plan.axis_number(setting.key) for setting in status.over)
                members[status.name, status.label, over].append(bound)
        names = self._names(variables)
        used_names = [
            *names.values(),
            *(variable.name for variable in variables),
            *(name for name, *_ in members),
        ]
        arrays: dict[str, Array] = {}
        for number in sorted({number for *_, over in members for number in over} - names.keys()):
            axis = self.plan.axes[number]
            key = axis.settings[0].key.replace(".", "_")
            names[number] = key if axis.name in used_names else axis.name
            used_names.append(names[number])
        for (name, label, over), bounds in members.items():
            for number in over:
                arrays |= axis_coordinates(self.plan.axes[number], names[number])
            attrs = {"units": "1", "long_name": label, **FLAGS}
            dims = tuple(names[number] for number in over)
            arrays[name] = Array.from_values(dims, self._worst_state(bounds, over), attrs, MISSING)
        return arrays

    def _worst_state(
        self, bounds: Sequence[BoundStage], numbers: Sequence[int]
    ) -> NDArray[np.int8]:
        """Return the worst state of some stages along axes."""
        plan = self.plan
        worst = np.full([len(plan.axes[number].points) for number in numbers], DONE, dtype=np.int8)
        for bound in bounds:
            results, stage_axes = self.schedule.results[bound], plan.axis_numbers(bound)
            present = self.schedule.locations.present[results]
            failed = np.isin(results, [*self.schedule.failed])
            for state, flags in ((MISSING, ~present & ~failed), (FAILED, failed)):
                cells = np.flatnonzero(flags)
                point = tuple(
                    plan.positions(bound, number, cells) if number in stage_axes else slice(None)
                    for number in numbers
                )
                if len(cells):
                    worst[point] = np.where(worst[point] == FAILED, FAILED, state)
        return worst


# coordinates --------------------------------------------------------------------------------------


def axis_coordinates(axis: Axis, name: str) -> dict[str, Array]:
    """Return the coordinates of an axis: the values of its settings.

    Positions of a zipped axis are labelled by their values, as in 'mass=3,limit=9', unless they
    have labels. The kind of a setting may add others.
    """
    columns = list(zip(*axis.points, strict=True))
    if not axis.is_zipped:
        return setting_coordinates(axis.settings[0], name, columns[0])
    coordinates: dict[str, Array] = {}
    for setting, values in zip(axis.settings, columns, strict=True):
        is_taken = setting.name in (*coordinates, *[name] * (not axis.unlabelled))
        label = setting.key.replace(".", "_") if is_taken else setting.name
        array = value_array(values)
        coordinates[label] = Array.from_values((name,), array, setting.attrs, coordinate=True)
    if axis.unlabelled:
        return coordinates
    labels = axis.labels or [
        ",".join(
            f"{label}={format_value(value)}"
            for label, value in zip(coordinates, point, strict=True)
        )
        for point in axis.points
    ]
    attrs = {"long_name": " and ".join(setting.label for setting in axis.settings) + ", together"}
    return {
        name: Array.from_values((name,), np.array(labels), attrs, coordinate=True),
        **coordinates,
    }


def setting_coordinates(
    setting: Setting, name: str, values: Sequence[Any], *, scalar: bool = False
) -> dict[str, Array]:
    """Return coordinates of a setting's values as its kind defines them, the main one first."""
    kind_coordinates = setting.kind.coordinates(tuple(values))
    if kind_coordinates is None:
        kind_coordinates = {name: (value_array(values), setting.attrs)}
    else:
        (_, main), *extra = kind_coordinates.items()
        kind_coordinates = {**({} if scalar else {name: main}), **dict(extra)}
    dims: tuple[str, ...] = () if scalar else (name,)
    return {
        label: Array.from_values(dims, array[0] if scalar else array, attrs, coordinate=True)
        for label, (array, attrs) in kind_coordinates.items()
    }


def value_array(values: Sequence[Any]) -> NDArray[Any]:
    """Return a (value,) ndarray: floats (NaN for null), integers, booleans, times or texts."""
    if any(isinstance(value, str | tuple) for value in values):
        # Convert subclasses to plain types.
        return np.array([str(value) for value in values])
    if isinstance(values[0], np.datetime64 | datetime):
        return np.array(values, dtype=DATES)
    return np.array(values, dtype=float if None in values else None)

"""Run tasks on a worker: read or build the inputs of calls, and pack their results.

A task has batches of calls, each of one function. A call computes one cell, or several along the
axes that its stage computes together. A batch has the arguments of all its calls: plain values,
arrays from packs, stacks of such arrays, or objects made by another stage in this process, which
keeps the last few objects of each stage.
"""

from __future__ import annotations

import os
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pkgutil import resolve_name
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.cache.packs import Arrays, Locations, Pack, PackWriter, iter_cells
from sweeps.engine.declare.errors import DeclarationError
from sweeps.engine.declare.failures import (
    RAISED,
    Failure,
    format_arguments,
    format_traceback,
    one_line,
)
from sweeps.engine.declare.stage import FIRST_PREFIX, RNG, VALID, Output, Stage
from sweeps.engine.declare.undeclared import FLOAT, UndeclaredOutput, split_variables
from sweeps.engine.objects import Objects
from sweeps.engine.resolve.code import MAIN, find_attribute, module_and_name
from sweeps.engine.resolve.keys import Keys
from sweeps.engine.resolve.streams import cell_rng

AHEAD_BYTES = 2**25  # of inputs that are prefetched at once
AHEAD_CALLS = 512
INT_LIMIT = 2**63  # just above the largest integer of numpy


@dataclass(frozen=True)
class StageSpec:
    """Part of a stage that workers need."""

    name: str
    import_path: str  # module and qualified name of its function
    function: Callable[..., Any] | None  # itself, if workers cannot import it
    outputs: tuple[Output, ...]
    fixed_shape: tuple[str, ...]  # names of outputs of one shape in all cells
    keep: int  # number of results in memory, of a stage that is not cached

    @property
    def resolved_function(self) -> Callable[..., Any]:
        """The stage's function, imported if necessary."""
        function: Any = self.function or resolve_name(self.import_path)
        return function.function if isinstance(function, Stage) else function


@cache
def stage_spec(stage: Stage) -> StageSpec:
    """Return the part of a stage that workers need."""
    function, (module, name) = stage.function, module_and_name(stage.function)
    imported = find_attribute(module, name) if module != MAIN else None
    local_function = None if getattr(imported, "function", imported) is function else function
    stored = (output for output in stage.outputs if stage.stored_as(output)[0])
    fixed = tuple(output.name for output in stored if stage.has_fixed_shape(output))
    return StageSpec(
        stage.name, f"{module}:{name}", local_function, stage.outputs, fixed, stage.keep
    )


@dataclass(frozen=True, eq=False)
class ValueArgument:
    """A plain argument of many calls: its distinct values and each call's index into them."""

    values: tuple[Any, ...]
    indices: NDArray[np.int32]

    @cached_property
    def per_call(self) -> list[Any]:
        """The value of each call."""
        return [self.values[index] for index in self.indices.tolist()]


@dataclass(frozen=True, eq=False)
class StoredArgument:
    """An argument of many calls that is read from packs.

    `locations` are (call,) or, of an argument that is an array of several cells, (call, ...).
    """

    stage: StageSpec
    locations: Locations
    in_blocks: bool = False  # each call gets `GatheredArray`


@dataclass(frozen=True, eq=False)
class ObjectArgument:
    """An argument of many calls that is an object made here: each call's index in `batch`."""

    batch: Batch
    indices: NDArray[np.int32]


Argument = ValueArgument | StoredArgument | ObjectArgument


@dataclass(frozen=True, eq=False)
class Batch:
    """Calls of one function: their arguments by name, and the cells that they compute.

    Call k computes the cells `begins[k]` to `begins[k + 1]`, which have `keys`, (cell, 2), and flat
    `positions`, (cell,), on the axes of lengths `shape` that it computes together. A call that
    makes an object has one cell.
    """

    stage: StageSpec
    arguments: Mapping[str, Argument]
    keys: Keys
    begins: NDArray[np.int64]
    positions: NDArray[np.int64]
    shape: tuple[int, ...] = ()
    folder: str = ""  # folder of the packs
    streams: tuple[tuple[int, dict[str, Any]], ...] = ()  # seed and name of the `rng` of each
    valid: NDArray[np.bool_] | None = None  # (call, ...): flags of each

    def __len__(self) -> int:
        return len(self.begins) - 1


class Outcome(NamedTuple):
    """Outcome of some calls: their time [s], and the failures by number of the cell.

    `damaged_inputs` maps the number of each skipped call to the keys of its damaged inputs. `pack`
    has all other cells in their order.
    """

    seconds: float
    failed: Mapping[int, Failure] = {}
    damaged_inputs: Mapping[int, tuple[bytes, ...]] = {}
    pack: Pack | None = None


class TaskReport(NamedTuple):
    """Outcomes of the calls of a task."""

    outcomes: tuple[Outcome, ...]
    write_error: OSError | None = None  # why results could not be packed, if so
    # Stage, name and shape of outputs that have one shape in all cells.
    shapes: tuple[tuple[str, str, tuple[int, ...]], ...] = ()


class DamagedResultsError(Exception):
    """Results in the cache are damaged; the arguments are their keys, as bytes."""


def iter_results(packs: Objects, locations: Locations) -> Iterator[Arrays]:
    """Yield the arrays of cells; raise `DamagedResultsError` if one cannot be read back."""
    for key, arrays in zip(locations.keys, iter_cells(packs, locations), strict=True):
        if arrays is None:
            raise DamagedResultsError(key.tobytes())
        yield arrays


def run_batches(batches: tuple[Batch, ...], order: Iterable[int], packs: Objects) -> TaskReport:
    """Run calls in order, even if some raise, and pack their results.

    `order` has, for each call, the number of its batch.
    """
    running = [_RunningBatch(batch, packs) for batch in batches]
    for number in order:
        running[number].run()
    outcomes = []
    for batch in running:
        try:
            outcomes.append(batch.outcome())
        except OSError as error:
            return TaskReport((), write_error=error)
    return TaskReport(
        tuple(outcomes),
        shapes=tuple(sorted({shape for batch in running for shape in batch.shapes})),
    )


def uneven_error(
    stage: str, output: str, shape: tuple[int, ...], other: tuple[int, ...]
) -> DeclarationError:
    """Return the error of an output whose shape differs between cells but has no `pad`."""
    return DeclarationError(
        f"stage {stage}: {output} has the shape {shape} in one cell and {other} in another, but no "
        f"value to pad it with; declare pad=..., or an output {FIRST_PREFIX}{{dimension}}"
    )


class _RunningBatch:
    """State of the calls of a batch."""

    def __init__(self, batch: Batch, packs: Objects) -> None:
        self.batch, self.packs = batch, packs
        self.function, self.working_folder = batch.stage.resolved_function, os.getcwd()
        self.begins: list[int] = batch.begins.tolist()
        self.packing = PackWriter()
        self.next = 0
        self.packed: list[int] = []  # numbers of cells that are packed
        self.seconds = 0.0
        self.failed: dict[int, Failure] = {}
        self.damaged_inputs: dict[int, tuple[bytes, ...]] = {}
        self.shapes: set[tuple[str, str, tuple[int, ...]]] = set()
        self._inputs = _prefetch_inputs(batch, packs)

    def run(self) -> None:
        """Run the next call."""
        batch, stage, number = self.batch, self.batch.stage, self.next
        self.next += 1
        begin, end = self.begins[number], self.begins[number + 1]
        inputs = next(self._inputs)
        start = time.perf_counter()
        arguments: dict[str, Any] = {}
        try:
            arguments = _read_arguments(batch, number, inputs, self.packs)
            cells = self._call_and_check(number, arguments)
        except DamagedResultsError as error:
            self.damaged_inputs[number] = error.args
            return
        except RAISED as error:
            if batch.streams:  # enough to recreate the generator
                seed, name = batch.streams[number]
                arguments[RNG] = f"cell_rng({seed}, **{name})"
            failure = Failure(
                "", one_line(error), format_arguments(arguments), format_traceback(error)
            )
            self.failed |= dict.fromkeys(range(begin, end), failure)
            return
        self.seconds += time.perf_counter() - start
        for cell, arrays in enumerate(cells, begin):
            self.packing.add(arrays)
            self.packed.append(cell)
        for output in stage.fixed_shape:  # all cells of a call are slices of one array
            self.shapes.add((stage.name, output, cells[0][output].shape))

    def _call_and_check(self, number: int, arguments: Mapping[str, Any]) -> list[Arrays]:
        """Call the function, check its result, and return the arrays of each cell."""
        batch, stage = self.batch, self.batch.stage
        try:
            result = self.function(**arguments)
        finally:
            _restore_folder(self.working_folder)
        arrays = check_result(stage.name, stage.outputs, result, batch.shape)
        if not batch.shape:
            return [arrays]
        cells: list[Arrays] = []
        for position in batch.positions[batch.begins[number] : batch.begins[number + 1]].tolist():
            # The ellipsis makes it an array even for one value.
            index: Any = (*np.unravel_index(position, batch.shape), ...)
            cells.append({name: array[index] for name, array in arrays.items()})
        return cells

    def outcome(self) -> Outcome:
        """Write the pack of all cells; return the outcome."""
        if not self.packed:
            return Outcome(self.seconds, self.failed, self.damaged_inputs)
        keys, name = self.batch.keys[self.packed], self.batch.stage.name
        pack = self.packing.write(self.packs, name, keys, self.seconds, self.batch.folder)
        return Outcome(self.seconds, self.failed, self.damaged_inputs, pack)


def _restore_folder(folder: str) -> None:
    """Change back to the working folder, if a call has left it."""
    with suppress(FileNotFoundError):  # the current folder was deleted
        if os.getcwd() == folder:
            return
    os.chdir(folder)


# arguments --------------------------------------------------------------------------------------

Inputs = dict[str, Any]
"""Stored inputs of a call by argument: arrays, a `GatheredArray`, or an error."""


def _prefetch_inputs(batch: Batch, packs: Objects, start: int = 0) -> Iterator[Inputs]:
    """Yield the stored inputs of each call from `start` on, prefetching up to `AHEAD_BYTES`.

    Opening a pack takes longer than reading a small cell in it.
    """
    stored = {
        name: argument
        for name, argument in batch.arguments.items()
        if isinstance(argument, StoredArgument)
    }
    if not stored:
        yield from ({} for _ in range(start, len(batch)))
        return
    window = 1
    while start < len(batch):
        stop = min(start + window, len(batch))
        prefetched, size = _read_inputs(stored, packs, start, stop)
        while prefetched:
            yield prefetched.pop(0)  # without a reference, to free its memory
        fitting = AHEAD_BYTES * (stop - start) // max(size, 1)
        start, window = stop, min(max(fitting, 1), 8 * window, AHEAD_CALLS)


def _read_inputs(
    stored: Mapping[str, StoredArgument], packs: Objects, start: int, stop: int
) -> tuple[list[Inputs], int]:
    """Return the stored inputs of the calls from `start` to `stop`, and their size in bytes."""
    calls: list[Inputs] = [{} for _ in range(start, stop)]
    size = 0
    for name, argument in stored.items():
        locations = argument.locations[start:stop]
        if locations.pack.ndim > 1:  # several cells, which are read when the call runs
            for number, inputs in enumerate(calls):
                inputs[name] = GatheredArray(argument.stage, locations[number], packs)
            continue
        for inputs, key, arrays in zip(
            calls, locations.keys, iter_cells(packs, locations), strict=True
        ):
            inputs[name] = arrays or DamagedResultsError(key.tobytes())
            size += sum(array.nbytes for array in (arrays or {}).values())
    return calls, size


def _read_arguments(batch: Batch, number: int, inputs: Inputs, packs: Objects) -> dict[str, Any]:
    """Return the arguments of a call by name; raise `DamagedResultsError` if one is unreadable."""
    arguments: dict[str, Any] = {}
    for name, source in batch.arguments.items():
        if isinstance(source, ValueArgument):
            arguments[name] = source.per_call[number]
        elif isinstance(source, ObjectArgument):
            arguments[name] = _get_object(source.batch, int(source.indices[number]), packs)
        else:
            arrays = inputs.pop(name)
            if isinstance(arrays, DamagedResultsError):
                raise arrays
            if isinstance(arrays, GatheredArray) and not source.in_blocks:
                arrays = arrays.arrays(arrays.locations)
            if not source.in_blocks and len(arrays) == 1:
                arrays = arrays[source.stage.outputs[0].name]
            arguments[name] = arrays
    if batch.streams:
        seed, cell = batch.streams[number]
        arguments[RNG] = cell_rng(seed, **cell)
    if batch.valid is not None:
        arguments[VALID] = batch.valid[number].copy()
    return arguments


def _get_object(batch: Batch, number: int, packs: Objects) -> Any:
    """Return an in-memory object, built if missing, from a cache of `keep` objects per function."""
    # Keyed by the function's name, so that stages of one function share their results.
    # Functions of scripts and notebooks are unpickled anew for every task.
    objects = vars(_objects).setdefault(batch.stage.import_path, OrderedDict())
    key = batch.keys[number].tobytes()
    if key in objects:
        objects.move_to_end(key)
        return objects[key]
    while len(objects) >= batch.stage.keep:
        objects.popitem(last=False)
    # Inputs are prefetched for the objects that follow in the same batch.
    prefetched = vars(_prefetched)
    latest_batch, next_number, inputs = prefetched.get(batch.stage.import_path, (None, 0, None))
    if latest_batch is not batch or next_number != number:
        inputs = _prefetch_inputs(batch, packs, number)
    prefetched[batch.stage.import_path] = batch, number + 1, inputs
    objects[key] = new_object = batch.stage.resolved_function(
        **_read_arguments(batch, number, next(inputs), packs)
    )
    return new_object


@dataclass(frozen=True, eq=False, repr=False)
class GatheredArray:
    """The arrays of many cells as one array, read when it is indexed.

    `reshape` and indexing work as in numpy, but only on the axes of cells.
    """

    stage: StageSpec
    locations: Locations
    packs: Objects

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Numbers of cells, followed by the shape of one cell's array."""
        flat = self.locations.reshape(-1)
        first = flat[np.flatnonzero(flat.present)[:1]]
        [array] = self.arrays(first).values()
        return *self.locations.pack.shape, *array.shape[1:]

    def __len__(self) -> int:
        return self.shape[0]

    def reshape(self, *shape: int) -> GatheredArray:
        """Return the array with reshaped axes of cells; `shape` includes the axes of a cell."""
        cell_ndim = len(self.shape) - self.locations.pack.ndim
        return replace(self, locations=self.locations.reshape(*shape[: len(shape) - cell_ndim]))

    def __getitem__(self, index: Any) -> NDArray[Any]:
        """Return the arrays of some cells; raise `DamagedResultsError` if any is damaged."""
        locations, cell_shape = self.locations[index], self.shape[self.locations.pack.ndim :]
        if not locations.present.any():
            [output] = self.stage.outputs
            return np.full((*locations.pack.shape, *cell_shape), output.fill_value, output.dtype)
        [array] = self.arrays(locations).values()
        return array

    def arrays(self, locations: Locations) -> Arrays:
        """Return the arrays of cells by output, with fill values for missing cells."""
        present, stacks = locations.present, Arrays()
        cells = iter_results(self.packs, locations[present])
        for index, arrays in zip(np.flatnonzero(present).tolist(), cells, strict=True):
            for output in self.stage.outputs:
                name, array = output.name, arrays[output.name]
                if name not in stacks:
                    shape = (present.size, *array.shape)
                    stacks[name] = np.full(shape, output.fill_value, output.dtype)
                if array.shape != stacks[name].shape[1:]:
                    label = f"{name} of {self.stage.name}"
                    raise ValueError(f"{label} has a shape that differs between cells")
                stacks[name][index] = array
        return {
            name: stack.reshape(*present.shape, *stack.shape[1:]) for name, stack in stacks.items()
        }


# By function: its objects, and the latest batch with its prefetched inputs.
_objects, _prefetched = threading.local(), threading.local()


def drop_objects() -> None:
    """Drop all in-memory objects of this thread, and their prefetched inputs."""
    for local in (_objects, _prefetched):
        vars(local).clear()


# results of a call --------------------------------------------------------------------------------


# By kind of dtype (see numpy), the kinds that may be cast to it if every value survives.
CASTABLE_KINDS = {"f": "biuf", "i": "biuf", "u": "biuf", "b": "biuf", "c": "biufc"}

_dtype = cache(np.dtype)


@cache
def _max_float(dtype: str) -> float:
    return float(np.finfo(dtype).max)


def check_result(
    stage: str, outputs: Sequence[Output], result: Any, leading_shape: tuple[int, ...]
) -> Arrays:
    """Return the arrays of a result by output, of the declared dtypes.

    `leading_shape` are the lengths of the leading axes, along which values are computed together.

    Raises
    ------
    TypeError
        If an output is missing, has another shape, or would lose values in its dtype. One sentence
        with stage, output, returned and allowed values.
    """
    first = outputs[0]
    if isinstance(first, UndeclaredOutput):
        if first.is_number and _is_number(
            result
        ):  # fast path: many functions return a plain number
            return {first.name: np.array(result, FLOAT)}
        declared, meta = split_variables(first, result)
        arrays = {
            output.name: _check_output(stage, output, values, ()) for output, values in declared
        }
        return arrays | ({meta: np.empty(0, "u1")} if meta else {})
    names = [output.name for output in outputs]
    if not isinstance(result, Mapping) and len(names) == 1:
        result = {names[0]: result}
    returned = list(result) if isinstance(result, Mapping) else [type(result).__name__]
    if set(returned) != set(names):
        problem = f"{stage} returned {', '.join(map(str, returned))}"
        raise TypeError(f"{problem}, but must return {', '.join(names)}")
    return {
        output.name: _check_output(stage, output, result[output.name], leading_shape)
        for output in outputs
    }


def _is_number(value: Any) -> bool:
    return isinstance(value, float) or (isinstance(value, int) and abs(value) < INT_LIMIT)


def _check_output(
    stage: str, output: Output, values: Any, leading_shape: tuple[int, ...]
) -> NDArray[Any]:
    """Return one output as an array."""
    dtype = _dtype(output.dtype)
    if dtype.kind == "f" and _is_number(values) and abs(values) <= _max_float(output.dtype):
        array = np.array(values, dtype)  # fast path: the general path takes 10 us
    elif values is None:
        hint = f"values that the dtype {output.dtype} holds; a return may be missing"
        raise _output_error(stage, output, "None", hint)
    else:
        try:
            array, masked = _split_mask(values)
        except ValueError:
            raise _output_error(stage, output, "rows of different lengths", "an array") from None
        if array.dtype != dtype:
            array = _cast(stage, output, array, dtype)
        if masked.any():
            if dtype.kind not in "fc":
                raise _output_error(stage, output, "masked values")
            array = np.where(masked, dtype.type(np.nan), array)
    count = len(leading_shape)
    if array.shape[:count] != leading_shape or array.ndim != count + len(output.dims):
        leading = f" after {leading_shape}, the values computed together" if leading_shape else ""
        allowed = f"one of {len(output.dims)} dimensions{leading}"
        raise _output_error(stage, output, f"an array of shape {array.shape}", allowed)
    return array


def _split_mask(values: Any) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return values as an array, with 0 where masked, and its mask; stack lists of arrays."""
    is_list = isinstance(values, list | tuple)
    if isinstance(values, np.ma.MaskedArray) or (
        is_list and any(isinstance(value, np.ma.MaskedArray) for value in values)
    ):
        stacked = np.ma.stack([*map(np.ma.asarray, values)]) if is_list else values
        return np.asarray(stacked.filled(0)), np.ma.getmaskarray(stacked)
    return np.asarray(values), np.zeros((), bool)


def _cast(stage: str, output: Output, array: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return an array in another dtype; raise TypeError if more than float precision is lost."""
    texts = dtype.kind in "SU" and all(isinstance(value, str | bytes) for value in array.flat)
    castable = CASTABLE_KINDS.get(dtype.kind, dtype.kind)
    if not texts and array.dtype.kind not in castable and array.size:
        kind = f"values of dtype {array.dtype}"
        odd = next((value for value in array.flat if value is None), kind)
        raise _output_error(stage, output, str(odd))
    with np.errstate(all="ignore"):
        cast = array.astype(dtype)
        lost = np.isinf(cast) & np.isfinite(array) if dtype.kind in "fc" else cast != array
    if lost.any():
        raise _output_error(stage, output, repr(array[lost].flat[0].item()))
    return cast


def _output_error(stage: str, output: Output, returned: str, allowed: str = "") -> TypeError:
    allowed = allowed or f"values that the dtype {output.dtype} holds"
    return TypeError(f"{stage} returned {returned} as {output.name}, but must return {allowed}")

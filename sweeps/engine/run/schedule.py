"""Scheduling: find missing cells, group them into calls, and pack calls into tasks.

The calls of a stage become ready when all its inputs are done or failed. Stages that become ready
together are computed side by side, and calls that share in-memory objects are neighbours.
"""

from __future__ import annotations

import logging
from collections import Counter, defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from itertools import pairwise
from statistics import median
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.cache.index import CellIndex
from sweeps.engine.cache.packs import NO_LOCATIONS, Locations
from sweeps.engine.declare.failures import Failure
from sweeps.engine.declare.settings import Setting
from sweeps.engine.declare.stage import VALID, At, BoundStage
from sweeps.engine.resolve.keys import Keys, concatenate, hash_texts, unique_keys
from sweeps.engine.resolve.plan import Cells, Indices, Plan
from sweeps.engine.run.tasks import (
    Argument,
    Batch,
    ObjectArgument,
    Outcome,
    StoredArgument,
    ValueArgument,
    stage_spec,
)

LOG = logging.getLogger(__name__)
MAX_TASK_CELLS = 4096  # of one task
FAILED_KEY = hash_texts(["failed"])[0]  # instead of the key of a failed result

Flags = NDArray[np.bool_]
Call = tuple[BoundStage, Cells]  # cells of a stage that one call computes


@dataclass
class ReadyCalls:
    """Calls of stages that became ready together; call k has `cells[begins[k]:begins[k + 1]]`.

    Its stage is `stages[stage[k]]`. `objects`, (call, ...), numbers the in-memory objects that each
    call needs, dependencies first, padded with -1. Calls are sorted by it, so that calls with the
    most objects in common are neighbours.
    """

    stages: list[BoundStage]
    stage: Indices
    begins: Indices
    cells: Cells
    objects: Indices
    position: int = 0  # the first call that is left

    def __len__(self) -> int:
        return len(self.stage) - self.position

    def next_calls(self, limit: int) -> tuple[BoundStage, Indices]:
        """Return the stage of the next calls, and the bounds of their cells."""
        calls = self.stage[self.position : self.position + limit]
        count = int(np.argmax(np.append(calls != calls[0], True)))
        return self.stages[calls[0]], self.begins[self.position : self.position + count + 1]


class CallQueue:
    """Queue of calls that are ready."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._ready: deque[ReadyCalls] = deque()
        self._retries: deque[Call] = deque()
        self._objects: Keys = np.empty((0, 2), np.uint64)  # keys of in-memory objects, by number
        self.load: Counter[BoundStage] = Counter()  # cells

    def __bool__(self) -> bool:
        return bool(self._retries or self._ready)

    def add(self, ready: Mapping[BoundStage, Cells]) -> None:
        """Add calls for cells of stages, sorted by the in-memory objects that they share."""
        tables = [self._group_calls(number, *item) for number, item in enumerate(ready.items())]
        width = max(numbers.shape[1] for _, _, numbers, _ in tables)
        stage, lengths, cells = (np.concatenate([table[k] for table in tables]) for k in (0, 1, 3))
        objects = np.full((len(stage), width), -1, np.int32)
        filled = 0
        for _, _, numbers, _ in tables:
            objects[filled : filled + len(numbers), : numbers.shape[1]] = numbers
            filled += len(numbers)
        if width:
            order = np.lexsort(objects.T[::-1])
            begins = np.cumsum(lengths) - lengths
            stage, objects = stage[order], objects[order]
            lengths = lengths[order]
            moves = begins[order] - np.cumsum(lengths) + lengths
            cells = cells[np.arange(len(cells)) + np.repeat(moves, lengths)]
        begins = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)
        self._ready.append(ReadyCalls([*ready], stage, begins, cells, objects))
        self.load.update({bound: len(stage_cells) for bound, stage_cells in ready.items()})

    def retry(self, bound: BoundStage, cells: Cells) -> None:
        """Add a call before all others."""
        self._retries.append((bound, cells))
        self.load[bound] += len(cells)

    def _group_calls(
        self, number: int, bound: BoundStage, cells: Cells
    ) -> tuple[Indices, Indices, Indices, Cells]:
        """Return stage, number of cells and in-memory objects of each call, and the cells of all.

        Cells that differ only on axes computed together share a call.
        """
        starts = self._plan.first_cells(bound, cells)
        objects = np.array(self._object_numbers(bound, starts)).reshape(-1, len(cells))
        if len(objects) or bound.along:
            order = np.lexsort((cells, starts, *objects[::-1]))
            cells, starts, objects = cells[order], starts[order], objects[:, order]
        begins = np.flatnonzero(np.diff(starts, prepend=-1))
        lengths = np.diff(begins, append=len(cells))
        stage = np.full(len(begins), number, dtype=np.int16)
        return stage, lengths.astype(np.int32), objects.T[begins], cells.astype(np.int32)

    def _object_numbers(self, bound: BoundStage, cells: Cells) -> list[Indices]:
        """Return the numbers of the in-memory objects of cells, dependencies first."""
        objects: list[Indices] = []
        for source, first, _ in self._plan.computed_inputs(bound):
            if not source.stage.is_cached:
                inputs, codes = np.unique(first[cells], return_inverse=True)
                count = len(self._objects)
                keys = concatenate(self._objects, self._plan.keys(source)[inputs])
                first_indices, number = unique_keys(keys)
                self._objects = keys[first_indices]
                objects += [*self._object_numbers(source, first[cells]), number[count:][codes]]
        return objects

    def take_task_calls(
        self, costs: Mapping[str, float], size: float, shared_size: float
    ) -> Iterator[Call]:
        """Remove and yield calls that take about `size` seconds, at `costs` seconds per cell.

        Yield at least one call. Calls that share their first two in-memory objects and need a
        third stay in one task of up to `shared_size` seconds, because each task rebuilds objects.
        """
        seconds, count = 0.0, 0
        previous: list[int] = []
        while self and count < MAX_TASK_CELLS:
            block = self._ready[0] if not self._retries else None
            if block and not block.objects.shape[1]:
                cells_left = MAX_TASK_CELLS - count
                yield from self._take_calls(block, costs, size - seconds, cells_left, count == 0)
                break
            objects = block.objects[block.position].tolist() if block else []
            shared = len(objects) > 2 and objects[2] >= 0 and objects[:2] == previous
            if count and seconds >= (shared_size if shared else size):
                break
            if block:
                bound, (begin, end) = block.next_calls(1)
                cells = block.cells[begin:end]
                self._drop_calls(1)
            else:
                bound, cells = self._retries.popleft()
            previous = objects[:2]
            seconds += costs[bound.name] * len(cells)
            count += len(cells)
            self.load[bound] -= len(cells)
            yield bound, cells

    def _take_calls(
        self, block: ReadyCalls, costs: Mapping[str, float], size: float, limit: int, is_first: bool
    ) -> Iterator[Call]:
        """Remove and yield calls of one stage that fill `size` seconds, or `limit` cells."""
        bound, ends = block.next_calls(limit)
        offsets = (ends - ends[0])[:-1]
        count = int(np.count_nonzero((offsets * costs[bound.name] < size) & (offsets < limit)))
        count = max(count, int(is_first))  # at least one, even if a damaged index has wrong costs
        self._drop_calls(count)
        self.load[bound] -= int(ends[count] - ends[0])
        for begin, end in pairwise(ends[: count + 1].tolist()):
            yield bound, block.cells[begin:end]

    def _drop_calls(self, calls: int) -> None:
        self._ready[0].position += calls
        if not self._ready[0]:
            self._ready.popleft()


MIN_TASK_SECONDS, MAX_TASK_SECONDS = 0.2, 1.5  # s, range of a task's duration
MAX_SHARED_SECONDS = 5.0  # s, longest task if cells share costly objects
UNTIMED_SECONDS = 0.1  # s a cell, until one is timed


@dataclass
class Progress:
    """Cells of a stage: total, reused, computed and failed, and the time taken."""

    total: int = 0
    reused: int = 0
    done: int = 0
    failed: int = 0
    seconds: float = 0.0

    @property
    def remaining(self) -> int:
        """Number of cells still to be computed."""
        return self.total - self.reused - self.done - self.failed

    @classmethod
    def sum(cls, stages: Iterable[Progress]) -> Progress:
        """Return the sums over some stages."""
        return cls(*map(sum, zip(*map(astuple, stages), strict=True)))


class PlannedBatch(NamedTuple):
    """Calls of one stage in a task, with their cells and results in order.

    `cells` and `results` are (cell,).
    """

    bound: BoundStage
    cells: Cells
    results: Indices
    batch: Batch


class Task(NamedTuple):
    """Batches of calls that a worker runs one after the other, in the order of `run_batches`."""

    batches: tuple[PlannedBatch, ...]
    order: NDArray[np.int16]


@dataclass
class Schedule:
    """Cells of a plan: finished, failed, or still to be computed.

    Results of distinct keys are numbered: `results` maps a stage to the number of each cell's
    result, negative if it is not needed. `locations` has the location and key of each result,
    `failed` the reason why a result failed. `costs` are seconds per cell by stage.
    """

    plan: Plan
    costs: dict[str, float] = field(default_factory=dict)
    failed: dict[int, str] = field(default_factory=dict)
    progress: dict[str, Progress] = field(default_factory=dict)
    results: dict[BoundStage, Indices] = field(default_factory=dict)
    locations: Locations = field(default_factory=lambda: NO_LOCATIONS)

    # missing cells --------------------------------------------------------------------------

    def look_up(self, index: CellIndex) -> None:
        """Look up all cells in the cache, and plan the calls of missing ones."""
        plan, self._index = self.plan, index
        index.refresh()
        self.locations = replace(NO_LOCATIONS, paths=index.paths)
        needed_cells = {bound: np.zeros(plan.count(bound), bool) for bound in plan.bound.values()}
        for bound in plan.targets:
            needed_cells[bound][:] = True
            plan.fingerprint(bound)  # kept; the keys are dropped below
        missing: dict[BoundStage, Cells] = {}
        ranges: dict[str, list[range]] = defaultdict(list)  # results by code of their function
        for bound in reversed(plan.bound.values()):  # each before its inputs
            cells = np.flatnonzero(needed_cells[bound])
            if bound.stage.is_cached and cells.size:
                cells = self._number_results(bound, cells, ranges[plan.identity[bound.name]])
                missing[bound] = cells
            for inputs in plan.computed_inputs(bound):
                needed_cells[inputs.source][inputs.select(cells)] = True
        self._missing = {bound: cells for bound, cells in missing.items() if len(cells)}
        self._unfinished = Counter({bound: len(cells) for bound, cells in self._missing.items()})
        producer = np.full(len(self.locations), -1, np.int16)  # the stage that computes a result
        for number, (bound, cells) in enumerate(self._missing.items()):
            producer[self.results[bound][cells]] = number
        stages = [*self._missing]
        producer_ids = {bound: self._producer_stages(bound, producer) for bound in stages}
        self._producers = {
            bound: [stages[n] for n in numbers if n >= 0] for bound, numbers in producer_ids.items()
        }
        # Every stage with missing cells, their number, and the number of calls.
        self.missing_cells = [
            (
                bound,
                len(cells),
                len(np.unique(plan.first_cells(bound, cells)) if bound.along else cells),
            )
            for bound, cells in self._missing.items()
        ]
        self._object_keys: dict[BoundStage, Keys] = {}
        self._calls = CallQueue(plan)
        self._queue_ready()

    def _producer_stages(self, bound: BoundStage, producer: NDArray[np.int16]) -> set[int]:
        """Return the numbers of the stages that make the inputs of a stage and of its objects."""
        producers: set[int] = set()
        for source, *_ in self.plan.computed_inputs(bound):
            if source.stage.is_cached:
                results = self.results[source]
                counts = np.bincount(producer[results[results >= 0]] + 1)
                producers |= {*(np.flatnonzero(counts) - 1).tolist()}
            else:
                producers |= self._producer_stages(source, producer)
        return producers

    def _number_results(self, bound: BoundStage, cells: Cells, earlier: list[range]) -> Cells:
        """Number the results of cells; return one cell of each missing result.

        Cells of equal keys share a result, also with other stages of the same function, whose
        results are in the `earlier` ranges.
        """
        keys = self.plan.keys(bound)
        keys = keys if len(cells) == len(keys) else keys[cells]
        self.plan.drop_keys(bound)  # `keys` refers to them
        spans = [np.arange(span.start, span.stop, dtype=np.int32) for span in earlier]
        prior = np.concatenate([np.empty(0, np.int32), *spans])
        first, number = unique_keys(concatenate(self.locations.keys[prior], keys))
        reused, new = prior[first[first < len(prior)]], first[first >= len(prior)] - len(prior)
        begin = len(self.locations)
        numbers = concatenate(reused, np.arange(begin, begin + len(new), dtype=np.int32))
        results = np.full(self.plan.count(bound), -1, dtype=np.int32)
        results[cells] = numbers[number[len(prior) :]]
        self.results[bound] = results
        earlier.append(range(begin, begin + len(new)))
        new_keys = keys[new] if len(new) < len(keys) else keys
        cached = self._index.find(new_keys)
        absent = cells[new[~cached.present]]
        self.locations = Locations(
            cached.paths,
            concatenate(self.locations.pack, cached.pack),
            concatenate(self.locations.row, cached.row),
            concatenate(self.locations.keys, cached.keys),
        )
        # Results that another stage computes are counted there.
        total = len(new) + int(self.locations.present[reused].sum())
        self.progress[bound.name] = Progress(total, total - len(absent))
        return absent

    # stages that become ready ---------------------------------------------------------------

    @property
    def has_ready_calls(self) -> bool:
        """Whether there are calls whose inputs are all finished."""
        return bool(self._calls)

    def _queue_ready(self) -> None:
        """Add the calls of all stages whose inputs are done."""
        while ready := {
            bound: cells
            for bound, cells in self._missing.items()
            if not any(self._unfinished[source] for source in self._producers[bound])
        }:
            for bound in ready:
                del self._missing[bound]
            computable = {
                bound: self._computable_cells(bound, cells) for bound, cells in ready.items()
            }
            if calls := {bound: cells for bound, cells in computable.items() if len(cells)}:
                self._calls.add(calls)

    def _computable_cells(self, bound: BoundStage, cells: Cells) -> Cells:
        """Return the cells to compute: fail cells that lack an input, and reuse cached results.

        A result that gathers failed inputs has another key, under which the cache may hold it.
        """
        if not self.failed:
            return cells
        inputs = self.plan.computed_inputs(bound)
        failed_inputs = {source: self._failed_cells(source) for source, *_ in inputs}
        uncomputable = self._uncomputable_cells(bound, failed_inputs, cells)
        for cell in cells[uncomputable].tolist():
            failed_input = self._name_failed_input(bound, failed_inputs, cell)
            reason = f"needs {failed_input}, which failed"
            self._record_failure(bound, int(self.results[bound][cell]), reason)
        cells = cells[~uncomputable]
        results = self.results[bound][cells]
        keys = self.plan.hash_cells(bound, cells, self._current_keys)
        changed = np.flatnonzero((keys != self.locations.keys[results]).any(axis=1))
        self.locations.keys[results[changed]] = keys[changed]
        cached = self._index.find(keys[changed])
        reused = changed[cached.present]
        self._record_results(
            bound, results[reused], cached.pack[cached.present], cached.row[cached.present]
        )
        return np.delete(cells, reused)

    def _name_failed_input(
        self, bound: BoundStage, failed_inputs: Mapping[BoundStage, Flags], cell: int
    ) -> str:
        """Return the name of the first failed input cell that a cell needs."""
        for source, first, offsets in self.plan.computed_inputs(bound):
            input_cells = (first[cell] + offsets).ravel()
            flags = failed_inputs[source][input_cells]
            if _lacks_input(bound, flags):
                return self.plan.cell_name(source, int(input_cells[flags.argmax()]))
        raise ValueError(f"{bound.name} lacks no input")

    def _uncomputable_cells(
        self, bound: BoundStage, failed_inputs: Mapping[BoundStage, Flags], cells: Cells
    ) -> Flags:
        """Return flags of the cells that cannot be computed because inputs failed."""
        uncomputable = np.zeros(len(cells), dtype=bool)
        for source, first, offsets in self.plan.computed_inputs(bound):
            starts, codes = np.unique(first[cells], return_inverse=True)
            failed = failed_inputs[source][starts[:, None] + offsets.ravel()]
            uncomputable |= _lacks_input(bound, failed)[codes]
        return uncomputable

    def _failed_cells(self, bound: BoundStage) -> Flags:
        """Return flags of the cells of a stage that failed, or whose objects cannot be made."""
        if bound.stage.is_cached:
            return np.isin(self.results[bound], [*self.failed])
        inputs = self.plan.computed_inputs(bound)
        failed_inputs = {source: self._failed_cells(source) for source, *_ in inputs}
        return self._uncomputable_cells(bound, failed_inputs, self.plan.cells(bound))

    def _current_keys(self, bound: BoundStage) -> Keys:
        """Return the keys of a stage's cells, with `FAILED_KEY` for failed results."""
        if bound.stage.is_cached:
            keys = self.locations.keys[self.results[bound]]
        elif bound in self._object_keys:
            return self._object_keys[bound]
        else:
            keys = self.plan.hash_cells(bound, self.plan.cells(bound), self._current_keys)
            self._object_keys[bound] = keys  # its inputs are done
        keys[self._failed_cells(bound)] = FAILED_KEY
        return keys

    # batches --------------------------------------------------------------------------------

    def next_task(self, workers: int) -> Task:
        """Remove and return the next task of the calls that are ready; empty if there is none.

        `workers` tasks run at once, and get shorter towards the end, so that no worker idles.
        """
        costs = defaultdict(lambda: UNTIMED_SECONDS, self.costs)
        remaining = sum(costs[bound.name] * cells for bound, cells in self._calls.load.items())
        size = min(max(remaining / (3 * workers), MIN_TASK_SECONDS), MAX_TASK_SECONDS)
        shared_size = min(MAX_SHARED_SECONDS, max(remaining / workers / 2, size))
        task = self._make_task(self._calls.take_task_calls(costs, size, shared_size))
        message = "task of %s: about %.2g s, of %.3g s of work left for %d workers"
        LOG.debug(
            message, [planned.bound.name for planned in task.batches], size, remaining, workers
        )
        return task

    def _make_task(self, calls: Iterable[Call]) -> Task:
        """Return a task of calls, each with its stage and the cells that it computes."""
        groups: dict[tuple[BoundStage, bytes], list[Cells]] = defaultdict(list)
        order: list[int] = []
        numbers: dict[tuple[BoundStage, bytes], int] = {}
        for bound, cells in calls:
            # Calls of a batch compute equal positions of the axes computed together.
            starts = self.plan.first_cells(bound, cells[:1]) if bound.along else None
            pattern = b"" if starts is None else (cells - starts).tobytes()
            order.append(numbers.setdefault((bound, pattern), len(numbers)))
            groups[bound, pattern].append(cells)
        batches = (self.make_batch(bound, cells) for (bound, _), cells in groups.items())
        return Task(tuple(batches), np.array(order, dtype=np.int16))

    # calls ----------------------------------------------------------------------------------

    def make_batch(self, bound: BoundStage, calls: Sequence[Cells]) -> PlannedBatch:
        """Return a batch of calls of a stage that compute equal positions of its axes."""
        plan, cells = self.plan, np.concatenate(calls)
        begins = np.cumsum([0, *map(len, calls)])
        firsts = plan.first_cells(bound, cells[begins[:-1]])
        # Offsets of the cells of a call, by the positions on each axis computed together.
        grid = np.zeros((), dtype=np.int64)
        for key in bound.along:
            number = plan.axis_number(key)
            stride = plan.along_strides[bound].get(number, 0)
            grid = np.add.outer(grid, stride * np.unique(plan.positions(bound, number, calls[0])))
        order = np.argsort(grid.ravel())
        offsets = cells - np.repeat(firsts, np.diff(begins))
        positions = order[np.searchsorted(grid.ravel(), offsets, sorter=order)]
        results = self.results[bound][cells]
        batch = self._bind_arguments(
            bound,
            firsts,
            grid,
            keys=self.locations.keys[results],
            begins=begins,
            positions=positions,
            folder=plan.identity[bound.name],
        )
        return PlannedBatch(bound, cells, results, batch)

    def _bind_arguments(
        self, bound: BoundStage, firsts: Cells, grid: Cells, **computed: Any
    ) -> Batch:
        """Return a batch of calls that begin at the cells `firsts`, (call,).

        `grid` has the offsets of a call's cells from its first one, with one axis for each axis
        computed together. `computed` are further fields of `Batch`.
        """
        plan = self.plan
        arguments: dict[str, Argument] = {}
        gathered = [len(plan.axes[plan.axis_number(key)].points) for key in bound.gather]
        valid = np.ones((len(firsts), *gathered), dtype=bool)
        for name, source in bound.arguments.items():
            if isinstance(source, Setting) or source.stage.is_derived:
                arguments[name] = self._bind_value(bound, source, firsts, grid)
            elif not source.stage.is_cached:
                arguments[name] = self._bind_object(bound, source, firsts)
            else:
                locations, present = self._locate_input(bound, source, firsts, grid)
                declared_input = bound.stage.reads.get(name)
                in_blocks = isinstance(declared_input, At) and declared_input.in_blocks
                arguments[name] = StoredArgument(stage_spec(source.stage), locations, in_blocks)
                valid &= present
        return Batch(
            stage_spec(bound.stage),
            arguments,
            shape=grid.shape,
            streams=tuple(plan.stream(bound, cell) for cell in firsts.tolist() if bound.random),
            valid=valid if VALID in bound.stage.arguments else None,
            **computed,
        )

    def _bind_value(
        self, bound: BoundStage, source: Setting | BoundStage, firsts: Cells, grid: Cells
    ) -> ValueArgument:
        """Return an argument that is a setting or the result of a derived stage."""
        if isinstance(source, Setting) and source.key in bound.along:
            rows = np.moveaxis(grid, bound.along.index(source.key), 0)
            cells = firsts[0] + rows.reshape(len(rows), -1)[:, 0]
            values = tuple(self.plan.value(bound, source.key, cell) for cell in cells.tolist())
            return ValueArgument((source.in_si(values),), np.zeros(len(firsts), dtype=np.int32))
        distinct, codes = self.plan.factorise(bound, source, firsts)
        return ValueArgument(distinct, codes.astype(np.int32))

    def _bind_object(self, bound: BoundStage, source: BoundStage, firsts: Cells) -> ObjectArgument:
        """Return an argument that is an in-memory object."""
        first = self.plan.input_cells(bound)[source].first[firsts]
        objects, codes = np.unique(first, return_inverse=True)
        keys = (self._current_keys if self.failed else self.plan.keys)(source)[objects]
        batch = self._bind_arguments(
            source,
            objects,
            grid=np.zeros((), dtype=np.int64),
            keys=keys,
            begins=np.arange(len(objects) + 1),
            positions=0 * objects,
        )
        return ObjectArgument(batch, codes.astype(np.int32))

    def _locate_input(
        self, bound: BoundStage, source: BoundStage, firsts: Cells, grid: Cells
    ) -> tuple[Locations, Flags]:
        """Return the locations of an input, and whether it is present, (call, gathered axis...)."""
        _, first, offsets = self.plan.input_cells(bound)[source]
        # The input is constant along axes on which it does not depend.
        input_grid = grid[tuple(slice(None) if key in source.needs else 0 for key in bound.along)]
        input_cells = np.add.outer(first[np.add.outer(firsts, input_grid)], offsets)
        locations = self.locations[self.results[source][input_cells]].compact()
        grid_axes = range(1, locations.present.ndim - offsets.ndim)
        present = np.asarray(locations.present.all(axis=tuple(grid_axes)))
        selection = (slice(None) if key in source.needs else None for key in bound.gather)
        return locations, present[(slice(None), *selection)]

    # outcomes -------------------------------------------------------------------------------

    def record_outcome(
        self, planned: PlannedBatch, outcome: Outcome, pack: int, *, split: bool = True
    ) -> list[Failure]:
        """Record the outcome of calls, and queue the stages that become ready; return failures.

        With `split`, the cells of a call that raised are computed again by one call each.
        """
        bound, begins, name = planned.bound, planned.batch.begins, planned.bound.name
        done = np.ones(len(planned.cells), dtype=bool)
        for call in outcome.damaged_inputs:
            done[begins[call] : begins[call + 1]] = False
        failures: list[Failure] = []
        splittable = np.repeat(np.diff(begins), np.diff(begins)) > 1
        for number, failure in outcome.failed.items():
            done[number] = False
            cells = planned.cells[number : number + 1]
            if split and failure.traceback and splittable[number]:
                self._calls.retry(bound, cells)
            else:
                failures.append(failure._replace(name=self.plan.cell_name(bound, int(cells[0]))))
                self._record_failure(bound, int(planned.results[number]), failure.reason)
        results = planned.results[done]
        self._record_results(bound, results, pack, np.arange(len(results), dtype=np.int32))
        self.progress[name].seconds += outcome.seconds
        if outcome.seconds and len(results):
            cell_seconds = outcome.seconds / len(results)  # of the calls that succeeded
            self.costs[name] = 0.7 * self.costs.get(name, cell_seconds) + 0.3 * cell_seconds
        if not self._unfinished[bound]:
            self._queue_ready()
        return failures

    def split_task(self, task: Task) -> list[Task]:
        """Return a task for every call of a task."""
        return [
            self._make_task([(planned.bound, planned.cells[begin:end])])
            for planned in task.batches
            for begin, end in pairwise(planned.batch.begins.tolist())
        ]

    def _record_results(self, bound: BoundStage, results: Indices, pack: Any, row: Any) -> None:
        self.locations.pack[results], self.locations.row[results] = pack, row
        self.progress[bound.name].done += len(results)
        self._unfinished[bound] -= len(results)

    def _record_failure(self, bound: BoundStage, result: int, reason: str) -> None:
        self.failed[result] = reason
        self.progress[bound.name].failed += 1
        self._unfinished[bound] -= 1

    def remaining_seconds(self) -> dict[str, float]:
        """Estimate the seconds left by stage; untimed stages take the median of timed ones."""
        stages = {name: progress for name, progress in self.progress.items() if progress.total}
        timed = [name for name in stages if name in self.costs]
        totals = {name: self.costs[name] * stages[name].total for name in timed}
        typical = median(totals.values()) if totals else 0.0
        return {
            name: totals.get(name, typical) * progress.remaining / progress.total
            for name, progress in stages.items()
        }


@dataclass
class Callbacks:
    """Observer of a sweep: called with sentences, on every change, and with failures."""

    say: Callable[[str], None]
    step: Callable[[Schedule], None] = lambda schedule: None
    failed: Callable[[Failure], None] = lambda failure: None


def _lacks_input(bound: BoundStage, failed: Flags) -> Flags:
    """Return whether a stage lacks an input whose failed cells are flagged along the last axis.

    A stage that takes `valid` lacks a gathered input if all of its cells failed, any other stage if
    one did.
    """
    takes_valid = VALID in bound.stage.arguments
    return np.asarray(failed.all(axis=-1) if takes_valid else failed.any(axis=-1))

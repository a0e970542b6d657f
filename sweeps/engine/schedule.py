"""The order of work: missing cells, the calls that compute them, and tasks of several calls.

Calls that are left are numbered so that those that share in-memory objects are neighbours, closest
where they share most. A call waits for missing results; or for a gate, which several calls may
share: all that one of them gathers, or all that an in-memory object is made of.
"""

from __future__ import annotations

import heapq
import logging
from collections import Counter, defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from itertools import pairwise
from statistics import median
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.failures import Failure
from sweeps.engine.index import CellIndex
from sweeps.engine.keys import Keys, distinct, hashed, joined, spelt_key
from sweeps.engine.packs import NO_SPOTS, Spots
from sweeps.engine.plan import Cells, Plan
from sweeps.engine.settings import Setting
from sweeps.engine.stage import VALID, At, Bound
from sweeps.engine.tasks import Calls, Column, Made, Outcome, Read, Step

LOG = logging.getLogger(__name__)
MOST_CELLS = 4096  # of one task

Job = tuple[Bound, Cells]  # cells of a stage that one call computes


class Waiting:
    """Calls for missing cells; those of stages without in-memory objects come first."""

    def __init__(
        self,
        plan: Plan,
        nodes: Mapping[Bound, Cells],
        absent: NDArray[np.bool_],
        missing: Mapping[Bound, Cells],
    ) -> None:
        """Plan calls.

        Parameters
        ----------
        plan : Plan
            What depends on what.
        nodes : mapping of Bound to (cell,) ndarray
            Number of the result of every cell that is needed.
        absent : (node,) ndarray of bool
            Which results are missing.
        missing : mapping of Bound to (cell,) ndarray
            The cells to be computed by stage, one of each result.
        """
        self._plan, self._nodes, self._absent = plan, nodes, absent
        self._stages = [*missing]
        self._split: deque[Job] = deque()
        self._made: Keys = np.empty((0, 2), np.uint64)  # keys of in-memory objects, by number
        tables = [self._calls(number, cells) for number, cells in enumerate(missing.values())]
        width = max((objects.shape[1] for _, _, objects, _ in tables), default=0)
        fill = [np.full((len(o), width), -1, np.int32) for _, _, o, _ in tables]
        for padded, (_, _, objects, _) in zip(fill, tables, strict=True):
            padded[:, : objects.shape[1]] = objects
        empty = np.empty(0, dtype=np.int32)
        lengths = joined(empty, *(lengths for _, lengths, _, _ in tables))
        self._stage = joined(empty, *(stage for stage, _, _, _ in tables))
        self._cells = joined(empty, *(cells for _, _, _, cells in tables))
        self._objects = joined(np.empty((0, width), np.int32), *fill)
        if width:
            order = np.lexsort(self._objects.T[::-1])
            begins = np.cumsum(lengths) - lengths
            self._stage, self._objects = self._stage[order], self._objects[order]
            lengths = lengths[order]
            self._cells = self._cells[_ranges(begins[order], lengths)]
        self._begins = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)
        self._wait()
        del self._nodes, self._absent, self._made, self._known

    def _calls(self, number: int, cells: Cells) -> tuple[Cells, Cells, Cells, Cells]:
        """Return stage, number of cells and in-memory objects of each call; and all their cells.

        Cells that differ only on axes computed together share a call.
        """
        bound = self._stages[number]
        starts = self._plan.start(bound, cells)
        objects = np.array(self._shared(bound, starts)).reshape(-1, len(cells))
        if len(objects) or bound.along:
            order = np.lexsort((cells, starts, *objects[::-1]))
            cells, starts, objects = cells[order], starts[order], objects[:, order]
        begins = np.flatnonzero(np.diff(starts, prepend=-1))
        lengths = np.diff(begins, append=len(cells))
        stage = np.full(len(begins), number, dtype=np.int16)
        return stage, lengths.astype(np.int32), objects.T[begins], cells.astype(np.int32)

    def _shared(self, bound: Bound, cells: Cells) -> list[Cells]:
        """Return numbers of the in-memory objects that cells need, dependencies first."""
        found: list[Cells] = []
        for source, first, _ in self._plan.inputs(bound):
            if not source.stage.kept:
                taken, places = np.unique(first[cells], return_inverse=True)
                known, keys = len(self._made), joined(self._made, self._plan.keys(source)[taken])
                of_first, number = distinct(keys)
                self._made = keys[of_first]
                found += [*self._shared(source, first[cells]), number[known:][places]]
        return found

    # what they wait for ---------------------------------------------------------------------

    def _wait(self) -> None:
        """Find what each call waits for, and which wait for nothing."""
        self._gates = len(self._absent)  # number of the first gate, behind the nodes
        self._known: dict[Bound | tuple[Bound, Bound], Cells] = {}  # gates by where they begin
        edges: list[tuple[Cells, Cells]] = []  # node or gate, and the call or gate that waits
        count, calls = 0, len(self._stage)
        for number, bound in enumerate(self._stages):
            if not self._plan.inputs(bound):
                continue
            own = np.flatnonzero(self._stage == number)
            own = np.repeat(own, np.diff(self._begins)[own])
            cells = self._cells[np.repeat(self._stage == number, np.diff(self._begins))]
            count = self._edges(bound, cells, own, count, edges)
        empty = np.empty(0, dtype=np.int64)
        sources = joined(empty, *(source for source, _ in edges))
        self._targets = joined(empty, *(target for _, target in edges))
        order = np.argsort(sources, kind="stable")
        self._targets = self._targets[order]
        things = self._gates + count
        self._from = np.searchsorted(sources[order], np.arange(things + 1)) if len(order) else None
        self._left = np.zeros(calls + count, dtype=np.int32)
        np.add.at(self._left, self._targets, 1)
        self._later: list[int] = []
        open_gates = np.flatnonzero(self._left[calls:] == 0)
        # Calls that wait for nothing, and then those that only waited for open gates.
        ready = self._left[:calls] == 0
        self._first, self._at = np.flatnonzero(ready).astype(np.int32), 0
        lengths, stages = np.diff(self._begins)[self._first], self._stage[self._first]
        self.load = Counter(
            {bound: int(lengths[stages == n].sum()) for n, bound in enumerate(self._stages)}
        )
        self.release(self._gates + open_gates)

    def _edges(
        self,
        bound: Bound,
        cells: Cells,
        waiting: Cells,
        count: int,
        edges: list[tuple[Cells, Cells]],
    ) -> int:
        """Add what cells of a stage, and thus calls or gates, wait for; return number of gates."""
        for source, first, further in self._plan.inputs(bound):
            kept = source.stage.kept
            starts = first[cells]
            if kept and further.size == 1:
                nodes = self._nodes[source][starts + further.ravel()]
                absent = self._absent[nodes]
                edges.append((nodes[absent], waiting[absent]))
                continue
            # The same gate for all that take the same.
            known = self._known.setdefault(
                (bound, source) if kept else source,
                np.full(self._plan.count(source), -1, dtype=np.int64),
            )
            new = np.unique(starts[known[starts] < 0])
            known[new] = count + np.arange(len(new))
            count += len(new)
            edges.append((self._gates + known[starts], waiting))
            behind = len(self._stage) + np.repeat(known[new], further.size)
            taken = (new[:, None] + further.ravel()).ravel()
            if kept:
                nodes = self._nodes[source][taken]
                absent = self._absent[nodes]
                edges.append((nodes[absent], behind[absent]))
            else:
                count = self._edges(source, taken, behind, count, edges)
        return count

    def release(self, nodes: Cells) -> None:
        """Let go what waits for nodes that are finished or failed, or for gates that are open."""
        calls = len(self._stage)
        while len(nodes) and self._from is not None:
            begins = self._from[nodes]
            targets = self._targets[_ranges(begins, self._from[nodes + 1] - begins)]
            np.subtract.at(self._left, targets, 1)
            free = np.unique(targets[self._left[targets] == 0])
            for call in free[free < calls].tolist():
                heapq.heappush(self._later, call)
                length = int(self._begins[call + 1] - self._begins[call])
                self.load[self._stages[self._stage[call]]] += length
            nodes = free[free >= calls] - calls + self._gates

    # what is next ---------------------------------------------------------------------------

    @property
    def ready(self) -> bool:
        """Whether there are calls that wait for nothing."""
        return bool(self._split or self._later or self._at < len(self._first))

    def counts(self) -> list[tuple[Bound, int, int]]:
        """Return stages, and for each how many cells are in how many calls, of all planned."""
        cells = np.bincount(self._stage, np.diff(self._begins), minlength=len(self._stages))
        calls = np.bincount(self._stage, minlength=len(self._stages))
        return [*zip(self._stages, cells.astype(int).tolist(), calls.tolist(), strict=True)]

    def add(self, jobs: Iterable[Job]) -> None:
        """Add calls that wait for nothing."""
        for bound, cells in jobs:
            self._split.append((bound, cells))
            self.load[bound] += len(cells)

    def next(self, costs: Mapping[str, float], size: float, together: float) -> Iterator[Job]:
        """Remove and yield calls that take about `size` seconds, by the cost of a cell of a stage.

        Up to `together` where calls share two in-memory objects, and have a third.
        """
        seconds, cells = 0.0, 0
        before: list[int] = []
        # At least one, even if a damaged index has wrong costs.
        while self.ready and cells < MOST_CELLS:
            if not (self._objects.shape[1] or self._later or self._split):
                yield from self._block(costs, size - seconds, MOST_CELLS - cells, cells == 0)
                break
            at = self._next()
            objects = [] if at is None else self._objects[at].tolist()
            shared = len(objects) > 2 and objects[2] >= 0 and objects[:2] == before
            if cells and seconds >= (together if shared else size):
                break
            bound, own = self._split.popleft() if at is None else self._pop(at)
            before = objects[:2]
            seconds += costs[bound.name] * len(own)
            cells += len(own)
            self.load[bound] -= len(own)
            yield bound, own

    def _block(
        self, costs: Mapping[str, float], size: float, most: int, begins: bool
    ) -> Iterator[Job]:
        """Remove and yield calls of one stage, of those that share no objects, as `next` does."""
        calls = self._first[self._at : self._at + most]
        stage = self._stage[calls[0]]
        calls = calls[: np.argmax(np.append(self._stage[calls] != stage, True))]
        starts, ends = self._begins[calls], self._begins[calls + 1]
        bound, done = self._stages[stage], np.cumsum(ends - starts)
        before = np.append(0, done[:-1])
        count = int(np.count_nonzero((before * costs[bound.name] < size) & (before < most)))
        count = max(count, int(begins))  # at least one, even if a damaged index has wrong costs
        if not count:
            return
        self._at += count
        self.load[bound] -= int(done[count - 1])
        for start, end in zip(starts[:count].tolist(), ends[:count].tolist(), strict=True):
            yield bound, self._cells[start:end]

    def _next(self) -> int | None:
        """Return the first of the calls that are ready; None for one that was split."""
        if self._split:
            return None
        first = int(self._first[self._at]) if self._at < len(self._first) else None
        later = self._later[0] if self._later else None
        return min(one for one in (first, later) if one is not None)

    def _pop(self, call: int) -> Job:
        if self._later and self._later[0] == call:
            heapq.heappop(self._later)
        else:
            self._at += 1
        own = self._cells[self._begins[call] : self._begins[call + 1]]
        return self._stages[self._stage[call]], own


def _ranges(begins: Cells, lengths: Cells) -> Cells:
    """Return the numbers of several ranges, one after the other."""
    ends = np.cumsum(lengths)
    return np.arange(ends[-1] if len(ends) else 0) + np.repeat(begins - ends + lengths, lengths)


SHORTEST, LONGEST = 0.2, 1.5  # s, range of a task's duration
TOGETHER = 5.0  # s, longest task if cells share costly objects
UNKNOWN = 0.1  # s a cell, until one is timed


@dataclass
class Progress:
    """Cells of a stage: total, reused, computed and failed, and the time taken."""

    total: int = 0
    reused: int = 0
    done: int = 0
    failed: int = 0
    seconds: float = 0.0

    @property
    def left(self) -> int:
        """Number of cells still to be computed."""
        return self.total - self.reused - self.done - self.failed

    @classmethod
    def over(cls, stages: Iterable[Progress]) -> Progress:
        """Return the sums over some stages."""
        return cls(*map(sum, zip(*map(astuple, stages), strict=True)))


class Part(NamedTuple):
    """Calls of one stage in a task, and what they compute, in their order.

    `cells` and `nodes` are (cell,).
    """

    bound: Bound
    cells: Cells
    nodes: Cells
    calls: Calls


class Task(NamedTuple):
    """Calls that a worker runs one after the other; in which order, see `run_calls`."""

    parts: tuple[Part, ...]
    order: NDArray[np.int16]


@dataclass
class Schedule:
    """Cells of a plan: finished, failed, or still to be computed.

    Distinct results, those of different keys, are numbered: `nodes` has by stage the number of each
    cell, negative if none is needed. `spots` has by number where a result is, and the key under
    which it is kept; `failed`, why one failed. `costs` are seconds per cell by stage.
    """

    plan: Plan
    costs: dict[str, float] = field(default_factory=dict)
    failed: dict[int, str] = field(default_factory=dict)
    progress: dict[str, Progress] = field(default_factory=dict)
    nodes: dict[Bound, Cells] = field(default_factory=dict)
    spots: Spots = field(default_factory=lambda: NO_SPOTS)

    # what is missing ------------------------------------------------------------------------

    def resolve(self, index: CellIndex) -> None:
        """Look up all cells that are needed, and plan calls for missing ones."""
        plan, self._index = self.plan, index
        index.refresh()
        self.spots = replace(NO_SPOTS, paths=index.paths)
        wanted = {bound: np.zeros(plan.count(bound), bool) for bound in plan.bound.values()}
        for bound in plan.targets:
            wanted[bound][:] = True
            plan.fingerprint(bound)  # while its keys are known
        missing: dict[Bound, Cells] = {}
        alike: dict[str, list[range]] = defaultdict(list)  # nodes by code of their function
        for bound in reversed(plan.bound.values()):  # each before those that it needs
            cells = np.flatnonzero(wanted[bound])
            if bound.stage.kept and cells.size:
                cells = self._look_up(bound, cells, alike[plan.identity[bound.name]])
                missing[bound] = cells
            for taken in plan.inputs(bound):
                wanted[taken.source][taken.of(cells)] = True
        self._odd = np.zeros(len(self.spots), dtype=bool)
        missing = {bound: cells for bound, cells in missing.items() if len(cells)}
        self._calls = Waiting(plan, self.nodes, ~self.spots.present, missing)

    def _look_up(self, bound: Bound, cells: Cells, alike: list[range]) -> Cells:
        """Number the results of some cells; return those that are to be computed, one of each.

        Cells of equal keys are one result, also of other stages of the same function, whose
        results are `alike`.
        """
        keys = self.plan.keys(bound)
        keys = keys if len(cells) == len(keys) else keys[cells]
        self.plan.forget_keys(bound)  # those of what it depends on are made
        known = np.array([node for nodes in alike for node in nodes], dtype=np.int32)
        first, number = distinct(joined(self.spots.keys[known], keys))
        again, new = known[first[first < len(known)]], first[first >= len(known)] - len(known)
        before = len(self.spots)
        numbers = joined(again, np.arange(before, before + len(new), dtype=np.int32))
        nodes = np.full(self.plan.count(bound), -1, dtype=np.int32)
        nodes[cells] = numbers[number[len(known) :]]
        self.nodes[bound] = nodes
        alike.append(range(before, before + len(new)))
        asked = keys[new] if len(new) < len(keys) else keys
        found = self._index.find(asked, bound.stage.outputs)
        absent = cells[new[~found.present]]
        self.spots = Spots(
            found.paths,
            joined(self.spots.pack, found.pack),
            joined(self.spots.row, found.row),
            joined(self.spots.keys, found.keys),
        )
        # What another stage is about to compute is counted there.
        total = len(new) + int(self.spots.present[again].sum())
        self.progress[bound.name] = Progress(total, total - len(absent))
        return absent

    @property
    def ready(self) -> bool:
        """Return whether there are calls whose inputs are all finished."""
        return self._calls.ready

    def missing_cells(self) -> list[tuple[Bound, int, int]]:
        """Return every stage with missing cells, how many, and in how many calls."""
        return self._calls.counts()

    # batches --------------------------------------------------------------------------------

    def batch(self, workers: int) -> Task:
        """Remove and return the next task of the calls that are ready; empty if there is none.

        `workers` tasks run at once: towards the end they get shorter, so that none idles.
        """
        costs = defaultdict(lambda: UNKNOWN, self.costs)
        left = sum(costs[bound.name] * cells for bound, cells in self._calls.load.items())
        size = min(max(left / (3 * workers), SHORTEST), LONGEST)
        together = min(TOGETHER, max(left / workers / 2, size))
        task = self._task(self._calls.next(costs, size, together))
        told = "task of %s: calls of %.2g s together, as %.3g s are left for %d workers"
        LOG.debug(told, [part.bound.name for part in task.parts], size, left, workers)
        return task

    def _task(self, jobs: Iterable[Job]) -> Task:
        """Return a task of calls: the stage of each, and the cells that it computes."""
        of_stage: dict[tuple[Bound, bytes], list[Cells]] = defaultdict(list)
        order: list[int] = []
        numbers: dict[tuple[Bound, bytes], int] = {}
        for bound, cells in self.possible(jobs) if self.failed else jobs:
            # Those of a part compute equal places of the axes that are computed together.
            starts = self.plan.start(bound, cells[:1]) if bound.along else None
            pattern = b"" if starts is None else (cells - starts).tobytes()
            order.append(numbers.setdefault((bound, pattern), len(numbers)))
            of_stage[bound, pattern].append(cells)
        parts = (self.part(bound, cells) for (bound, _), cells in of_stage.items())
        return Task(tuple(parts), np.array(order, dtype=np.int16))

    def possible(self, jobs: Iterable[Job]) -> Iterator[Job]:
        """Yield calls as they are if no input has failed, else those of cells that are possible."""
        for bound, cells in jobs:
            odd = self._is_odd(bound, cells)
            if not odd.any():
                yield bound, cells
                continue
            for number in range(len(cells)):
                one = cells[number : number + 1]
                node = self.nodes[bound][one]
                why, self.spots.keys[node] = self._now(bound, int(one[0]))
                self._odd[node] = odd[number]
                found = self._index.find(self.spots.keys[node], bound.stage.outputs)
                if why:
                    self._fail(bound, int(node[0]), why)
                elif found.present[0]:
                    self._finish(bound, node, found.pack, found.row)
                else:
                    yield bound, one

    def _is_odd(self, bound: Bound, cells: Cells) -> NDArray[np.bool_]:
        """Return which cells depend on any that failed, or on one that in turn does."""
        found = np.zeros(len(cells), dtype=bool)
        for source, first, further in self.plan.inputs(bound):
            starts, places = np.unique(first[cells], return_inverse=True)
            if source.stage.kept:
                nodes = self.nodes[source][starts[:, None] + further.ravel()]
                found |= self._odd[nodes].any(axis=1)[places]
            else:
                found |= self._is_odd(source, starts)[places]
        return found

    def _now(self, bound: Bound, cell: int) -> tuple[str, Keys]:
        """Return why a cell cannot be computed, if an input failed, and the key of its result.

        That is another key than its own where some of the inputs that it gathers failed.
        """
        key = self.plan.keys(bound)[cell]
        odd = []
        for source, first, further in self.plan.inputs(bound) if self.failed else ():
            taken = (first[cell] + further).ravel().tolist()
            states = [self._input_now(source, there) for there in taken]
            gone = [there for there, (why, _) in zip(taken, states, strict=True) if why]
            if gone and (len(gone) == len(taken) or not further.ndim):
                return f"needs {self.plan.described(source, gone[0])}, which failed", key
            planned = self.plan.keys(source)[taken]
            for number, (why, now) in enumerate(states):
                if why or (now != planned[number]).any():
                    odd.append((source.name, number, "" if why else spelt_key(now)))
        return "", hashed([repr((spelt_key(key), odd))])[0] if odd else key

    def _input_now(self, source: Bound, cell: int) -> tuple[str, Keys]:
        """Return why an input's cell failed, and the key under which its result is kept."""
        if not source.stage.kept:
            return self._now(source, cell)
        node = int(self.nodes[source][cell])
        return self.failed.get(node, ""), self.spots.keys[node]

    # calls ----------------------------------------------------------------------------------

    def part(self, bound: Bound, jobs: Sequence[Cells]) -> Part:
        """Return calls of a stage, whose cells all lie alike on its axes."""
        plan, cells = self.plan, np.concatenate(jobs)
        begins = np.cumsum([0, *map(len, jobs)])
        firsts = plan.start(bound, cells[begins[:-1]])
        # The cells that a call computes: by the values that occur on each axis computed together.
        grid = np.zeros((), dtype=np.int64)
        for key in bound.along:
            number = plan.axis_number(key)
            stride = plan.together[bound].get(number, 0)
            grid = np.add.outer(grid, stride * np.unique(plan.places(bound, number, jobs[0])))
        order = np.argsort(grid.ravel())
        moved = cells - np.repeat(firsts, np.diff(begins))
        places = order[np.searchsorted(grid.ravel(), moved, sorter=order)]
        nodes = self.nodes[bound][cells]
        calls = self._calls_at(
            bound,
            firsts,
            grid,
            keys=self.spots.keys[nodes],
            begins=begins,
            places=places,
        )
        return Part(bound, cells, nodes, calls)

    def _calls_at(self, bound: Bound, firsts: Cells, grid: Cells, **computed: Any) -> Calls:
        """Return calls for cells, (call,), and a grid of others from each of these on.

        The grid is an array of numbers to be added; each axis is one that is computed together.
        What is `computed` is passed on to `Calls`.
        """
        plan, along, count = self.plan, bound.along, len(firsts)
        sources: dict[str, Column | Read | Made] = {}
        asks = VALID in bound.stage.arguments
        gathered = [len(plan.axes[plan.axis_number(key)].points) for key in bound.gather]
        valid = np.ones((count, *gathered), dtype=bool) if asks else None
        for name, source in bound.arguments.items():
            if isinstance(source, Setting) and source.key in along:
                rows = np.moveaxis(grid, along.index(source.key), 0)
                at = firsts[0] + rows.reshape(len(rows), -1)[:, 0]
                values = tuple(plan.value(bound, source.key, cell) for cell in at.tolist())
                sources[name] = Column((source.in_si(values),), np.zeros(count, dtype=np.int32))
            elif isinstance(source, Setting) or source.stage.plain:
                found, places = plan.column(bound, source, firsts)
                sources[name] = Column(found, places.astype(np.int32))
            elif not source.stage.kept:
                made, places = np.unique(
                    plan.taken(bound)[source].first[firsts], return_inverse=True
                )
                keys = plan.keys(source)[made]
                for one in np.flatnonzero(self._is_odd(source, made)) if self.failed else ():
                    _, keys[one] = self._now(source, int(made[one]))
                own = {"keys": keys, "begins": np.arange(len(made) + 1), "places": 0 * made}
                calls = self._calls_at(source, made, np.zeros((), dtype=np.int64), **own)
                sources[name] = Made(calls, places.astype(np.int32))
            else:
                spots, present = self._read(bound, source, firsts, grid)
                read = bound.stage.reads.get(name)
                in_blocks = isinstance(read, At) and read.in_blocks
                sources[name] = Read(Step.of(source.stage), spots, in_blocks)
                if valid is not None:
                    valid &= present
        streams = (plan.stream(bound, cell) for cell in firsts.tolist() if bound.random)
        step = Step.of(bound.stage)
        return Calls(
            step, sources, shape=grid.shape, streams=tuple(streams), valid=valid, **computed
        )

    def _read(
        self, bound: Bound, source: Bound, firsts: Cells, grid: Cells
    ) -> tuple[Spots, NDArray[np.bool_]]:
        """Return where an input is, and by call where on gathered axes all of its cells exist."""
        _, first, further = self.plan.taken(bound)[source]
        # Along axes on which the input does not depend, it is the same.
        own = grid[tuple(slice(None) if key in source.needs else 0 for key in bound.along)]
        taken = np.add.outer(first[np.add.outer(firsts, own)], further)
        spots = self.spots[self.nodes[source][taken]].alone()
        each = range(1, spots.present.ndim - further.ndim)
        present = np.asarray(spots.present.all(axis=tuple(each)))
        lacking = (slice(None) if key in source.needs else None for key in bound.gather)
        return spots, present[(slice(None), *lacking)]

    # outcomes -------------------------------------------------------------------------------

    def finish(
        self, part: Part, outcome: Outcome, pack: int, *, split: bool = True
    ) -> list[Failure]:
        """Record where the cells of some calls are, and release those that wait for them.

        Returns what failed. Several cells of a call that raised are computed by one call each if
        `split`, since one of them may be the cause.
        """
        bound, begins, name = part.bound, part.calls.begins, part.bound.name
        done = np.ones(len(part.cells), dtype=bool)
        for call in outcome.lacking:
            done[begins[call] : begins[call + 1]] = False
        failed: list[Failure] = []
        together = np.repeat(np.diff(begins), np.diff(begins)) > 1
        for number, failure in outcome.failed.items():
            done[number] = False
            cells = part.cells[number : number + 1]
            if split and failure.traceback and together[number]:
                self._calls.add([(bound, cells)])
            else:
                failed.append(failure._replace(what=self.plan.described(bound, int(cells[0]))))
                self._fail(bound, int(part.nodes[number]), failure.why)
        nodes = part.nodes[done]
        self._finish(bound, nodes, pack, np.arange(len(nodes), dtype=np.int32))
        self.progress[name].seconds += outcome.seconds
        if outcome.seconds:
            each = outcome.seconds / len(part.cells)
            self.costs[name] = 0.7 * self.costs.get(name, each) + 0.3 * each
        return failed

    def each(self, task: Task) -> list[Task]:
        """Return a task for every call of a task."""
        jobs = [
            (part.bound, part.cells[begin:end])
            for part in task.parts
            for begin, end in pairwise(part.calls.begins.tolist())
        ]
        tasks = (self._task([job]) for job in jobs)
        return [task for task in tasks if task.parts]

    def _finish(self, bound: Bound, nodes: Cells, pack: Any, row: Any) -> None:
        self.spots.pack[nodes], self.spots.row[nodes] = pack, row
        self.progress[bound.name].done += len(nodes)
        self._calls.release(nodes)

    def _fail(self, bound: Bound, node: int, why: str) -> None:
        self.failed[node], self._odd[node] = why, True
        self.progress[bound.name].failed += 1
        self._calls.release(np.array([node]))

    def work_left(self) -> dict[str, float]:
        """Return seconds that the missing cells of stages take; of an untimed one, the median."""
        shown = {name: one for name, one in self.progress.items() if one.total}
        whole = {name: self.costs[name] * shown[name].total for name in shown if name in self.costs}
        usual = median(whole.values()) if whole else 0.0
        return {name: whole.get(name, usual) * one.left / one.total for name, one in shown.items()}


@dataclass
class Watch:
    """Observer of a sweep: called with sentences, on every change, and with failures."""

    say: Callable[[str], None]
    step: Callable[[Schedule], None] = lambda schedule: None
    failed: Callable[[Failure], None] = lambda failure: None

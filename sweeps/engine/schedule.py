"""The order of work: missing cells, the calls that compute them, and tasks of several calls."""

from __future__ import annotations

from collections import OrderedDict, defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, field
from statistics import median
from typing import Any

import numpy as np

from sweeps.engine.declarations import VALID
from sweeps.engine.failures import Failure
from sweeps.engine.packs import Spot
from sweeps.engine.plan import Cells, Plan, digest
from sweeps.engine.stage import Bound
from sweeps.engine.tasks import Call, Read, Recipe, Source, Step

SHORTEST, LONGEST = 0.2, 1.5  # s, range of a task's duration
TOGETHER = 5.0  # s, longest task if cells share costly objects
UNKNOWN = 0.1  # s a cell, until one is timed
MOST_CELLS = 4096  # of one task

Find = Callable[[Sequence[str]], dict[str, Spot]]


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


@dataclass(frozen=True, eq=False)
class Job:
    """Cells that one call computes, their keys, and in-memory objects shared with other jobs."""

    bound: Bound
    cells: tuple[int, ...]
    keys: tuple[str, ...]
    affinity: tuple[int, ...]  # numbers of these objects, dependencies first

    @property
    def apart(self) -> list[Job]:
        """Jobs of one cell each."""
        pairs = zip(self.cells, self.keys, strict=True)
        return [Job(self.bound, (cell,), (key,), self.affinity) for cell, key in pairs]


@dataclass
class Schedule:
    """Cells of a plan: finished, failed, or still to be computed.

    `costs` has the seconds per cell by stage; `spots`, by key, locations; `failed`, reasons. Of a
    share `verify` of the cells, calls say how to compute them again, alone.
    """

    plan: Plan
    costs: dict[str, float] = field(default_factory=dict)
    verify: float = 0.0
    spots: dict[str, Spot] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    progress: dict[str, Progress] = field(default_factory=dict)
    _waiting: dict[str, list[Job]] = field(default_factory=lambda: defaultdict(list))
    _missing: dict[Job, int] = field(default_factory=dict)  # inputs that each job waits for
    _ready: OrderedDict[tuple[int, ...], deque[Job]] = field(default_factory=OrderedDict)
    _load: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    _objects: dict[str, int] = field(default_factory=dict)
    _find: Find = lambda keys: {}

    # what is missing ------------------------------------------------------------------------

    def resolve(self, find: Find) -> None:
        """Look up all cells that are needed, and plan calls for missing ones."""
        plan, self._find = self.plan, find
        wanted = {bound: np.zeros(plan.count(bound), bool) for bound in plan.bound.values()}
        for bound in plan.targets:
            wanted[bound][:] = True
        todo: set[str] = set()
        stages: list[list[Job]] = []
        for bound in reversed(plan.bound.values()):  # each before those that it needs
            cells = np.flatnonzero(wanted[bound])
            if bound.stage.kept and cells.size:
                # Equal keys are one cell.
                pairs = zip(plan.keys(bound, cells).tolist(), cells.tolist(), strict=True)
                # Cells that another stage is about to compute are shared, and counted there.
                by_key = {key: cell for key, cell in pairs if key not in todo}
                self.spots.update(find(list(by_key)))
                missing = {key: cell for key, cell in by_key.items() if key not in self.spots}
                total = len(by_key)
                self.progress[bound.name] = Progress(total, total - len(missing))
                todo.update(missing)
                stages.append(self._jobs(bound, missing))
                cells = np.array([*missing.values()], dtype=np.int64)
            for taken in plan.inputs(bound):
                wanted[taken.source][taken.of(cells)] = True
        unfinished: dict[tuple[Bound, Bound, int], set[str]] = {}
        for job in (job for jobs in reversed(stages) for job in jobs):
            needs = self._unfinished(job.bound, np.array(job.cells), todo, unfinished)
            self._missing[job] = len(needs)
            for key in needs:
                self._waiting[key].append(job)
            if not needs:
                self.make_ready(job)

    def _unfinished(
        self, bound: Bound, cells: Cells, todo: set[str], known: dict[Any, set[str]]
    ) -> set[str]:
        """Return keys of inputs of some cells that are to be computed; `known` has earlier ones."""
        needs: set[str] = set()
        for source, first, further in self.plan.inputs(bound):
            for start in set(first[cells].tolist()):
                one = bound, source, start
                if one not in known:
                    taken = (start + further).ravel()
                    if source.stage.kept:
                        known[one] = todo.intersection(self.plan.keys(source, taken).tolist())
                    else:
                        known[one] = self._unfinished(source, taken, todo, known)
                needs |= known[one]
        return needs

    @property
    def ready(self) -> bool:
        """Return whether there are calls whose inputs are all finished."""
        return bool(self._ready)

    def missing_cells(self) -> list[tuple[Bound, int]]:
        """Return stage and number of cells of every call that is left."""
        return [(job.bound, len(job.cells)) for job in self._missing]

    def _jobs(self, bound: Bound, missing: Mapping[str, int]) -> list[Job]:
        """Return calls for some cells: those that differ only on axes computed together share one.

        Calls that share in-memory objects are adjacent, closest where they share most.
        """
        groups: dict[int, list[tuple[str, int]]] = defaultdict(list)
        starts = self._start(bound, np.array([*missing.values()], dtype=np.int64)).tolist()
        for start, one in zip(starts, missing.items(), strict=True):
            groups[start].append(one)
        jobs = []
        for group in groups.values():
            keys, cells = zip(*group, strict=True)
            objects = dict.fromkeys(self._shared(bound, cells[0])) or [bound.name]
            affinity = [self._objects.setdefault(key, len(self._objects)) for key in objects]
            jobs.append(Job(bound, cells, keys, tuple(affinity)))
        return sorted(jobs, key=lambda job: job.affinity)

    def _start(self, bound: Bound, cells: Cells) -> Cells:
        """Return cells at the first place of all axes computed together."""
        for number, stride in self.plan.together[bound].items():
            cells = cells - stride * self.plan.places(bound, number, cells)
        return cells

    def _shared(self, bound: Bound, cell: int) -> list[str]:
        """Return keys of the in-memory objects that a cell needs, dependencies first."""
        keys: list[str] = []
        for source, first, _ in self.plan.inputs(bound):
            if source.stage.memory:
                there = int(first[cell])
                keys += [*self._shared(source, there), self.plan.key(source, there)]
        return keys

    # batches --------------------------------------------------------------------------------

    def make_ready(self, job: Job) -> None:
        """Let a job be part of the next batches."""
        self._ready.setdefault(job.affinity, deque()).append(job)
        self._load[job.bound.name] += len(job.cells)

    def batch(self, workers: int) -> list[tuple[Job, Call]]:
        """Remove and return the next task of the calls that are ready; empty if there is none.

        `workers` tasks run at once: towards the end they get shorter, so that none idles.
        """
        costs = defaultdict(lambda: UNKNOWN, self.costs)
        left = sum(costs[name] * cells for name, cells in self._load.items())
        size = min(max(left / (3 * workers), SHORTEST), LONGEST)
        task: list[tuple[Job, Call]] = []
        seconds, cells = 0.0, 0
        # At least one, even if a damaged index has wrong costs.
        while self._ready and cells < MOST_CELLS:
            affinity, queue = next(iter(self._ready.items()))
            before = task[-1][0].affinity if task else ()
            shared = len(affinity) > 2 and affinity[:2] == before[:2]
            longest = min(TOGETHER, max(left / workers / 2, size)) if shared else size
            if cells and seconds >= longest:
                break
            job = queue.popleft()
            if not queue:
                del self._ready[affinity]
            self._missing.pop(job, None)
            self._load[job.bound.name] -= len(job.cells)
            task += self._calls(job)
            seconds += costs[job.bound.name] * len(job.cells)
            cells += len(job.cells)
        return task

    def _calls(self, job: Job) -> Iterator[tuple[Job, Call]]:
        """Yield a job's calls: one, or one per cell if some input has failed."""
        found = [self._now(job.bound, cell) for cell in job.cells] if self.failed else []
        if all(now == ("", key) for now, key in zip(found, job.keys, strict=False)):
            yield job, self.call(job)
            return
        for alone, (why, key) in zip(job.apart, found, strict=True):
            if why:
                self.finish(alone, [why], 0.0)
            elif spot := self._find([key]).get(key):
                self.finish(alone, [spot], 0.0)
            else:
                yield alone, self.call(alone)

    def _now(self, bound: Bound, cell: int) -> tuple[str, str]:
        """Return why a cell cannot be computed, if an input failed, and the key of its result.

        That is another key than its own where some of the inputs that it gathers failed.
        """
        key = self.plan.key(bound, cell)
        odd = []
        for source, first, further in self.plan.inputs(bound) if self.failed else ():
            taken = (first[cell] + further).ravel().tolist()
            states = [self._input_now(source, there) for there in taken]
            gone = [there for there, (why, _) in zip(taken, states, strict=True) if why]
            if gone and (len(gone) == len(taken) or not further.ndim):
                return f"needs {self.plan.described(source, gone[0])}, which failed", ""
            for number, (there, (_, now)) in enumerate(zip(taken, states, strict=True)):
                if now != self.plan.key(source, there):
                    odd.append((source.name, number, now))
        return "", digest(repr((key, odd))) if odd else key

    def _input_now(self, source: Bound, cell: int) -> tuple[str, str]:
        """Return why an input's cell failed, or else the key under which its result is kept."""
        if not source.stage.kept:
            return self._now(source, cell)
        key = self.plan.key(source, cell)
        return (self.failed[key], "") if key in self.failed else ("", self.spots[key].key)

    # calls ----------------------------------------------------------------------------------

    def call(self, job: Job, *, verified: bool = True) -> Call:
        """Return one call for a job; a share of its cells is computed again if `verified`."""
        plan, bound = self.plan, job.bound
        # The cells that it computes: by the values that occur on each axis computed together.
        grid = self._start(bound, np.array(job.cells[0]))
        strides = plan.together[bound]
        for key in bound.along:
            number = plan.axis_number(key)
            places = np.unique(plan.places(bound, number, np.array(job.cells)))
            grid = np.add.outer(grid, strides.get(number, 0) * places)
        at = {cell: place for place, cell in enumerate(grid.ravel().tolist())}
        keys = [self._now(bound, cell)[1] for cell in job.cells] if self.failed else job.keys
        cells = zip(keys, (at[cell] for cell in job.cells), strict=True)
        again = [
            (number, self.call(alone, verified=False))
            for number, alone in enumerate(job.apart if verified and self.verify else ())
            if int(alone.keys[0][:8], 16) < self.verify * 2**32
        ]
        return Call(self._recipe(bound, grid), grid.shape, tuple(cells), tuple(again))

    def _recipe(self, bound: Bound, grid: Cells) -> Recipe:
        """Return arguments of a call for cells of which each axis is one that it computes."""
        plan, along, cell = self.plan, bound.along, int(grid.flat[0])
        sources: dict[str, Source] = {}
        asks = VALID in bound.stage.arguments
        gathered = [len(plan.axes[plan.axis_number(key)].points) for key in bound.gather]
        valid = np.ones(gathered, dtype=bool) if asks else None
        for argument in bound.arguments:
            source, setting = argument.source, argument.setting
            if setting is not None and setting.key in along:
                rows = np.moveaxis(grid, along.index(setting.key), 0)
                firsts = rows.reshape(len(rows), -1)[:, 0].tolist()
                values = tuple(plan.value(bound, setting.key, first) for first in firsts)
                sources[argument.name] = (setting.in_si(values),)
            elif source is None or source.stage.plain:
                sources[argument.name] = (plan.plain_argument(bound, argument, cell),)
            elif not source.stage.kept:
                there = plan.taken(bound)[source].first[cell]
                sources[argument.name] = self._recipe(source, np.array(there))
            else:
                read, present = self._read(bound, source, grid)
                sources[argument.name] = read
                if valid is not None:
                    valid &= present
        stream = plan.stream(bound, cell) if bound.random else None
        key = "" if bound.stage.kept else self._now(bound, cell)[1]
        return Recipe(Step.of(bound.stage), sources, stream, valid, key)

    def _read(self, bound: Bound, source: Bound, grid: Cells) -> tuple[Read, Any]:
        """Return an input, and where on the gathered axes all of its cells exist."""
        plan, (_, first, further) = self.plan, self.plan.taken(bound)[source]
        # Along axes on which the input does not depend, it is the same.
        own = tuple(slice(None) if key in source.needs else 0 for key in bound.along)
        taken = np.add.outer(first[grid[own]], further)
        found = [self.spots.get(key) for key in plan.keys(source, taken.ravel())]
        places = [place for place, spot in enumerate(found) if spot is not None]
        spots = tuple(spot for spot in found if spot is not None)
        read = Read(Step.of(source.stage), spots, np.shape(taken) or None, tuple(places))
        there = np.array([spot is not None for spot in found]).reshape(np.shape(taken))
        present = np.asarray(there.all(axis=tuple(range(there.ndim - further.ndim))))
        lacking = tuple(slice(None) if key in source.needs else None for key in bound.gather)
        return read, present[lacking]

    # outcomes -------------------------------------------------------------------------------

    def finish(self, job: Job, cells: Sequence[Spot | str], seconds: float) -> None:
        """Record where each of a job's cells is, or why it failed, and release waiting calls."""
        name = job.bound.name
        shown = self.progress[name]
        shown.seconds += seconds
        if seconds:
            each = seconds / len(cells)
            self.costs[name] = 0.7 * self.costs.get(name, each) + 0.3 * each
        for key, found in zip(job.keys, cells, strict=True):
            if isinstance(found, str):
                self.failed[key] = found
                shown.failed += 1
            else:
                self.spots[key] = found
                shown.done += 1
            for waiting in self._waiting.pop(key, ()):
                self._missing[waiting] -= 1
                if not self._missing[waiting]:
                    self.make_ready(waiting)

    def work_left(self) -> float:
        """Return seconds that the missing cells take; the median stands in for an untimed stage."""
        shown = {name: one for name, one in self.progress.items() if one.total}
        whole = {name: self.costs[name] * shown[name].total for name in shown if name in self.costs}
        usual = median(whole.values()) if whole else 0.0
        return sum(whole.get(name, usual) * one.left / one.total for name, one in shown.items())


@dataclass
class Watch:
    """Observer of a sweep: called with sentences, on every change, and with failures."""

    say: Callable[[str], None]
    step: Callable[[Schedule], None] = lambda schedule: None
    failed: Callable[[Failure], None] = lambda failure: None

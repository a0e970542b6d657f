"""The order of work: missing cells, the calls that compute them, and tasks of several calls."""

from __future__ import annotations

import math
from collections import OrderedDict, defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from statistics import median

import numpy as np

from sweeps.engine.failures import Failure
from sweeps.engine.packs import Spot
from sweeps.engine.plan import Place, Plan, digest
from sweeps.engine.process import uncollected
from sweeps.engine.stage import Bound
from sweeps.engine.tasks import Call, Made, Read, Recipe, Source, Step

SHORTEST, LONGEST = 0.2, 1.5  # s, range of a task's duration
TOGETHER = 5.0  # s, longest task if cells share costly objects
UNKNOWN = 0.1  # s a cell, until one is timed
MOST_CELLS = 4096  # of one task

Find = Callable[[Bound, Sequence[str]], dict[str, Spot]]
Need = tuple[Bound, Bound, Place]  # a stage, an input, and the first of its cells


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

    def begin(self, total: int, missing: int) -> None:
        """Set the numbers of all and missing cells; called again if some were damaged."""
        self.total = max(total, self.total)
        self.reused = max(self.total - missing - self.done - self.failed, 0)
        self.done = self.total - missing - self.reused - self.failed


@dataclass(frozen=True, eq=False)
class Job:
    """Cells that one call computes, and keys of in-memory objects that it shares with others."""

    bound: Bound
    places: tuple[Place, ...]
    affinity: tuple[str, ...]


@dataclass
class Schedule:
    """Cells of a plan: finished, failed, or still to be computed.

    `costs` has the seconds per cell by stage; `spots`, by key, locations; `failed`, reasons.
    """

    plan: Plan
    costs: dict[str, float] = field(default_factory=dict)
    spots: dict[str, Spot] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    progress: dict[str, Progress] = field(default_factory=dict)
    _renamed: dict[str, str] = field(default_factory=dict)
    _waiting: dict[str, list[Job]] = field(default_factory=dict)
    _missing: dict[Job, int] = field(default_factory=dict)
    _ready: OrderedDict[tuple[str, ...], deque[Job]] = field(default_factory=OrderedDict)
    _load: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    _find: Find = lambda bound, keys: {}

    # what is missing ------------------------------------------------------------------------

    @uncollected()
    def resolve(self, find: Find) -> None:
        """Look up all cells that are needed, and plan calls for missing ones."""
        plan = self.plan
        self._find = find
        wanted: dict[str, dict[str, Place]] = defaultdict(dict)
        stages: list[list[Job]] = []
        for bound in plan.targets:
            wanted[bound.name] = {plan.key(bound, place): place for place in plan.cells(bound)}
        todo: set[str] = set()
        for bound in reversed(plan.bound.values()):
            cells = wanted[bound.name]
            if not bound.stage.kept or not cells:
                continue
            unknown = [key for key in cells if key not in self.spots and key not in self.failed]
            self.spots.update(find(bound, unknown))
            # Cells that another stage is about to compute are shared, and counted there.
            missing = {k: cells[k] for k in unknown if k not in self.spots and k not in todo}
            own = sum(key not in todo for key in cells)
            self.progress.setdefault(bound.name, Progress()).begin(own, len(missing))
            todo.update(missing)
            for group in self._groups(bound, missing.values()):
                for source, there in self._inputs(group):
                    wanted[source.name].setdefault(plan.key(source, there), there)
            stages.append(self._jobs(bound, missing.values()))
        self._waiting, self._missing = defaultdict(list), {}
        self._ready, self._load = OrderedDict(), defaultdict(int)
        # Stages come in the order in which they need each other.
        missing_of: dict[Need, set[str]] = {}
        for job in (job for jobs in reversed(stages) for job in jobs):
            needs: set[str] = set()
            for group in self._groups(job.bound, job.places):
                if group not in missing_of:
                    keys = {plan.key(source, there) for source, there in self._inputs(group)}
                    missing_of[group] = keys & todo
                needs |= missing_of[group]
            self._missing[job] = len(needs)
            for key in needs:
                self._waiting[key].append(job)
            if not needs:
                self._make_ready(job)

    @property
    def ready(self) -> bool:
        """Return whether there are calls whose inputs are all finished."""
        return bool(self._ready)

    def missing_cells(self) -> list[tuple[Bound, int]]:
        """Return stage and number of cells of every call that is left."""
        return [(job.bound, len(job.places)) for job in self._missing]

    def _groups(self, bound: Bound, places: Iterable[Place]) -> list[Need]:
        """Return the needs of a stage's cells, each once, in order."""
        return list(dict.fromkeys(one for place in places for one in self._needs(bound, place)))

    def _needs(self, bound: Bound, place: Place) -> Iterator[Need]:
        """Yield the needs of a cell, one per input, equal if the input's cells are."""
        for source in bound.inputs:
            if not source.stage.plain:
                yield bound, source, self.plan.first_source(bound, source, place)

    def _inputs(self, need: Need) -> Iterator[tuple[Bound, Place]]:
        """Yield every stored cell that is needed, including those needed by in-memory objects."""
        bound, source, first = need
        for there in self.plan.from_first(bound, source, first):
            if source.stage.kept:
                yield source, there
            else:
                for inner in self._needs(source, there):
                    yield from self._inputs(inner)

    def _jobs(self, bound: Bound, places: Iterable[Place]) -> list[Job]:
        """Return calls for some cells: those that differ only on axes computed together share one.

        Calls that share in-memory objects are adjacent, closest where they share most.
        """
        along = self.plan.together(bound)
        free = [at for at, number in enumerate(self.plan.axes_on(bound)) if number not in along]
        groups: dict[Place, list[Place]] = defaultdict(list)
        for place in places:
            groups[tuple([place[at] for at in free])].append(place)
        jobs = [Job(bound, tuple(one), self._affinity(bound, one[0])) for one in groups.values()]
        keys = dict.fromkeys(key for job in jobs for key in job.affinity)
        first = {key: number for number, key in enumerate(keys)}
        return sorted(jobs, key=lambda job: [first[key] for key in job.affinity])

    def _affinity(self, bound: Bound, place: Place) -> tuple[str, ...]:
        """Return keys of the in-memory objects that a cell needs, dependencies first."""
        keys: list[str] = []

        def collect(one: Bound, there: Place) -> None:
            for source in one.inputs:
                if source.stage.memory:
                    _, at = next(self.plan.sources(one, source, there))
                    collect(source, at)
                    keys.append(self.plan.key(source, at))

        collect(bound, place)
        return tuple(dict.fromkeys(keys)) or (bound.name,)

    # batches --------------------------------------------------------------------------------

    def _make_ready(self, job: Job) -> None:
        self._ready.setdefault(job.affinity, deque()).append(job)
        self._load[job.bound.name] += len(job.places)

    def batch(self, workers: int) -> tuple[list[Job], tuple[Call, ...]]:
        """Remove and return the next task of the calls that are ready; empty if there is none.

        `workers` tasks run at once: towards the end they get shorter, so that none idles.
        """
        costs = defaultdict(lambda: UNKNOWN, self.costs)
        left = sum(costs[name] * cells for name, cells in self._load.items())
        size = min(max(left / (3 * workers), SHORTEST), LONGEST)
        jobs: list[Job] = []
        calls: list[Call] = []
        seconds, cells = 0.0, 0
        # At least one, even if a damaged index has wrong costs.
        while self._ready and cells < MOST_CELLS:
            affinity, there = next(iter(self._ready.items()))
            shared = bool(jobs) and len(affinity) > 2 and affinity[:2] == jobs[-1].affinity[:2]
            longest = min(TOGETHER, max(left / workers / 2, size)) if shared else size
            if cells and seconds >= longest:
                break
            job = there.popleft()
            if not there:
                del self._ready[affinity]
            self._missing.pop(job, None)
            self._load[job.bound.name] -= len(job.places)
            for part, call in self._calls(job):
                jobs.append(part)
                calls.append(call)
            seconds += costs[job.bound.name] * len(job.places)
            cells += len(job.places)
        return jobs, tuple(calls)

    def _calls(self, job: Job) -> Iterator[tuple[Job, Call]]:
        """Yield a job's calls: one, or one per cell if some input has failed."""
        lost = [self._lost(job.bound, place) if self.failed else "" for place in job.places]
        kept = [self.stored_key(job.bound, place) for place in job.places]
        own = [self.plan.key(job.bound, place) for place in job.places]
        if not any(lost) and kept == own:
            yield job, self.call(job.bound, job.places)
            return
        for alone, why, key in zip(apart(job), lost, kept, strict=True):
            if why:
                self.finish(alone, None, why, 0.0)
            elif spot := self._find(job.bound, [key]).get(key):
                self.finish(alone, [spot], "", 0.0)
            else:
                yield alone, self.call(alone.bound, alone.places)

    def retried(self, job: Job) -> list[tuple[Job, Call]]:
        """Return calls for a job's cells one by one, after a call for all of them failed."""
        return [(alone, self.call(alone.bound, alone.places)) for alone in apart(job)]

    def _lost(self, bound: Bound, place: Place) -> str:
        """Return why a cell cannot be computed, if an input failed; else an empty text."""
        for source in bound.inputs:
            if source.stage.plain:
                continue
            found = [there for _, there in self.plan.sources(bound, source, place)]
            if source.stage.kept:
                gone = [there for there in found if self.plan.key(source, there) in self.failed]
            else:
                gone = [there for there in found if self._lost(source, there)]
            if gone and (len(gone) == len(found) or not self.plan.whole_axes(bound, source)):
                return f"needs {self.plan.described(source, gone[0])}, which failed"
        return ""

    def stored_key(self, bound: Bound, place: Place) -> str:
        """Return the key under which a cell is stored: a different one if inputs are missing."""
        key = self.plan.key(bound, place)
        if not self.failed:
            return key
        if key not in self._renamed:
            odd = []
            for source in bound.inputs:
                if not source.stage.plain:
                    for point, there in self.plan.sources(bound, source, place):
                        own = self.plan.key(source, there)
                        now = "" if own in self.failed else self.stored_key(source, there)
                        if now != own:
                            odd.append((source.name, point, now))
            self._renamed[key] = digest(repr((key, odd))) if odd else key
        return self._renamed[key]

    # calls ----------------------------------------------------------------------------------

    def call(self, bound: Bound, places: Sequence[Place]) -> Call:
        """Return one call for cells that differ only on the axes computed together."""
        plan, numbers = self.plan, self.plan.axes_on(bound)
        values = {
            number: sorted({place[numbers.index(number)] for place in places})
            for number in plan.together(bound)
        }
        # In the order of the stage, including axes of one value.
        order = [plan.axis_number(key) for key in bound.along]
        shape = tuple(len(values.get(number, (0,))) for number in order)
        cells = []
        for place in places:
            point = [values[n].index(place[numbers.index(n)]) if n in values else 0 for n in order]
            at = int(np.ravel_multi_index(point, shape)) if order else 0
            cells.append((self.stored_key(bound, place), at))
        return Call(
            Step.of(bound.stage), self._recipe(bound, places[0], values), shape, tuple(cells)
        )

    def _recipe(self, bound: Bound, place: Place, values: Mapping[int, list[int]]) -> Recipe:
        """Return arguments of a call for some places on the axes that it computes together."""
        plan = self.plan
        sources: dict[str, Source] = {}
        there: np.ndarray | None = None
        for argument in bound.arguments:
            source, setting = argument.source, argument.setting
            if setting is not None and setting.key in bound.along:
                number = plan.axis_number(setting.key)
                points = [plan.axes[number].points[at][0] for at in values.get(number, ())]
                found = tuple(points) or (plan.value(bound, setting.key, place),)
                sources[argument.name] = (found,)
            elif source is None or source.stage.plain:
                sources[argument.name] = (plan.plain_argument(bound, argument, place),)
            elif not source.stage.kept:
                at = plan.source_place(bound, source, place)
                recipe = self._recipe(source, at, {})
                made = Made(Step.of(source.stage), self.stored_key(source, at), recipe)
                sources[argument.name] = made
            else:
                sources[argument.name], known = self._read(bound, source, place, values)
                if known is not None:
                    there = known if there is None else there & known
        stream = plan.stream(bound, place) if bound.random else None
        flags = None if there is None else (there.shape, there.tobytes())
        return Recipe(sources, stream, flags)

    def _read(
        self, bound: Bound, source: Bound, place: Place, values: Mapping[int, list[int]]
    ) -> tuple[Read, np.ndarray | None]:
        """Return an input, and for a gathered one which of its cells exist."""
        plan, step = self.plan, Step.of(source.stage)
        own = dict(zip(plan.axes_on(bound), place, strict=True))
        # In the order of the stage: axes computed together, then those that it gathers.
        axes: dict[int, Sequence[int]] = {}
        for key in (*bound.along, *bound.gather):
            number = plan.axis_number(key)
            if key in source.needs:
                every = range(len(plan.axes[number].points))
                alone = [own.get(number, 0)]
                axes[number] = every if key in bound.gather else values.get(number, alone)
        if not axes:
            at = plan.source_place(bound, source, place)
            return Read(step, (self.spots[plan.key(source, at)],)), None
        shape = tuple(map(len, axes.values()))
        flat, spots = [], []
        for number, point in enumerate(product(*axes.values())):
            at = plan.source_place(bound, source, place, dict(zip(axes, point, strict=True)))
            spot = self.spots.get(plan.key(source, at))
            if spot is not None:
                flat.append(number)
                spots.append(spot)
        read = Read(step, tuple(spots), shape, tuple(flat))
        if not bound.gather:
            return read, None
        flags = np.zeros(math.prod(shape), dtype=bool)
        flags[flat] = True
        gathered = plan.gathered(bound)
        together = tuple(range(len(axes) - len([number for number in axes if number in gathered])))
        known = np.asarray(flags.reshape(shape).all(axis=together))
        # Along axes on which the input does not depend, all cells exist if one does.
        lacking = [at for at, number in enumerate(gathered) if number not in axes]
        lengths = [len(plan.axes[number].points) for number in gathered]
        return read, np.broadcast_to(np.expand_dims(known, lacking), lengths)

    # outcomes -------------------------------------------------------------------------------

    def finish(self, job: Job, spots: Sequence[Spot] | None, why: str, seconds: float) -> None:
        """Record where a job's cells are, or why it failed, and release waiting calls."""
        name = job.bound.name
        shown = self.progress[name]
        shown.seconds += seconds
        if spots is not None and seconds:
            each = seconds / len(job.places)
            known = self.costs.get(name)
            self.costs[name] = each if known is None else 0.7 * known + 0.3 * each
        for number, place in enumerate(job.places):
            key = self.plan.key(job.bound, place)
            if spots is None:
                self.failed[key] = why
                shown.failed += 1
            else:
                self.spots[key] = spots[number]
                shown.done += 1
            for waiting in self._waiting.pop(key, ()):
                self._missing[waiting] -= 1
                if not self._missing[waiting]:
                    self._make_ready(waiting)

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


def apart(job: Job) -> list[Job]:
    """Return a job's cells one by one."""
    return [Job(job.bound, (place,), job.affinity) for place in job.places]

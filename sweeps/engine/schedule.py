"""The order of work: which cells are missing, which calls make them, and which go together."""

from __future__ import annotations

from collections import OrderedDict, defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from sweeps.engine.calls import CallMaker
from sweeps.engine.inputs import Spot
from sweeps.engine.plan import Place, Plan, digest
from sweeps.engine.progress import Progress
from sweeps.engine.stage import Bound
from sweeps.engine.tasks import Call

SHORTEST, LONGEST = 0.2, 1.5  # s, what a task should take
TOGETHER = 5.0  # s, what it may take where cells share costly objects
UNKNOWN = 0.1  # s a cell, until one is measured
MOST_CELLS = 4096  # of one task

Find = Callable[[Sequence[str]], dict[str, Spot]]
Need = tuple[Bound, Bound, Place]  # a stage, an input, and the first of its cells


@dataclass(frozen=True, eq=False)
class Job:
    """Cells that one call makes, before it is known where its inputs are.

    Attributes
    ----------
    bound : Bound
        Their stage.
    places : tuple of Place
        Of the cells.
    affinity : tuple of str
        What in memory it shares with others.
    """

    bound: Bound
    places: tuple[Place, ...]
    affinity: tuple[str, ...]


@dataclass
class Schedule:
    """Cells of a plan that are there, failed, or still to be made.

    Attributes
    ----------
    plan : Plan
        What is wanted.
    spots : dict of str to Spot
        Where the cells are that are there, by key.
    failed : dict of str to str
        Why cells failed, by key.
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
    _find: Find = lambda keys: {}
    _make: CallMaker = field(init=False)

    def __post_init__(self) -> None:
        self._make = CallMaker(self.plan, self.spots, self.stored_key)

    # what is missing ------------------------------------------------------------------------

    def resolve(self, find: Find) -> None:
        """Look up all cells that are needed, and plan calls for those that are not there.

        Parameters
        ----------
        find : callable
            Keys -> spots of those that are there.
        """
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
            self.spots.update(find(unknown))
            missing = {key: cells[key] for key in unknown if key not in self.spots}
            self.progress.setdefault(bound.name, Progress()).begin(len(cells), len(missing))
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
        """Whether there are calls whose inputs are all there."""
        return bool(self._ready)

    def missing_cells(self) -> Iterator[tuple[Bound, int]]:
        """Stage and number of cells of every call that is left."""
        for job in self._missing:
            yield job.bound, len(job.places)

    def _groups(self, bound: Bound, places: Iterable[Place]) -> list[Need]:
        """What cells of a stage need, each once, in their order."""
        return list(dict.fromkeys(one for place in places for one in self._needs(bound, place)))

    def _needs(self, bound: Bound, place: Place) -> Iterator[Need]:
        """What a cell needs, an entry for every input, the same where the input's cells are."""
        for source in bound.inputs:
            if not source.stage.plain:
                yield bound, source, self.plan.first_source(bound, source, place)

    def _inputs(self, need: Need) -> Iterator[tuple[Bound, Place]]:
        """Every kept cell that is needed, through objects in memory, too."""
        bound, source, first = need
        for there in self.plan.from_first(bound, source, first):
            if source.stage.kept:
                yield source, there
            else:
                for inner in self._needs(source, there):
                    yield from self._inputs(inner)

    def _jobs(self, bound: Bound, places: Iterable[Place]) -> list[Job]:
        """Calls for some cells: those that differ only on axes computed together share one.

        Calls that share objects in memory follow one another, those that share most nearest.
        """
        along = self.plan.together(bound)
        free = [
            position
            for position, number in enumerate(self.plan.axes_on(bound))
            if number not in along
        ]
        groups: dict[Place, list[Place]] = defaultdict(list)
        for place in places:
            groups[tuple(place[position] for position in free)].append(place)
        jobs = [
            Job(bound, tuple(members), self._affinity(bound, members[0]))
            for members in groups.values()
        ]
        first: dict[str, int] = {}
        for job in jobs:
            for key in job.affinity:
                first.setdefault(key, len(first))
        return sorted(jobs, key=lambda job: [first[key] for key in job.affinity])

    def _affinity(self, bound: Bound, place: Place) -> tuple[str, ...]:
        """Keys of the objects in memory that a cell needs, those that others need first."""
        keys: list[str] = []

        def collect(one: Bound, there: Place) -> None:
            for source in one.inputs:
                if source.stage.memory:
                    _, at = next(self.plan.sources(one, source, there))
                    collect(source, at)
                    keys.append(self.plan.key(source, at))

        collect(bound, place)
        return tuple(dict.fromkeys(keys)) or (bound.name,)

    # handing out ----------------------------------------------------------------------------

    def _make_ready(self, job: Job) -> None:
        self._ready.setdefault(job.affinity, deque()).append(job)
        self._load[job.bound.name] += len(job.places)

    def cost(self, name: str) -> float:
        """Seconds a cell of a stage, as far as known."""
        return self.costs.get(name, UNKNOWN)

    def batch(self, workers: int) -> tuple[list[Job], tuple[Call, ...]]:
        """Take the next task off the calls that are ready; empty when none is.

        Parameters
        ----------
        workers : int
            How many tasks run at once: towards the end tasks get shorter, so that none idles.
        """
        left = sum(self.cost(name) * cells for name, cells in self._load.items())
        size = min(max(left / (3 * workers), SHORTEST), LONGEST)
        jobs: list[Job] = []
        calls: list[Call] = []
        seconds, cells = 0.0, 0
        # One at least, whatever a damaged index says of costs.
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
            seconds += self.cost(job.bound.name) * len(job.places)
            cells += len(job.places)
        return jobs, tuple(calls)

    def _calls(self, job: Job) -> Iterator[tuple[Job, Call]]:
        """A job's calls: one, or one a cell where some input has failed."""
        lost = [self._lost(job.bound, place) if self.failed else "" for place in job.places]
        kept = [self.stored_key(job.bound, place) for place in job.places]
        own = [self.plan.key(job.bound, place) for place in job.places]
        if not any(lost) and kept == own:
            yield job, self._make.call(job.bound, job.places)
            return
        for alone, why, key in zip(self.apart(job), lost, kept, strict=True):
            if why:
                self.finish(alone, None, why, 0.0)
            elif spot := self._find([key]).get(key):
                self.finish(alone, [spot], "", 0.0)
            else:
                yield alone, self._make.call(alone.bound, alone.places)

    @staticmethod
    def apart(job: Job) -> list[Job]:
        """A job's cells one by one."""
        return [Job(job.bound, (place,), job.affinity) for place in job.places]

    def retried(self, job: Job) -> list[tuple[Job, Call]]:
        """Calls for a job's cells one by one, when all in one have failed."""
        return [(alone, self._make.call(alone.bound, alone.places)) for alone in self.apart(job)]

    def _lost(self, bound: Bound, place: Place) -> str:
        """Why a cell cannot be made, for want of an input; empty where it can."""
        for source in bound.inputs:
            if source.stage.plain:
                continue
            found = [
                (self.plan.key(source, there), there)
                for _, there in self.plan.sources(bound, source, place)
            ]
            gone = [
                (key, there)
                for key, there in found
                if (key in self.failed if source.stage.kept else self._lost(source, there))
            ]
            if gone and (len(gone) == len(found) or not self.plan.whole_axes(bound, source)):
                return f"needs {self.plan.described(source, gone[0][1])}, which failed"
        return ""

    def stored_key(self, bound: Bound, place: Place) -> str:
        """Key under which a cell is kept: another one where inputs are lacking."""
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

    def kept_as(self, key: str) -> str:
        """Key under which the cell of a key is kept; see `stored_key`."""
        return self._renamed.get(key, key)

    # outcomes -------------------------------------------------------------------------------

    def finish(self, job: Job, spots: Sequence[Spot] | None, why: str, seconds: float) -> None:
        """Take down what became of a call, and make ready what waited for it.

        Parameters
        ----------
        job : Job
            What was called.
        spots : sequence of Spot or None
            Where its cells are; None when it failed.
        why : str
            Why it failed.
        seconds : float
            Time that it took.
        """
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

"""A complete sweep: find finished cells, compute missing ones, and write the store."""

from __future__ import annotations

import errno
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from itertools import count
from pathlib import Path

from sweeps.engine.attributes import nested, plain
from sweeps.engine.cluster import ClusterChoice, Executor, InlineExecutor, executor
from sweeps.engine.cube import Cube
from sweeps.engine.failures import Failure, reason, traceback_of
from sweeps.engine.folders import (
    PARTIAL,
    Remove,
    check_apart,
    check_folder,
    check_target,
    hidden,
    locked,
    real_place,
    remove_folder,
    verify,
)
from sweeps.engine.interrupts import heed, heeding, interruptible
from sweeps.engine.packs import PRIVATE, Spot, read_cells
from sweeps.engine.plan import Plan
from sweeps.engine.process import environment
from sweeps.engine.provenance import EVERYWHERE, check_extends, provenance
from sweeps.engine.results import CellIndex, open_index
from sweeps.engine.returned import uneven
from sweeps.engine.schedule import Job, Progress, Schedule, Watch, apart
from sweeps.engine.settings import Choices
from sweeps.engine.stage import Bound, Experiment, functions_of
from sweeps.engine.store import read_attributes, write_store
from sweeps.engine.tables import add_tables
from sweeps.engine.takeover import OldStore
from sweeps.engine.tasks import Call, Damaged, Report, run_calls

WRITERS = 2  # threads that write chunks
AT_ONCE = 512  # cells that are read again after damage
ROUNDS = 20  # of computing damaged results again, before blaming the disk
AHEAD = 2  # tasks queued for each worker, so that it never waits for the next
QUICK = 1.0  # s of work that finishes before worker processes would have started


@dataclass(frozen=True)
class Place:
    """Store, cache and cluster of a sweep, and the limit of the cache [byte].

    A share `verify` of the cells is computed twice and compared. `remove` removes the folder of a
    replaced store, which takes as long as writing it.
    """

    store: Path
    cache: Path
    cluster: ClusterChoice = field(default_factory=ClusterChoice)
    cache_limit: int = 20 * 2**30
    verify: float = 0.0
    remove: Remove = remove_folder


@dataclass
class Finished:
    """Outcome of a sweep: progress by stage, and the cells that failed with the reason of each.

    `axes` has the number of values of everything that was swept, by key; keys of settings that
    run together are joined by `+`. `left` says which part of the report could not be written.
    """

    progress: Mapping[str, Progress] = field(default_factory=dict)
    failures: list[tuple[str, str]] = field(default_factory=list)
    written: bool = False  # whether the store is new or changed
    seconds: float = 0.0
    axes: Mapping[str, int] = field(default_factory=dict)
    left: str = ""


def existing(experiment: Experiment, path: Path, plan: Plan) -> Mapping[str, object] | None:
    """Return attributes of the store that a sweep extends; None if there is none."""
    attributes = read_attributes(path)
    if attributes is not None:
        check_extends(experiment, str(path), attributes, plan)
    return attributes


def sweep(experiment: Experiment, choices: Choices, place: Place, watch: Watch) -> Finished:
    """Compute all missing cells of an experiment, and write its store.

    Raises
    ------
    ConfigurationError
        If the store holds other data, or another sweep writes it. Nothing was written.
    OSError
        If the store cannot be written; finished results are kept in the cache.
    """
    with environment(experiment.environment(choices)):
        return _locked_sweep(experiment, choices, place, watch)


def _locked_sweep(experiment: Experiment, choices: Choices, place: Place, watch: Watch) -> Finished:
    start, begun = time.perf_counter(), time.time()
    check_target(place.store)
    check_folder("cache", place.cache)
    check_apart([place.store], place.cache, lambda store: ())
    place = replace(place, cache=place.cache.absolute())  # workers may be started elsewhere
    plan = Plan(experiment, choices)
    with locked(place.store), open_index(place.cache, watch.say) as index:
        old = existing(experiment, place.store, plan)
        # The thread starts and ends workers while this one plans and writes.
        with _spill(place.store) as spill, ThreadPoolExecutor(1, "cluster") as thread:
            finished = _sweep(plan, place, old, index, spill, watch, thread)
        index.shrink(place.cache_limit, keep_since=begun)
    finished.seconds, finished.axes = time.perf_counter() - start, plan.swept
    return finished


@contextmanager
def _spill(store: Path) -> Iterator[Path]:
    """Yield a temporary folder beside the store for results that the cache cannot hold."""
    folder = hidden(real_place(store), PARTIAL)  # a name by which it is found after a crash
    folder.mkdir(PRIVATE)
    try:
        yield folder
    finally:
        remove_folder(folder)


def _sweep(
    plan: Plan,
    place: Place,
    old: Mapping[str, object] | None,
    index: CellIndex,
    spill: Path,
    watch: Watch,
    thread: ThreadPoolExecutor,
) -> Finished:
    schedule = Schedule(plan, {name: seconds for name, (seconds, _) in index.costs().items()})
    before = OldStore(plan, place.store, old, watch.say) if old is not None else None

    def find(bound: Bound, keys: Sequence[str]) -> dict[str, Spot]:
        found = index.find(keys)
        if before is not None and len(found) < len(keys):
            found |= before.find(bound, [key for key in keys if key not in found], spill)
        return found

    failures: list[tuple[str, str]] = []
    for _ in range(ROUNDS):
        damaged: set[str] = set()
        with _workers(place, plan, spill, watch, thread) as start:
            if place.cluster.kind == "local" and old is None and not index.summary():
                start(sum(plan.count(bound) for bound in plan.bound.values() if bound.stage.kept))
            with interruptible():
                schedule.resolve(find)
                missing = schedule.missing_cells()
            cells = sum(number for _, number in missing)
            total = sum(one.total for one in schedule.progress.values())
            watch.say(f"{cells:,} cells to compute, {total - cells:,} reused from the cache")
            watch.step(schedule)
            if schedule.ready:
                measured = all(bound.name in schedule.costs for bound, _ in missing)
                quick = measured and schedule.work_left() < QUICK
                starting = start(len(missing), quick=quick)
                if place.cluster.kind == "local":
                    functions = functions_of(bound for bound, _ in missing)
                    plan.experiment.prepare(plan.choices, functions, heeding(watch.say))
                with interruptible():
                    workers = starting.result()
                if plan.experiment.tables and not isinstance(workers, InlineExecutor):
                    thread.submit(_import_for_tables)  # while they work
                damaged, failed = execute(
                    schedule,
                    workers,
                    index,
                    folder=place.cache,
                    spill=spill,
                    watch=watch,
                    verify=place.verify,
                )
                failures += failed
            elif old is not None and _is_whole(plan, place.store, old, watch):
                index.used(path for path, *_ in schedule.spots.values())
                return Finished(schedule.progress, failures)
        if not damaged:
            try:
                failures += _write(plan, schedule, place, watch)
            except Damaged:
                damaged = _damaged(schedule, place)
            else:
                index.used(path for path, *_ in schedule.spots.values())
                return Finished(schedule.progress, failures, written=True)
        watch.say(f"{len(damaged):,} results in the cache are damaged and are computed again")
        index.forget(sorted(damaged))
        for key in [key for key, spot in schedule.spots.items() if spot.key in damaged]:
            del schedule.spots[key]
    raise OSError(errno.EIO, "results cannot be read back as they were written", str(place.cache))


@contextmanager
def _workers(
    place: Place, plan: Plan, spill: Path, watch: Watch, thread: ThreadPoolExecutor
) -> Iterator[Callable[..., Future[Executor]]]:
    """Yield a function that starts workers in a thread, once; stop them afterwards."""
    stack, choice = ExitStack(), place.cluster
    started: list[Future[Executor]] = []

    def start(tasks: int, *, quick: bool = False) -> Future[Executor]:
        if not started:
            chosen = ClusterChoice("inline") if quick and choice.kind == "local" else choice
            entered = executor(
                chosen,
                tasks=tasks,
                packages=plan.experiment.code,
                modules=plan.modules,
                folders=(place.cache, spill),
                say=watch.say,
            )
            started.append(thread.submit(stack.enter_context, entered))
        return started[0]

    try:
        yield start
    finally:
        thread.submit(stack.close)


# running tasks ----------------------------------------------------------------------------------


def execute(
    schedule: Schedule,
    executor: Executor,
    index: CellIndex,
    *,
    folder: Path,
    spill: Path,
    watch: Watch,
    verify: float = 0.0,
) -> tuple[set[str], list[tuple[str, str]]]:
    """Run all calls of a schedule, and record finished cells in the index.

    Packs go to `folder`, or to `spill` when that is full. A share `verify` of the cells is computed
    again, alone: a cell that then differs fails. Returns the keys of cells that could not
    be read back, and the names of those that failed, with the reasons. Raises `DeclarationError`
    if arrays of an output differ in shape, and it has no value to pad them with.
    """
    damaged: set[str] = set()
    failures: list[tuple[str, str]] = []
    under_way: dict[int, tuple[list[Job], tuple[Call, ...]]] = {}
    numbers = count()
    spilled = False
    shapes: dict[tuple[str, str], tuple[int, ...]] = {}

    def hand_out(jobs: list[Job], calls: tuple[Call, ...]) -> None:
        number = next(numbers)
        if verify:
            pairs = zip(jobs, calls, strict=True)
            calls = tuple(_verified(schedule, job, call, verify) for job, call in pairs)
        executor.submit(number, run_calls, calls, folder, spill)
        under_way[number] = jobs, calls

    def fail(job: Job, why: str, arguments: str = "", traceback: str = "") -> None:
        schedule.finish(job, None, why, 0.0)
        for place in job.places:
            failures.append((schedule.plan.described(job.bound, place), why))
            watch.failed(Failure(*failures[-1], arguments, traceback))

    def take_down(jobs: list[Job], report: Report) -> None:
        seconds: dict[str, float] = defaultdict(float)
        for job, done in zip(jobs, report.calls, strict=True):
            if done.damaged:
                damaged.update(done.damaged)
            elif done.reason and len(job.places) > 1:
                for alone, call in schedule.retried(job):  # one of its values may be the cause
                    hand_out([alone], (call,))
            elif done.reason:
                fail(job, done.reason, done.arguments, done.traceback)
            else:
                seconds[job.bound.name] += done.seconds
                spots = iter(done.spots)
                for number, alone in enumerate(apart(job) if done.differing else ()):
                    if number in done.differing:
                        fail(alone, done.differing[number])
                    else:
                        schedule.finish(alone, [next(spots)], "", done.seconds / len(job.places))
                if not done.differing:
                    schedule.finish(job, done.spots, "", done.seconds)
        for stage, output, shape in report.shapes:
            first = shapes.setdefault((stage, output), shape)
            if shape != first:
                raise uneven(stage, output, shape, first)
        for name, pack in report.packs:
            if not Path(pack.path).is_absolute():  # spilled packs are removed after this run
                index.add(name, [pack], seconds[name])

    while schedule.ready or under_way:
        while schedule.ready and len(under_way) < AHEAD * executor.workers:
            jobs, calls = schedule.batch(executor.workers)
            if calls:
                hand_out(jobs, calls)
        with interruptible():
            finished = executor.finished() if under_way else []
        for task, report, error in finished:
            jobs, calls = under_way.pop(task)
            if error is None:
                take_down(jobs, report)
                if report.spilled and not spilled:
                    spilled = True
                    watch.say(
                        f"results are not cached: the cache cannot be written ({report.spilled})"
                    )
            elif len(jobs) == 1:
                fail(jobs[0], reason(error), traceback=traceback_of(error))
            else:
                for job, call in zip(jobs, calls, strict=True):  # one may have killed the worker
                    hand_out([job], (call,))
        watch.step(schedule)
    return damaged, failures


def _verified(schedule: Schedule, job: Job, call: Call, share: float) -> Call:
    """Return a call with those for a share of its cells, chosen by their keys, again alone."""
    keys = [schedule.plan.key(job.bound, place) for place in job.places]
    chosen = [number for number, key in enumerate(keys) if int(key[:8], 16) < share * 2**32]
    again = ((number, schedule.call(job.bound, [job.places[number]])) for number in chosen)
    return replace(call, again=tuple(again))


# the store --------------------------------------------------------------------------------------


def _import_for_tables() -> None:
    """Import libraries for tables and the report, which takes most of a second."""
    for name in ("xarray", "zarr", "dask.array"):  # which xarray imports for its first variable
        import_module(name)


def _damaged(schedule: Schedule, place: Place) -> set[str]:
    """Return keys of all cells that cannot be read back."""
    spots = sorted(schedule.spots.values())
    damaged: set[str] = set()
    for start in range(0, len(spots), AT_ONCE):
        part = spots[start : start + AT_ONCE]
        found = zip(part, read_cells(place.cache, part), strict=True)
        damaged |= {spot.key for spot, arrays in found if arrays is None}
    return damaged


def _is_whole(plan: Plan, path: Path, old: Mapping[str, object], watch: Watch) -> bool:
    """Return whether a store already has all of a plan, and is undamaged."""
    # As read back from a store.
    heed()
    if "failures" in old or dict(old) != nested(plain(provenance(plan))):
        return False
    bad = verify(path)
    if bad:
        watch.say(f"{len(bad):,} files of the store are damaged ({bad[0]}) and are written again")
    return not bad


def _write(plan: Plan, schedule: Schedule, place: Place, watch: Watch) -> list[tuple[str, str]]:
    """Assemble the store with its tables, and move it to its place; return tables that failed."""
    heed()
    failed = schedule.failed
    cube = Cube(plan, schedule.spots, failed, partial(read_cells, place.cache))
    failures = {
        plan.described(bound, at): failed[key]
        for bound in plan.bound.values()
        if failed and bound.stage.kept
        for at in plan.cells(bound)
        if (key := plan.key(bound, at)) in failed
    }
    with interruptible():
        groups = cube.groups()
        found = add_tables(plan, groups)
    lost = {failure.what: failure.why for failure in found}
    for failure in found:
        watch.failed(failure)
    write_store(
        place.store,
        groups,
        provenance(plan, failures | lost),
        everywhere=EVERYWHERE,
        threads=WRITERS,
        remove=place.remove,
    )
    return list(lost.items())

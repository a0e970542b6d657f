"""A whole sweep: what is there is found, what is missing is made, and the store written."""

from __future__ import annotations

import errno
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from sweeps.engine.cluster import ClusterChoice, executor
from sweeps.engine.cube import Cube
from sweeps.engine.execute import Watch, execute
from sweeps.engine.folders import (
    PARTIAL,
    check_folder,
    check_target,
    hidden,
    locked,
    real_place,
    verify,
)
from sweeps.engine.inputs import Damaged
from sweeps.engine.plan import Plan
from sweeps.engine.progress import Progress
from sweeps.engine.provenance import check_extends, provenance
from sweeps.engine.results import CellIndex, open_index, read_cells
from sweeps.engine.schedule import Schedule
from sweeps.engine.settings import Choices
from sweeps.engine.stage import Experiment
from sweeps.engine.store import add_group, read_attributes, write_store
from sweeps.engine.takeover import OldStore

WRITERS = 2  # threads that write chunks
AT_ONCE = 512  # cells that are read again after damage
ROUNDS = 20  # of making damaged results again, before the disk is held to be at fault


@dataclass(frozen=True)
class Place:
    """Where a sweep runs.

    Attributes
    ----------
    store, cache : Path
        Folder of the store, and of finished results.
    cluster : ClusterChoice
        Who does the work.
    cache_limit : int
        Bytes of finished results that are kept.
    """

    store: Path
    cache: Path
    cluster: ClusterChoice = field(default_factory=ClusterChoice)
    cache_limit: int = 20 * 2**30


@dataclass
class Finished:
    """What a sweep came to.

    Attributes
    ----------
    progress : mapping of str to Progress
        By stage.
    failures : list of (str, str)
        Names of cells that failed, and why.
    written : bool
        Whether the store is new or changed.
    seconds : float
        Time that it took.
    """

    progress: Mapping[str, Progress] = field(default_factory=dict)
    failures: list[tuple[str, str]] = field(default_factory=list)
    written: bool = False
    seconds: float = 0.0


def sweep(experiment: Experiment, choices: Choices, place: Place, watch: Watch) -> Finished:
    """Make all cells of an experiment that are not there yet, and its store.

    Parameters
    ----------
    experiment : Experiment
        What is declared.
    choices : Choices
        Checked choices.
    place : Place
        Where it runs.
    watch : Watch
        Who is told how it goes.

    Returns
    -------
    Finished

    Raises
    ------
    ConfigurationError
        If the store holds something else, or another sweep writes it. Nothing was written.
    OSError
        If the store cannot be written; finished results are kept in the cache.
    """
    start = time.perf_counter()
    check_target(place.store)
    check_folder("cache", place.cache)
    plan = Plan(experiment, choices)
    with locked(place.store), open_index(place.cache, watch.say) as index:
        old = existing(experiment, place.store, plan)
        with _spill(place.store) as spill:
            finished = _sweep(plan, place, old, index, spill, watch)
        index.shrink(place.cache_limit, keep_since=time.time() - (time.perf_counter() - start))
    finished.seconds = time.perf_counter() - start
    return finished


def existing(experiment: Experiment, path: Path, plan: Plan) -> Mapping[str, object] | None:
    """Attributes of the store that a sweep goes on with; None where there is none."""
    attributes = read_attributes(path)
    if attributes is not None:
        check_extends(experiment, str(path), attributes, plan)
    return attributes


@contextmanager
def _spill(store: Path) -> Iterator[Path]:
    """Folder beside the store for results that the cache does not take; gone afterwards."""
    folder = hidden(real_place(store), PARTIAL)  # a name by which it is found after a kill
    folder.mkdir(parents=True)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _sweep(
    plan: Plan,
    place: Place,
    old: Mapping[str, object] | None,
    index: CellIndex,
    spill: Path,
    watch: Watch,
) -> Finished:
    schedule = Schedule(plan, {name: seconds for name, (seconds, _) in index.costs().items()})
    find = finder(plan, place, old, index, spill, watch.say)
    failures: list[tuple[str, str]] = []
    for _ in range(ROUNDS):
        schedule.resolve(find)
        watch.say(_at_hand(schedule))
        watch.step(schedule)
        damaged: set[str] = set()
        if schedule.ready:
            tasks = sum(1 for _ in schedule.missing_cells())
            packages = plan.experiment.code
            with executor(place.cluster, tasks=tasks, packages=packages, say=watch.say) as workers:
                outcome = execute(
                    schedule, workers, index, folder=place.cache, spill=spill, watch=watch
                )
            failures += outcome.failures
            damaged = outcome.damaged
        elif old is not None and _is_whole(plan, place.store, old, watch):
            index.used(path for path, _ in schedule.spots.values())
            return Finished(schedule.progress, failures)
        if not damaged:
            try:
                _write(plan, schedule, place, watch)
            except Damaged:
                damaged = _damaged(schedule, place)
            else:
                index.used(path for path, _ in schedule.spots.values())
                return Finished(schedule.progress, failures, written=True)
        watch.say(f"{len(damaged)} kept results are damaged; they are made again")
        index.forget(sorted(damaged))
        for key in [key for key in schedule.spots if schedule.kept_as(key) in damaged]:
            del schedule.spots[key]
    raise OSError(errno.EIO, "results cannot be read back as they were written", str(place.cache))


def _damaged(schedule: Schedule, place: Place) -> set[str]:
    """Keys of all cells that cannot be read back."""
    spots = sorted((spot, key) for key, spot in schedule.spots.items())
    damaged: set[str] = set()
    for start in range(0, len(spots), AT_ONCE):
        part = spots[start : start + AT_ONCE]
        found = read_cells(place.cache, [spot for spot, _ in part])
        damaged |= {
            schedule.kept_as(key)
            for (_, key), arrays in zip(part, found, strict=True)
            if arrays is None
        }
    return damaged


def _at_hand(schedule: Schedule) -> str:
    total = sum(one.total for one in schedule.progress.values())
    missing = sum(cells for _, cells in schedule.missing_cells())
    return f"{total - missing} cells are at hand, {missing} are to be made"


def finder(
    plan: Plan,
    place: Place,
    old: Mapping[str, object] | None,
    index: CellIndex,
    spill: Path,
    say: Callable[[str], None],
) -> Callable[[Sequence[str]], dict[str, tuple[str, int]]]:
    """Function that finds cells by key: in the cache, else in the store that is there."""
    before = OldStore(plan, place.store, old, say) if old is not None else None

    def find(keys: Sequence[str]) -> dict[str, tuple[str, int]]:
        found = index.find(keys)
        if before is not None and len(found) < len(keys):
            found |= before.find([key for key in keys if key not in found], spill)
        return found

    return find


def _is_whole(plan: Plan, path: Path, old: Mapping[str, object], watch: Watch) -> bool:
    """Whether a store has all of a plan already, and is as it was written."""
    if "failures" in old or dict(old) != provenance_as_read(plan):
        return False
    bad = verify(path)
    if bad:
        watch.say(f"{len(bad)} files of the store are damaged ({bad[0]}); they are made again")
    return not bad


def _failures(plan: Plan, schedule: Schedule) -> dict[str, str]:
    """Names of all cells that failed, or lack what did, and why."""
    if not schedule.failed:
        return {}
    return {
        plan.described(bound, place): schedule.failed[key]
        for bound in plan.bound.values()
        if bound.stage.kept
        for place in plan.cells(bound)
        if (key := plan.key(bound, place)) in schedule.failed
    }


def provenance_as_read(plan: Plan) -> dict[str, object]:
    """Root attributes as they come back from a store."""
    import json

    found: dict[str, object] = json.loads(json.dumps(provenance(plan)))
    return found


def _write(plan: Plan, schedule: Schedule, place: Place, watch: Watch) -> None:
    """Assemble the store, tables and all, and put it in its place."""
    cube = Cube(
        plan,
        schedule.spots,
        schedule.failed,
        lambda spots: read_cells(place.cache, spots),
        schedule.kept_as,
    )

    def tabulate(path: Path) -> None:
        # Imported where it is used: xarray takes a third of a second.
        import xarray as xr

        for table in plan.experiment.tables:
            if not table.when(plan.choices):
                continue
            with_groups = [path / group for group in table.of]
            if not all(group.is_dir() for group in with_groups):
                continue
            given = [xr.open_zarr(path, group=group, chunks=None).load() for group in table.of]
            made = table.make(*given, plan.choices)
            if made is not None:
                add_group(path, table.group, made)

    write_store(
        place.store,
        cube.groups(),
        provenance(plan, _failures(plan, schedule)),
        after=tabulate,
        threads=WRITERS,
    )

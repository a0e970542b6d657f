"""A complete sweep: find finished cells, compute missing ones, and write the store."""

from __future__ import annotations

import errno
import logging
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path

import numpy as np

from sweeps.engine.cache.index import CellIndex
from sweeps.engine.cache.packs import iter_cells, open_packs
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.failures import Failure
from sweeps.engine.declare.paths import PathOrUrl
from sweeps.engine.declare.stage import BoundStage
from sweeps.engine.declare.storable import decode_attrs, encode_attrs
from sweeps.engine.declare.undeclared import UndeclaredOutput
from sweeps.engine.objects import PRIVATE_MODE, Objects, ensure_folder
from sweeps.engine.resolve.code import module_and_name
from sweeps.engine.resolve.keys import unique_keys
from sweeps.engine.resolve.modules import is_within
from sweeps.engine.resolve.plan import Plan, modules_of
from sweeps.engine.run.cluster import ClusterChoice, Executor
from sweeps.engine.run.execution import Failures, call_each, execute
from sweeps.engine.run.executors import open_executor
from sweeps.engine.run.forking import check_guard
from sweeps.engine.run.interrupts import allow_interrupts, raise_if_stopped
from sweeps.engine.run.process import environment
from sweeps.engine.run.schedule import Callbacks, Progress, Schedule
from sweeps.engine.run.tasks import DamagedResultsError
from sweeps.engine.store.cube import Cube
from sweeps.engine.store.locks import cache_lock, store_lock
from sweeps.engine.store.manifest import verify
from sweeps.engine.store.provenance import SHARED_ATTRIBUTES, check_extends, differences, provenance
from sweeps.engine.store.writing import PARTIAL, read_attributes, recover, write_store

MAX_ROUNDS = 20  # rounds of computing damaged results again, before blaming the disk
LOCAL_KINDS = ("inline", "local")  # kinds of clusters whose workers write no chunks of the store
TABLE_MODULES = ("sweeps.engine.store.tables", "dask.array")  # imported while workers start
EXECUTOR_MODULE = "sweeps.engine.run.dask_cluster"
INLINE_SECONDS = 1.0  # s of work that finishes before worker processes would have started

LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class RunOptions:
    """Store, cache and cluster of a sweep, and the size of the cache [byte] above which it warns.

    A `partial` store has the cells that are in the cache; nothing is computed. `imports` are
    modules that the command needs at the end, imported while workers start and compute.
    """

    store: PathOrUrl
    cache: PathOrUrl
    cluster: ClusterChoice = field(default_factory=ClusterChoice)
    cache_limit: int = 20 * 10**9
    partial: bool = False
    imports: tuple[str, ...] = ()

    @property
    def packs(self) -> Objects:
        """The packs of the cache."""
        return open_packs(self.cache)


@dataclass
class SweepOutcome:
    """Outcome of a sweep: progress by stage, and the failed cells with reasons.

    `axes` has the length of each swept axis by key; keys of settings that run together are joined
    by `+`.
    """

    progress: Mapping[str, Progress] = field(default_factory=dict)
    failures: Failures = field(default_factory=list)
    written: bool = False  # whether the store is new or changed
    seconds: float = 0.0
    axes: Mapping[str, int] = field(default_factory=dict)


def extended_attributes(path: PathOrUrl, plan: Plan) -> Mapping[str, object] | None:
    """Return the attributes of the store that a sweep extends; None if it is new."""
    attributes = read_attributes(path)
    if attributes is not None:
        check_extends(plan.experiment, str(path), attributes, plan)
    return attributes


def sweep(plan: Plan, options: RunOptions, callbacks: Callbacks) -> SweepOutcome:
    """Compute all missing cells of a plan, and write its store; see `check_targets` for its path.

    Raises
    ------
    ConfigurationError
        If the store holds other data, or another sweep writes it. Nothing was written.
    OSError
        If the cache or the store cannot be written; finished results are kept in the cache.
    """
    start = time.perf_counter()
    with ExitStack() as stack:
        stack.enter_context(environment(plan.choices.variables))
        check = stack.enter_context(store_lock(options.store))
        recover(options.store)
        if isinstance(packs := options.packs.path, Path):
            ensure_folder(packs, PRIVATE_MODE)
        stack.enter_context(cache_lock(packs))
        index = CellIndex(options.packs, callbacks.say, plan.identity.values())
        attributes = extended_attributes(options.store, plan)
        if LOG.isEnabledFor(logging.DEBUG):
            for name, reasons in differences(plan, attributes or {}):
                LOG.debug("%s differs from the store in: %s", name, ", ".join(reasons))
        if attributes is not None and is_complete(plan, options.store, attributes, callbacks.say):
            LOG.debug("store is reused: it has all of the sweep, and is undamaged")
            finished = _reuse_store(plan, index, callbacks)
        elif options.partial and attributes is not None and PARTIAL not in attributes:
            raise ConfigurationError(
                f"store is {str(options.store)!r}, a complete store; partial=true would drop "
                "results that the cache has lost; give another store="
            )
        else:
            finished = _compute_and_write(plan, options, index, callbacks, check)
        size = 0
        with suppress(OSError):  # the store is complete even if the cache fails now
            size = sum(options.packs.sizes().values()) if finished.written else 0
        if size > options.cache_limit:
            limit = f"{options.cache_limit / 1e9:g} GB"
            prune = f"{plan.experiment.name} --cache prune={limit.replace(' ', '')}"
            callbacks.say(
                f"{options.cache} has {size / 1e9:.1f} GB, more than cache_limit, {limit}; "
                f"`{prune}` deletes the oldest"
            )
    finished.seconds, finished.axes = time.perf_counter() - start, plan.axis_lengths
    return finished


def _compute_and_write(
    plan: Plan,
    options: RunOptions,
    index: CellIndex,
    callbacks: Callbacks,
    check: Callable[[], None],
) -> SweepOutcome:
    """Compute and write all cells; compute unreadable cells again."""
    # The thread starts and ends workers while this one plans and writes.
    with ThreadPoolExecutor(1, "cluster") as thread:
        for _ in range(MAX_ROUNDS):
            costs = {name: seconds for name, (seconds, _) in index.costs().items()}
            schedule, stack = Schedule(plan, costs), ExitStack()
            try:
                failures, workers = _compute(schedule, options, index, callbacks, thread, stack)
                if options.cluster.kind in LOCAL_KINDS:  # workers end meanwhile
                    thread.submit(stack.close)
                    workers = None
                failures += _write(schedule, options, index, callbacks, check, workers)
            except DamagedResultsError as error:
                damaged = sorted(_damaged_keys(schedule, index.objects).union(error.args))
                keys = np.frombuffer(b"".join(damaged), np.uint64).reshape(-1, 2)
                message = f"{len(damaged):,} results in the cache are damaged"
                callbacks.say(f"{message} and are computed again")
                index.drop(keys)
            else:
                return SweepOutcome(schedule.progress, failures, written=True)
            finally:
                thread.submit(stack.close)
    raise OSError(errno.EIO, "results cannot be read back as they were written", str(options.cache))


def _compute(
    schedule: Schedule,
    options: RunOptions,
    index: CellIndex,
    callbacks: Callbacks,
    thread: ThreadPoolExecutor,
    stack: ExitStack,
) -> tuple[Failures, Executor | None]:
    """Compute missing cells on workers, which `stack` ends; return failures and workers, if any.

    This process does a small amount of work itself, without local workers. Raises what `execute`
    raises.
    """
    plan, choice = schedule.plan, options.cluster
    with allow_interrupts():
        schedule.look_up(index)
        missing = schedule.missing_cells
    cells = sum(number for _, number, _ in missing)
    total = sum(progress.total for progress in schedule.progress.values())
    if options.partial:
        callbacks.say(f"{total - cells:,} of {total:,} cells are in the cache")
        return [], None
    callbacks.say(f"{cells:,} cells to compute, {total - cells:,} reused from the cache")
    for bound, number, calls in missing:
        LOG.debug("%s: %d cells are computed by %d calls", bound.name, number, calls)
    callbacks.step(schedule)
    if not missing:
        return [], None
    if choice.kind == "local":
        check_guard()
        if _fits_in_process(schedule, [bound for bound, *_ in missing], options.store):
            choice = ClusterChoice("inline")
    executor_context = open_executor(
        choice,
        tasks=sum(calls for *_, calls in missing),
        packages=plan.experiment.code,
        modules=modules_of(plan.bound.values()),
        packs=index.objects,
        say=callbacks.say,
    )
    executor_future = thread.submit(stack.enter_context, executor_context)
    is_local = choice.kind in LOCAL_KINDS
    preparations = plan.experiment.prepare(plan.choices, callbacks.say) if is_local else ()
    tables = TABLE_MODULES if plan.experiment.tables else ()
    # The executor first: dask's modules import each other, so only one thread may import them.
    imports = EXECUTOR_MODULE, *tables, *options.imports
    names = deque(imports if choice.kind != "inline" else ())
    while names and not executor_future.done():
        raise_if_stopped()
        with suppress(Exception):  # the report imports it again, and gives the reason
            import_module(names.popleft())
    with allow_interrupts():
        workers = executor_future.result()
    for name in names:  # while workers compute
        thread.submit(import_module, name)
    call_each(preparations, workers, lambda: callbacks.step(schedule))
    return execute(schedule, workers, index, callbacks), workers


def _fits_in_process(schedule: Schedule, stages: Sequence[BoundStage], store: PathOrUrl) -> bool:
    """Return whether this process may do the missing work itself, without worker processes.

    The work must be short, and only of stages in packages that have already made the store: their
    calls have not crashed a process. The calls of a script's stages always need workers.
    """
    if sum(schedule.remaining_seconds().values()) >= INLINE_SECONDS:
        return False
    attributes, packages = read_attributes(store) or {}, schedule.plan.experiment.code
    return "failures" not in attributes and all(
        bound.name in schedule.costs
        and bound.name in attributes.get("code", ())
        and not any(isinstance(output, UndeclaredOutput) for output in bound.stage.outputs)
        and is_within(module_and_name(bound.stage.function)[0], packages)
        for bound in stages
    )


def _damaged_keys(schedule: Schedule, packs: Objects) -> set[bytes]:
    """Return the keys of all cells that cannot be read back."""
    locations = schedule.locations[schedule.locations.present]
    locations = locations[np.lexsort((locations.row, locations.pack))]
    cells = zip(locations.keys, iter_cells(packs, locations), strict=True)
    return {key.tobytes() for key, arrays in cells if arrays is None}


# the store --------------------------------------------------------------------------------------


def is_complete(
    plan: Plan, path: PathOrUrl, old: Mapping[str, object], say: Callable[[str], None]
) -> bool:
    """Return whether an undamaged store has all results of a plan."""
    raise_if_stopped()
    # Encode and decode, to compare with attributes read from a store.
    attributes = decode_attrs(encode_attrs(provenance(plan)))
    if "failures" in old or dict(old) != attributes:
        keys = sorted(key for key in {*old, *attributes} if old.get(key) != attributes.get(key))
        LOG.debug("store is written again: its %s differ", ", ".join(keys))
        return False
    damaged = verify(path)
    if damaged:
        files, are = ("file", "is") if len(damaged) == 1 else ("files", "are")
        number = f"{len(damaged):,} {files} of the store {are} damaged"
        say(f"{number} ({damaged[0]}) and {are} written again")
    return not damaged


def _reuse_store(plan: Plan, index: CellIndex, callbacks: Callbacks) -> SweepOutcome:
    """Return the outcome of a sweep whose store is already complete."""
    progress = {}
    index.refresh()
    for bound in plan.targets:
        keys = plan.keys(bound)
        plan.drop_keys(bound)
        total = len(unique_keys(keys)[0])
        progress[bound.name] = Progress(total, total)
    cells = sum(stage.total for stage in progress.values())
    callbacks.say(f"0 cells to compute, {cells:,} are in the store")
    return SweepOutcome(progress)


def _write(
    schedule: Schedule,
    options: RunOptions,
    index: CellIndex,
    callbacks: Callbacks,
    check: Callable[[], None],
    workers: Executor | None,
) -> Failures:
    """Write the store with its tables; return the tables that failed.

    Remote `workers` write chunks of cells.
    """
    raise_if_stopped()
    plan, failed = schedule.plan, schedule.failed
    cube = Cube(schedule, index.objects)
    failures = {
        plan.cell_name(bound, cell): failed[results[cell]]
        for bound in plan.bound.values()
        if failed and (results := schedule.results.get(bound)) is not None
        for cell in np.flatnonzero(np.isin(results, [*failed])).tolist()
    }
    table_failures: list[Failure] = []
    with allow_interrupts():
        groups = cube.groups()
        if plan.experiment.tables and not options.partial:
            from sweeps.engine.store.tables import add_tables

            table_failures = add_tables(plan, groups)
    failed_tables = {failure.name: failure.reason for failure in table_failures}
    for failure in table_failures:
        callbacks.failed(failure)
    attributes = provenance(plan, failures | failed_tables)
    shared: tuple[str, ...] = SHARED_ATTRIBUTES
    if options.partial:
        total = Progress.sum(schedule.progress.values())
        attributes[PARTIAL] = f"{total.remaining:,} of {total.total:,} cells are missing"
        shared = (*SHARED_ATTRIBUTES, PARTIAL)
    write_store(options.store, groups, attributes, shared=shared, check=check, writers=workers)
    return list(failed_tables.items())


# dry run ------------------------------------------------------------------------------------------


def preview(plan: Plan, options: RunOptions) -> tuple[Mapping[str, tuple[int, int]], str]:
    """Return the number of cells and of cells to compute by stage, and a sentence on the work.

    Nothing is written, and neither store nor cache need exist.

    Raises
    ------
    ConfigurationError
        If the sweep would be refused.
    """
    attributes = extended_attributes(options.store, plan)
    if attributes is not None and is_complete(
        plan, options.store, attributes, lambda sentence: None
    ):
        stages = {bound.name: (plan.count(bound), 0) for bound in plan.targets}
        return stages, "nothing to compute: all cells are in the store"
    packs = replace(options.packs, create=False)
    index = CellIndex(packs, lambda sentence: None, plan.identity.values())
    schedule, costs = Schedule(plan), index.costs()
    schedule.look_up(index)
    stages = {
        name: (progress.total, progress.remaining)
        for name, progress in schedule.progress.items()
        if progress.total
    }
    calls = sum(number for *_, number in schedule.missing_cells)
    if not calls:
        return stages, "nothing to compute: all cells are in the cache"
    size = work = "unknown"
    missing = {name: cells for name, (_, cells) in stages.items() if cells}
    if all(name in costs for name in missing):  # each has been timed
        size = f"{sum(costs[name][1] * cells for name, cells in missing.items()) / 1e6:.3g} MB"
        work = f"{sum(costs[name][0] * cells for name, cells in missing.items()):.3g} s"
    return stages, f"{calls:,} calls to run; new results {size}; time on one core {work}"

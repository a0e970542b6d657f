"""Execution of a schedule: its tasks on workers, and their results in the index of the cache."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from itertools import count

from sweeps.engine.cache.index import CellIndex
from sweeps.engine.cache.packs import NO_PACK
from sweeps.engine.declare.errors import SweepIncompleteError
from sweeps.engine.declare.failures import Failure, format_traceback, one_line
from sweeps.engine.run.cluster import Executor
from sweeps.engine.run.interrupts import allow_interrupts
from sweeps.engine.run.schedule import Callbacks, Schedule, Task
from sweeps.engine.run.tasks import (
    DamagedResultsError,
    Outcome,
    TaskReport,
    run_batches,
    uneven_error,
)

QUEUED_TASKS = 2  # tasks queued for each worker, so that it never waits for the next

Failures = list[tuple[str, str]]
"""Names of cells or tables that failed, with reasons."""


def call_each(
    functions: Sequence[Callable[[], object]], executor: Executor, progress: Callable[[], None]
) -> None:
    """Call functions on workers, side by side, and `progress` whenever a function has ended.

    Raises SweepIncompleteError if one fails.
    """
    for number, function in enumerate(functions):
        executor.submit(number, function)
    remaining = len(functions)
    while remaining:
        with allow_interrupts():
            finished = executor.wait()
        for _, _, error in finished:
            if error is not None:
                raise SweepIncompleteError(
                    f"workers cannot be prepared: {one_line(error)}"
                ) from error
        remaining -= len(finished)
        progress()


def execute(
    schedule: Schedule, executor: Executor, index: CellIndex, callbacks: Callbacks
) -> Failures:
    """Run all calls of a schedule, and record finished cells in the index.

    Returns the names of cells that failed, with the reasons. Raises `DamagedResultsError` at the
    end if cells could not be read back, `DeclarationError` at once if arrays of an output differ in
    shape without a value to pad them with, and OSError if results cannot be written.
    """
    damaged: set[bytes] = set()
    shapes: dict[tuple[str, str], tuple[int, ...]] = {}
    failures: Failures = []
    under_way: dict[int, Task] = {}
    # A worker that dies, for example out of memory, also loses its other tasks. Run each of their
    # calls again, alone, after everything else, to find the call that kills the worker.
    suspects: deque[Task] = deque()
    isolated = False  # whether the running task is a suspect
    numbers = count()

    def submit(task: Task) -> None:
        number, batches = next(numbers), tuple(planned.batch for planned in task.batches)
        executor.submit(number, run_batches, batches, task.order, index.objects)
        under_way[number] = task

    while schedule.has_ready_calls or under_way or suspects:
        if not under_way and (isolated := bool(suspects) and not schedule.has_ready_calls):
            submit(suspects.popleft())
        limit = 0 if isolated else QUEUED_TASKS * executor.worker_count
        while schedule.has_ready_calls and len(under_way) < limit:
            if (task := schedule.next_task(executor.worker_count)).batches:
                submit(task)
        with allow_interrupts():
            finished = executor.wait()
        for number, report, error in finished:
            task = under_way.pop(number)
            if error is not None and not isolated:
                suspects += schedule.split_task(task)
                continue
            if error is not None:
                crash = Failure("", one_line(error), traceback=format_traceback(error))
                cells = range(len(task.batches[0].cells))
                report = TaskReport((Outcome(0.0, dict.fromkeys(cells, crash)),))
            if report.write_error is not None:
                raise report.write_error
            for planned, outcome in zip(task.batches, report.outcomes, strict=True):
                damaged.update(*outcome.damaged_inputs.values())
                pack = NO_PACK if outcome.pack is None else index.add(outcome.pack)
                for failure in schedule.record_outcome(planned, outcome, pack, split=error is None):
                    failures.append(failure[:2])
                    callbacks.failed(failure)
            for stage, output, shape in report.shapes:
                first = shapes.setdefault((stage, output), shape)
                if shape != first:
                    raise uneven_error(stage, output, shape, first)
        callbacks.step(schedule)
    if damaged:
        raise DamagedResultsError(*sorted(damaged))
    return failures

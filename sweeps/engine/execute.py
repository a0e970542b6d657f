"""Carrying out a schedule: tasks handed to an executor, outcomes taken down as they come."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from sweeps.engine.cluster import Executor
from sweeps.engine.results import CellIndex
from sweeps.engine.schedule import Job, Schedule
from sweeps.engine.tasks import Call, Report, reason, run_calls

AHEAD = 2  # tasks a worker has at hand, so that it never waits for the next


@dataclass
class Watch:
    """Who is told how a sweep goes.

    Attributes
    ----------
    say : callable
        Takes one sentence.
    step : callable
        Takes the schedule whenever something has changed.
    failed : callable
        Takes the name of a cell and why it failed.
    """

    say: Callable[[str], None]
    step: Callable[[Schedule], None] = lambda schedule: None
    failed: Callable[[str, str], None] = lambda what, why: None


@dataclass
class Outcome:
    """What a run of a schedule found out.

    Attributes
    ----------
    damaged : set of str
        Keys of cells that could not be read back.
    failures : list of (str, str)
        Names of cells that failed themselves, and why.
    """

    damaged: set[str] = field(default_factory=set)
    failures: list[tuple[str, str]] = field(default_factory=list)


def execute(
    schedule: Schedule,
    executor: Executor,
    index: CellIndex,
    *,
    folder: Path,
    spill: Path,
    watch: Watch,
) -> Outcome:
    """Run all calls of a schedule.

    Parameters
    ----------
    schedule : Schedule
        What is to be done; it takes down what is.
    executor : Executor
        Who does it.
    index : CellIndex
        Where finished cells are noted.
    folder, spill : Path
        Where packs go, and where when that is full.
    watch : Watch
        Who is told.

    Returns
    -------
    Outcome
    """
    outcome = Outcome()
    under_way: dict[int, tuple[list[Job], tuple[Call, ...]]] = {}
    number = 0
    spilled = False

    def hand_out(jobs: list[Job], calls: tuple[Call, ...]) -> None:
        nonlocal number
        executor.submit(number, run_calls, calls, folder, spill)
        under_way[number] = jobs, calls
        number += 1

    while schedule.ready or under_way:
        while schedule.ready and len(under_way) < AHEAD * executor.workers:
            jobs, calls = schedule.batch(executor.workers)
            if calls:
                hand_out(jobs, calls)
        if not under_way:
            continue
        for task, report, error in executor.finished():
            jobs, calls = under_way.pop(task)
            if error is not None and len(jobs) > 1:
                for job, call in zip(jobs, calls, strict=True):  # one of them may have killed it
                    hand_out([job], (call,))
            elif error is not None:
                _fail(schedule, jobs[0], reason(error), outcome, watch)
            else:
                for job in _take_down(schedule, jobs, report, index, outcome, watch):
                    for alone, call in schedule.retried(job):  # one of its values may be at fault
                        hand_out([alone], (call,))
                if report.spilled and not spilled:
                    spilled = True
                    watch.say(f"results are not kept: the cache takes none ({report.spilled})")
        watch.step(schedule)
    return outcome


def _fail(schedule: Schedule, job: Job, why: str, outcome: Outcome, watch: Watch) -> None:
    schedule.finish(job, None, why, 0.0)
    for place in job.places:
        what = schedule.plan.described(job.bound, place)
        outcome.failures.append((what, why))
        watch.failed(what, why)


def _take_down(
    schedule: Schedule,
    jobs: list[Job],
    report: Report,
    index: CellIndex,
    outcome: Outcome,
    watch: Watch,
) -> list[Job]:
    """Take down what became of jobs; those of several cells that failed."""
    seconds: dict[str, float] = {}
    failed: list[Job] = []
    for job, done in zip(jobs, report.calls, strict=True):
        if done.damaged:
            outcome.damaged.update(done.damaged)
        elif done.reason and len(job.places) > 1:
            failed.append(job)
        elif done.reason:
            _fail(schedule, job, done.reason, outcome, watch)
        else:
            name = job.bound.name
            seconds[name] = seconds.get(name, 0.0) + done.seconds
            schedule.finish(job, done.spots, "", done.seconds)
    for name, pack in report.packs:
        if not Path(pack.path).is_absolute():  # what was spilled goes with this run
            index.add(name, [pack], seconds.get(name, 0.0))
    return failed

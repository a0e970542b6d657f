"""Phases of a sweep that the engine runs from this process: how long each takes."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass

from sweeps.engine.declare.settings import Choices
from sweeps.engine.declare.stage import Experiment
from sweeps.engine.resolve.plan import Plan
from sweeps.engine.run.schedule import Progress, Schedule, Watch
from sweeps.engine.store.sweeping import RunOptions, sweep


@dataclass(frozen=True)
class Timed:
    """Time of a sweep.

    Attributes
    ----------
    resolved : float
        From its start until it is known which cells are missing [s].
    executed : float
        From then until the last cell is made, start of workers included [s].
    written : float
        From then until its end: workers ended, store and tables written [s].
    progress : mapping of str to Progress
        Cells and work by stage.
    """

    resolved: float
    executed: float
    written: float
    progress: Mapping[str, Progress]

    @property
    def total(self) -> float:
        """All of it [s]."""
        return self.resolved + self.executed + self.written

    @property
    def work(self) -> float:
        """Time of all calls of stages, summed over workers [s]."""
        return sum(one.seconds for one in self.progress.values())


def timed(experiment: Experiment, choices: Choices, place: RunOptions) -> Timed:
    """Run a sweep and time its phases.

    Raises
    ------
    RuntimeError
        If a cell fails.
    """
    start = time.perf_counter()
    # The first when missing cells are known, the last when all are made; none if all are stored.
    steps: list[float] = []

    def step(schedule: Schedule) -> None:
        steps.append(time.perf_counter())

    finished = sweep(Plan(experiment, choices), place, Watch(lambda sentence: None, step))
    end = time.perf_counter()
    steps += [] if steps else [end]
    for what, why in finished.failures:
        raise RuntimeError(f"{what}: {why}")
    return Timed(
        steps[0] - start,
        steps[-1] - steps[0],
        end - steps[-1],
        finished.progress,
    )

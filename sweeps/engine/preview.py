"""What a sweep would compute, without running it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from sweeps.engine.packs import Spot
from sweeps.engine.plan import Plan
from sweeps.engine.results import CellIndex
from sweeps.engine.run import existing
from sweeps.engine.schedule import Schedule
from sweeps.engine.settings import Choices
from sweeps.engine.stage import Bound, Experiment
from sweeps.engine.takeover import OldStore


@dataclass(frozen=True)
class Preview:
    """Cells, results and time of a sweep that has not been run."""

    stages: Mapping[str, tuple[int, int]]  # cells of each stage, and those to be computed
    calls: int
    size: float | None  # bytes of the new results; None if some stage was never timed
    seconds: float | None  # of work on one core, likewise

    @property
    def sentence(self) -> str:
        """Return calls, size and time in a sentence."""
        if not self.calls:
            return "nothing to compute: all cells are in the cache or the store"
        work = "unknown" if self.seconds is None else f"{self.seconds:.3g} s"
        size = "unknown" if self.size is None else f"{self.size / 1e6:.3g} MB"
        return f"{self.calls:,} calls to run; new results {size}; time on one core {work}"


def preview(
    experiment: Experiment, choices: Choices, cache: Path, store: Path | None = None
) -> Preview:
    """Return what a sweep would compute; write nothing, and neither folder need exist.

    Raises
    ------
    ConfigurationError
        If the sweep would be refused.
    """
    plan = Plan(experiment, choices)
    old = existing(experiment, store, plan) if store is not None else None
    before = OldStore(plan, store, old, lambda sentence: None) if store and old else None
    index = CellIndex(cache, lambda sentence: None)  # which is not saved

    def find(bound: Bound, keys: Sequence[str]) -> dict[str, Spot]:
        there = before.has(bound, keys) if before is not None else ()
        return {key: Spot("", 0, key) for key in there} | index.find(keys)

    schedule, costs = Schedule(plan), index.costs()
    schedule.resolve(find)
    shown = {name: one for name, one in schedule.progress.items() if one.total}
    left = {name: one.left for name, one in shown.items() if one.left}
    known = all(name in costs for name in left)
    return Preview(
        {name: (one.total, one.left) for name, one in shown.items()},
        len(schedule.missing_cells()),
        sum(costs[name][1] * cells for name, cells in left.items()) if known else None,
        sum(costs[name][0] * cells for name, cells in left.items()) if known else None,
    )

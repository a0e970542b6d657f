"""What a sweep would compute, without running it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from sweeps.engine.plan import Plan
from sweeps.engine.results import CellIndex
from sweeps.engine.run import existing, is_whole
from sweeps.engine.schedule import Schedule


def preview(plan: Plan, cache: Path, store: Path) -> tuple[Mapping[str, tuple[int, int]], str]:
    """Return the cells of each stage, those to be computed among them, and the work in words.

    Nothing is written, and neither folder need exist.

    Raises
    ------
    ConfigurationError
        If the sweep would be refused.
    """
    old = existing(plan.experiment, store, plan)
    if old is not None and is_whole(plan, store, old, lambda sentence: None):
        stages = {bound.name: (plan.count(bound), 0) for bound in plan.targets}
        return stages, "nothing to compute: all cells are in the store"
    index = CellIndex(cache, lambda sentence: None)  # which is not saved
    schedule, costs = Schedule(plan), index.costs()
    schedule.resolve(index.find)
    stages = {name: (one.total, one.left) for name, one in schedule.progress.items() if one.total}
    calls = len(schedule.missing_cells())
    if not calls:
        return stages, "nothing to compute: all cells are in the cache"
    size = work = "unknown"
    left = {name: cells for name, (_, cells) in stages.items() if cells}
    if all(name in costs for name in left):  # each has been timed
        size = f"{sum(costs[name][1] * cells for name, cells in left.items()) / 1e6:.3g} MB"
        work = f"{sum(costs[name][0] * cells for name, cells in left.items()):.3g} s"
    return stages, f"{calls:,} calls to run; new results {size}; time on one core {work}"

"""Time of the whole classification part of the article's experiment, by stage."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.phases import timed
from benchmarks.reports import Report
from benchmarks.sweeping import by_stage, choices_of, on_workers
from sweeps.engine.cache.index import CellIndex
from sweeps.engine.cache.packs import open_packs
from sweeps.engine.declare.stage import BoundStage
from sweeps.engine.resolve.plan import Plan
from sweeps.experiment import EXPERIMENT
from sweeps.stages.views import Grid

EXPERIMENTS = ("+experiment=paper",)


def measure(*, repeats: int, overrides: Sequence[str] = EXPERIMENTS) -> Report:
    """Time the classification of an experiment's profiles and silhouettes, which already exist.

    Parameters
    ----------
    repeats : int
        How often.
    overrides : sequence of str
        Arguments of `ncti-sweep` that choose the experiment.

    Returns
    -------
    Report
        Work of each stage, and time of each phase.

    Raises
    ------
    RuntimeError
        If a cell fails.
    """
    choices = choices_of(overrides)
    plan = Plan(EXPERIMENT, choices)
    stages = naming_stages(plan)
    names = {bound.name for bound in stages}
    runs = []
    with tempfile.TemporaryDirectory() as parent:
        folder = Path(parent)
        timed(EXPERIMENT, choices, on_workers(folder, "first.zarr"))
        for turn in range(repeats):
            packs = open_packs(folder / "cache")
            index = CellIndex(packs, lambda sentence: None)
            packs.delete(pack.path for pack in index.packs if pack.stage in names)
            runs.append(timed(EXPERIMENT, choices, on_workers(folder, f"{turn}.zarr")))
    return by_stage(
        f"Classification part of `{' '.join(overrides)}`",
        runs,
        (bound.name for bound in stages),
        ["All that the sensors saw is in the cache. Expected: calls together under 10 s."],
    )


def naming_stages(plan: Plan) -> list[BoundStage]:
    """Return the stored stages that use all views at once, and those that depend on them."""
    found: list[BoundStage] = []
    views = {Grid.ship.key, Grid.aspect.key}
    for bound in plan.bound.values():  # every stage behind those that it needs
        if views <= set(bound.gather) or any(source in found for source in bound.inputs):
            found.append(bound)
    return [bound for bound in found if bound.stage.is_cached]

"""Checks for the tests of an experiment."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.cache.index import CellIndex
from sweeps.engine.cache.packs import iter_cells, open_packs
from sweeps.engine.declare.settings import Choices
from sweeps.engine.declare.stage import MEASURED, BoundStage, Experiment
from sweeps.engine.resolve.plan import Plan
from sweeps.engine.run.cluster import InlineExecutor
from sweeps.engine.run.execution import call_each, execute
from sweeps.engine.run.process import one_thread
from sweeps.engine.run.schedule import MAX_TASK_CELLS, Schedule, Watch
from sweeps.engine.run.tasks import drop_objects, run_batches


def check_pure(
    experiment: Experiment, choices: Choices, *, most: int = MAX_TASK_CELLS
) -> Counter[str]:
    """Return how many cells of each stage are the same when computed again, alone.

    A result must depend on the arguments of its stage alone: on no clock, no generator of its own,
    no earlier call and no object that another call has changed; and with `along`, not on the other
    values that are computed together. Cells are computed in this process.

    Parameters
    ----------
    experiment : Experiment
        Its stages; outputs whose role is `MEASURED` may differ.
    choices : Choices
        Values of its settings, as `sweeps.engine.declare.settings.read_choices` makes them.
    most : int
        Cells of a stage that are computed again, spread evenly over all that it has.

    Raises
    ------
    AssertionError
        Naming every cell that failed or differs, and the first number of it that does.
    """
    with TemporaryDirectory() as folder, one_thread():  # as in workers
        index = CellIndex(open_packs(Path(folder)), _ignore)
        schedule = Schedule(Plan(experiment, choices))
        schedule.look_up(index)
        executor = InlineExecutor()
        call_each(experiment.prepare(choices, _ignore), executor, lambda: None)
        failures = execute(schedule, executor, index, Watch(_ignore))
        found = [f"{name} failed: {why}" for name, why in failures]
        compared: Counter[str] = Counter()
        for bound, results in schedule.results.items():
            cells = np.flatnonzero(results >= 0)
            cells = cells[schedule.locations[results[cells]].present].tolist()
            for cell in cells[:: max(1, -(-len(cells) // most))]:
                compared[bound.name] += 1
                if how := _difference(schedule, index, bound, cell):
                    name = schedule.plan.cell_name(bound, cell)
                    found.append(f"{name} differs when computed again, alone: {how}")
    if found:
        raise AssertionError("\n".join(found))
    return compared


def _ignore(sentence: str) -> None:
    pass


def _difference(schedule: Schedule, index: CellIndex, bound: BoundStage, cell: int) -> str:
    """Return how a cell that was computed differs from the same computed alone, if it does."""
    locations = schedule.locations[schedule.results[bound][[cell]]]
    [first] = iter_cells(index.cells, locations)
    planned = schedule.make_batch(bound, [np.array([cell])])
    drop_objects()
    [outcome] = run_batches((planned.batch,), [0], index.cells).outcomes
    drop_objects()
    if outcome.pack is None:
        return f"it raises {outcome.failed[0].reason}"
    pack = np.array([index.add(outcome.pack)], np.int32)
    [again] = iter_cells(index.cells, replace(locations, pack=pack, row=np.zeros_like(pack)))
    if first is None or again is None:
        return "it cannot be read back from the disk"
    for name in (one.name for one in bound.stage.outputs if one.role != MEASURED):
        if how := _first_difference(name, first[name], again[name]):
            return how
    return ""


def _first_difference(name: str, one: NDArray[Any], other: NDArray[Any]) -> str:
    """Return the first place where two arrays differ, bit by bit; empty if there is none."""
    if one.shape != other.shape:
        return f"{name} has the shape {one.shape}, and then {other.shape}"
    for at in np.ndindex(one.shape) if one.tobytes() != other.tobytes() else ():
        if one[at].tobytes() != other[at].tobytes():
            where = f"{name}{list(at)}" if at else name
            return f"{where} is {one[at].item()!r}, and then {other[at].item()!r}"
    return ""

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
from sweeps.engine.run.schedule import MAX_TASK_CELLS, Callbacks, Schedule
from sweeps.engine.run.tasks import drop_objects, run_batches


def check_pure(
    experiment: Experiment, choices: Choices, *, max_cells: int = MAX_TASK_CELLS
) -> Counter[str]:
    """Recompute cells one by one, and return the number of equal cells of each stage.

    A result must depend on the arguments of its stage alone: not on a clock, a private random
    generator, an earlier call or an object that another call mutated; nor, with `along`, on the
    other values of the same call. Cells are computed in this process.

    Parameters
    ----------
    experiment : Experiment
        Its stages; outputs whose role is `MEASURED` may differ.
    choices : Choices
        Values of its settings, as `sweeps.engine.declare.settings.read_choices` makes them.
    max_cells : int
        Largest number of cells to recompute for a stage, spread evenly over all its cells.

    Raises
    ------
    AssertionError
        Naming every cell that failed or differs, and its first differing number.
    """
    with TemporaryDirectory() as folder, one_thread():  # as in workers
        index = CellIndex(open_packs(Path(folder)), _ignore)
        schedule = Schedule(Plan(experiment, choices))
        schedule.look_up(index)
        executor = InlineExecutor()
        call_each(experiment.prepare(choices, _ignore), executor, lambda: None)
        failures = execute(schedule, executor, index, Callbacks(_ignore))
        problems = [f"{name} failed: {reason}" for name, reason in failures]
        compared: Counter[str] = Counter()
        for bound, results in schedule.results.items():
            cells = np.flatnonzero(results >= 0)
            cells = cells[schedule.locations[results[cells]].present].tolist()
            for cell in cells[:: max(1, -(-len(cells) // max_cells))]:
                compared[bound.name] += 1
                if difference := _difference(schedule, index, bound, cell):
                    name = schedule.plan.cell_name(bound, cell)
                    problems.append(f"{name} differs when computed again, alone: {difference}")
    if problems:
        raise AssertionError("\n".join(problems))
    return compared


def _ignore(sentence: str) -> None:
    pass


def _difference(schedule: Schedule, index: CellIndex, bound: BoundStage, cell: int) -> str:
    """Return the difference between a computed cell and the same cell computed alone, if any."""
    locations = schedule.locations[schedule.results[bound][[cell]]]
    [first] = iter_cells(index.objects, locations)
    planned = schedule.make_batch(bound, [np.array([cell])])
    drop_objects()
    [outcome] = run_batches((planned.batch,), [0], index.objects).outcomes
    drop_objects()
    if outcome.pack is None:
        return f"it raises {outcome.failed[0].reason}"
    pack = np.array([index.add(outcome.pack)], np.int32)
    [second] = iter_cells(index.objects, replace(locations, pack=pack, row=np.zeros_like(pack)))
    if first is None or second is None:
        return "it cannot be read back from the disk"
    for name in (output.name for output in bound.stage.outputs if output.role != MEASURED):
        if difference := _first_difference(name, first[name], second[name]):
            return difference
    return ""


def _first_difference(name: str, first: NDArray[Any], second: NDArray[Any]) -> str:
    """Return the first place where two arrays differ, bit by bit; empty if they are equal."""
    if first.shape != second.shape:
        return f"{name} has the shape {first.shape}, and then {second.shape}"
    for index in np.ndindex(first.shape) if first.tobytes() != second.tobytes() else ():
        if first[index].tobytes() != second[index].tobytes():
            label = f"{name}{list(index)}" if index else name
            return f"{label} is {first[index].item()!r}, and then {second[index].item()!r}"
    return ""

"""A check that values along an axis come out equal alone and in company."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from sweeps.engine.cluster import ClusterChoice, executor
from sweeps.engine.index import CellIndex
from sweeps.engine.packs import Spots, cells_of, read_cells
from sweeps.engine.plan import Plan
from sweeps.engine.process import one_thread
from sweeps.engine.run import execute
from sweeps.engine.schedule import Schedule, Watch
from sweeps.engine.settings import Choices
from sweeps.engine.stage import Experiment
from sweeps.engine.tasks import forget_all, run_calls


def company(experiment: Experiment, choices: Choices, *, most: int = 10**9) -> dict[str, int]:
    """Compute cells in company, then alone, and compare them bit for bit.

    Parameters
    ----------
    experiment : Experiment
        All stages of it that compute axes together (`along`), where these have several values.
    choices : Choices
        Checked ones, which decide what keeps each other company.
    most : int
        Cells of a stage that are computed alone, spread evenly over all it has.

    Returns
    -------
    dict of str to int
        Number of cells compared, by stage.

    Raises
    ------
    AssertionError
        Naming the first cell whose output differs, or which failed.
    """
    plan = Plan(experiment, choices)
    schedule = Schedule(plan)
    compared: dict[str, int] = {}
    with tempfile.TemporaryDirectory() as name:
        packs = cells_of(Path(name))
        quiet = Watch(lambda sentence: None)
        index = CellIndex(packs, quiet.say)
        schedule.resolve(index)
        with executor(ClusterChoice(kind="inline"), say=quiet.say) as one:
            failures = execute(schedule, one, index, quiet)
            assert not failures, failures[0]
            forget_all()  # a stage must not owe anything to what another has left in memory
            for bound in plan.bound.values():
                if not plan.together[bound]:
                    continue
                cells = plan.cells(bound).tolist()
                for cell in cells[:: max(1, len(cells) // most)]:
                    what = plan.described(bound, cell)
                    part = schedule.part(bound, [np.array([cell])])
                    with one_thread():  # as workers are
                        [done] = run_calls((part.calls,), [0], packs).outcomes
                    assert not (done.failed or done.lacking), f"{what}: {done.failed}"
                    there = read_cells(packs, schedule.spots[part.nodes])
                    alone = Spots([done.pack.path], np.array([0]), np.array([0]), part.calls.keys)
                    (there,), (again,) = there, read_cells(packs, alone)
                    measured = {one.name for one in bound.stage.outputs if one.role == "measured"}
                    _compare(what, there, again, measured)
                    compared[bound.name] = compared.get(bound.name, 0) + 1
    return compared


def _compare(what, there, again, measured):
    for output, array in there.items():
        other = again[output]
        assert array.shape == other.shape, f"{what}: the shape of {output} depends on its company"
        if output in measured:  # a run time, say, is never the same
            continue
        assert np.ascontiguousarray(array).tobytes() == np.ascontiguousarray(other).tobytes(), (
            f"{what}: {output} depends on its company"
        )

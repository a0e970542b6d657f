"""The reports of the engine, run small."""

import math

import pytest

from benchmarks import engine, toy
from benchmarks.phases import timed
from sweeps.engine.cluster import ClusterChoice
from sweeps.engine.plan import Plan
from sweeps.engine.run import Place

SMALL = (2, 3, 1, 2, 1, 1)


def test_grids_have_as_many_cells_as_the_report_says():
    assert [math.prod(grid) for grid in engine.GRIDS] == [22_320, 200_000]
    plan = Plan(toy.NOTHING, toy.choices(toy.NOTHING, engine.GRIDS[0]))
    assert plan.count(plan.bound["nothing"]) == 22_320


def test_time_a_cell_is_the_sum_of_its_phases():
    (row,) = engine.measure(repeats=1, grids=(SMALL,)).rows
    assert row["cells"] == math.prod(SMALL)
    phases = [row[f"{phase}_ms"] for phase in engine.PARTS]
    assert row["total_ms"].median == pytest.approx(sum(phases))
    assert min(phases) > 0


def test_the_same_again_only_looks_cells_up(tmp_path):
    place = Place(tmp_path / "sweep.zarr", tmp_path / "cache", ClusterChoice("inline"))
    chosen = toy.choices(toy.NOTHING, SMALL)
    first, again = (timed(toy.NOTHING, chosen, place) for _ in range(2))
    assert (first.progress["nothing"].done, first.progress["nothing"].reused) == (12, 0)
    assert (again.progress["nothing"].done, again.progress["nothing"].reused) == (0, 12)
    assert again.executed == again.work == 0


def test_memory_is_of_a_process_without_the_experiment():
    (row,) = engine.measure_memory(repeats=1, cells=(1000,)).rows
    assert row["results_mib"] == pytest.approx(3.8, abs=0.1)
    assert 0 < row["before_mib"].median <= row["peak_mib"].median
    # Drawing and learning, none of which is here, hold more when imported.
    assert row["before_mib"].median < 200

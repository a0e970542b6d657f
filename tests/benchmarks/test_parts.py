"""Reports of parts of the experiment, run small and in this process."""

import pytest

from benchmarks import classification, images
from benchmarks.phases import timed
from benchmarks.sweeping import WHOLE, choices_of
from benchmarks.toy import Grid, choices
from sweeps.engine.cluster import ClusterChoice
from sweeps.engine.plan import Plan
from sweeps.engine.run import Place
from sweeps.engine.stage import Experiment, Output, stage
from sweeps.experiment import EXPERIMENT

TINY = ("grid.ship=[duncan,spruance]", "grid.aspect=[0,45]", "grid.frame_count=4")
RANGE_PART = (*TINY, "sensor=range", "classifier.name=[acn,correlation]")
INFRARED_PART = (*TINY, "sensor=infrared", "classifier.name=acn", "infrared.range=25")


@pytest.fixture(autouse=True)
def inline(monkeypatch):
    """Places of sweeps, in this process."""

    def place(folder, store):
        return Place(folder / store, folder / "cache", ClusterChoice("inline"))

    for module in (classification, images):
        monkeypatch.setattr(module, "on_workers", place)


def is_whole(report):
    """Whether the last row has the work of all stages, and the time of all phases."""
    *parts, whole = report.rows
    assert whole["part"] == WHOLE
    work = sum(row["work_s"].median for row in parts if "work_s" in row)
    wall = sum(row["wall_s"].median for row in parts if "wall_s" in row)
    return (whole["work_s"].median, whole["wall_s"].median) == pytest.approx((work, wall))


def test_classification_is_made_anew_and_nothing_else():
    report = classification.measure(repeats=1, overrides=RANGE_PART)
    cells = {row["part"]: row["cells"] for row in report.rows if "cells" in row}
    plan = Plan(EXPERIMENT, choices_of(RANGE_PART))
    names = {name for name in plan.bound if name.startswith(("acn", "correlation"))}
    assert set(cells) - {WHOLE} == names
    assert cells[WHOLE] == sum(plan.count(plan.bound[name]) for name in names)
    assert is_whole(report)


def test_infrared_part_has_all_stages():
    report = images.measure_part(repeats=1, overrides=INFRARED_PART)
    parts = [row["part"] for row in report.rows]
    plan = Plan(EXPERIMENT, choices_of(INFRARED_PART))
    kept = {name for name, bound in plan.bound.items() if bound.stage.kept}
    # At the training range, what is tested are the points that are learned.
    assert kept - {"hits"} <= set(parts)
    assert is_whole(report)


@stage(Output("broken"), uses=(Grid,), group="toy")
def broken(aspect):
    raise ValueError("out of tea")


def test_a_cell_that_fails_is_no_time(tmp_path):
    experiment = Experiment("toy", "Broken", (Grid,), (broken,))
    place = Place(tmp_path / "sweep.zarr", tmp_path / "cache", ClusterChoice("inline"))
    with pytest.raises(RuntimeError, match=r"^broken: ValueError: out of tea$"):
        timed(experiment, choices(experiment, ()), place)

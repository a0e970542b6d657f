"""Cells computed twice: what is not reproducible, or depends on its company, is named."""

from dataclasses import replace

import numpy as np
import pytest
from small_stores import files, opened
from toys import CALLS, SPRINGS, Few, Told, of, run, timed

from sweeps.engine import run as running
from sweeps.engine.settings import read_choices
from sweeps.engine.stage import Group, Output, stage

FOUR = {"few.size": [1, 2, 3, 4]}
COUNTED = {"calls": 0}


@stage(Output("x", ("place",), label="x", dtype="f8"), uses=(Few,), group=Group("all"), version="1")
def counting(size):
    """A result that depends on how often something was computed, for one size."""
    COUNTED["calls"] += size == 3
    return np.array([size, float(COUNTED["calls"])]) if size == 3 else np.array([size, np.nan])


@stage(Output("x", label="x", dtype="f8"), uses=(Few,), along=(Few.size,), group=Group("all"))
def in_company(size):
    """A result that depends on the other values."""
    return np.array(size) - np.mean(size) * (np.array(size) == 2)


def swept(experiment, store, verify=1.0, **given):
    """Run an experiment with a share of its cells computed again."""
    choices = read_choices(experiment.declared, {"verify": verify, **given})
    place = running.Place

    def verifying(*arguments, **named):
        return place(*arguments, **named, verify=verify)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("toys.Place", verifying)
        return run(experiment, choices, store, watch=Told().watch)


def test_reproducible_cells_are_computed_twice_and_the_store_is_the_same(tmp_path):
    CALLS.clear()
    assert swept(SPRINGS, tmp_path / "once.zarr", 0.0).failures == []
    once = dict(CALLS)
    CALLS.clear()
    assert swept(SPRINGS, tmp_path / "twice.zarr").failures == []
    assert files(tmp_path / "once.zarr") == files(tmp_path / "twice.zarr")
    assert {name: CALLS[name] for name in once if name != "solver"} == {
        name: 2 * number for name, number in once.items() if name != "solver"
    }


def test_a_cell_that_differs_fails_alone_by_name(tmp_path):
    finished = swept(of(counting), tmp_path / "s.zarr", **FOUR)
    assert finished.failures == [
        (
            "counting size=3",
            "it differs when computed again, alone: x[1] is 1.0, and then 2.0",
        )
    ]
    found = opened(tmp_path / "s.zarr", "all").x
    assert (
        found.sel(size=3).isnull().all() and (found.isel(place=0).dropna("size") == [1, 2, 4]).all()
    )
    again = swept(of(counting), tmp_path / "s.zarr", **FOUR)  # the cell was not kept
    assert [name for name, _ in again.failures] == ["counting size=3"]
    assert sum(one.reused for one in again.progress.values()) == 3


def test_a_cell_that_depends_on_its_company_is_named(tmp_path):
    finished = swept(of(in_company), tmp_path / "s.zarr", **FOUR)
    assert finished.failures == [
        (
            "in_company size=2",
            "it differs when computed again, alone: x is -0.5, and then 0.0",
        )
    ]
    assert opened(tmp_path / "s.zarr", "all").x.dropna("size").values.tolist() == [1, 3, 4]


def test_what_is_measured_may_differ(tmp_path):
    assert swept(of(timed), tmp_path / "s.zarr", **FOUR).failures == []


def test_a_share_is_chosen_by_key(tmp_path):
    """Whatever the order and the number of workers: binomial, within five standard deviations."""
    experiment = of(replace(counting, function=lambda size: [size, 0.0]))
    many = read_choices(experiment.declared, {"few.size": list(range(1, 2001))})
    from sweeps.engine.index import CellIndex
    from sweeps.engine.places import Objects
    from sweeps.engine.plan import Plan
    from sweeps.engine.schedule import Schedule

    schedule = Schedule(Plan(experiment, many), verify=0.1)
    schedule.resolve(CellIndex(Objects(tmp_path / "none"), print))
    chosen = 0
    while schedule.ready:
        chosen += sum(len(part.calls.again) for part in schedule.batch(1).parts)
    assert abs(chosen - 200) < 5 * np.sqrt(2000 * 0.1 * 0.9)

"""Draws of range profiles: places of a ship on the grid of IFOVs, and orders of presentation."""

from functools import cache
from pathlib import Path

import numpy as np
from commands import FAST, chosen, groups_of, swept

from sweeps.engine.index import CellIndex
from sweeps.engine.places import Objects
from sweeps.engine.plan import Plan
from sweeps.engine.schedule import Schedule
from sweeps.experiment import EXPERIMENT

GIVEN = (
    *(*FAST, "grid.ship=[duncan,spruance]", "grid.aspect=[0,60]", "grid.frame_count=[2,16]"),
    *("classifier=all", "classifier.mnn.epochs=5"),
)

# Whatever does not depend on where the ship is when it is tested.
LEARNED = (
    *("expected", "covariance", "training_category", "training_confused", "training_correct"),
    *("passes", "presentations", "hidden", "loss"),
)


@cache
def plan_of(*overrides):
    return Plan(EXPERIMENT, chosen(*GIVEN, *overrides))


def to_make(*overrides):
    """Range extents that a sweep makes when nothing is at hand, of what is learned and tested."""
    schedule = Schedule(plan_of(*overrides))
    schedule.resolve(CellIndex(Objects(Path("none")), print))
    extents = {"extent", "seen_extent"}
    return sum(cells for bound, cells, _ in schedule.missing_cells() if bound.name in extents)


def keys(stage, *overrides):
    plan = plan_of(*overrides)
    return {plan.key(plan.bound[stage], place) for place in plan.cells(plan.bound[stage])}


def test_the_first_phase_is_what_a_sweep_without_phases_has(folder, results):
    """Bit for bit, with the noise it always had; tables are means over all phases."""
    swept(folder / "all.zarr", results, *GIVEN, "ladar.subpixel_offsets=3")
    swept(folder / "one.zarr", folder / "own", *GIVEN)
    every, one = groups_of(folder / "all.zarr"), groups_of(folder / "one.zarr")
    assert set(every) == set(one)
    for name, group in one.items():
        for variable, plain in group.data_vars.items():
            found = every[name][variable]
            if name.startswith("tables/"):
                assert "ifov_phase" not in found.coords
                continue
            moved = found.dims != plain.dims
            assert not (moved and variable in LEARNED), (name, variable)
            first = found.sel(ifov_phase=0) if moved else found
            same = np.array_equal(first, plain, equal_nan=plain.dtype.kind == "f")
            assert same and first.dtype == plain.dtype, (name, variable)
    table, alone = (groups["tables/likelihood"] for groups in (every, one))
    assert (table.n == 3 * alone.n).all() and table.spread.max() > 0


def test_an_extent_a_phase_and_one_for_what_is_learned():
    """The first phase is what is learned; neither frames nor replicates make more of them."""
    views = 4
    assert to_make() == views
    assert to_make("ladar.subpixel_offsets=3") == 3 * views
    assert len(keys("seen_extent", "ladar.subpixel_offsets=3")) == 3 * views
    assert keys("seen_extent") == keys("extent") == keys("extent", "ladar.subpixel_offsets=3")
    assert keys("extent") < keys("seen_extent", "ladar.subpixel_offsets=3")
    assert keys("expected") == keys("expected", "ladar.subpixel_offsets=3")

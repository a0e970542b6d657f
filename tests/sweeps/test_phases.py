"""Draws of range profiles: places of a ship on the grid of IFOVs, and orders of presentation."""

from functools import cache

import numpy as np
from commands import FAST, chosen, groups_of, swept

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
    schedule.resolve(lambda bound, keys: {})
    extents = {"extent", "seen_extent"}
    return sum(cells for bound, cells in schedule.missing_cells() if bound.name in extents)


def keys(stage, *overrides):
    plan = plan_of(*overrides)
    return {plan.key(plan.bound[stage], place) for place in plan.cells(plan.bound[stage])}


def test_the_first_phase_is_what_a_sweep_without_phases_has(folder, results):
    """Bit for bit, with the noise it always had; tables are means over all phases."""
    swept(folder / "all.zarr", results, *GIVEN, "ladar.phases=3")
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
    assert to_make("ladar.phases=3") == 3 * views
    assert len(keys("seen_extent", "ladar.phases=3")) == 3 * views
    assert keys("seen_extent") == keys("extent") == keys("extent", "ladar.phases=3")
    assert keys("extent") < keys("seen_extent", "ladar.phases=3")
    assert keys("expected") == keys("expected", "ladar.phases=3")


def test_phases_differ_in_profile_and_in_noise(folder, results):
    """Where no ship reaches there is noise alone, uncorrelated between phases and replicates.

    24 bins at either end, 4 views and a pulse of 4.5 bins: 40 independent numbers at least, so that
    correlations of all 15 pairs are below 4 / sqrt(40).
    """
    given = (*GIVEN[:-2], "classifier=acn", "ladar.phases=3", "grid.replicate=2")
    swept(folder / "all.zarr", results, *given)
    profiles = groups_of(folder / "all.zarr")["range_profile"].squeeze().sel(frame_count=16)
    ends = np.r_[0:24, 226:250]
    noise = (profiles.averaged - profiles.expected).isel(down_range=ends)
    series = noise.stack(draw=("ifov_phase", "replicate"), sample=("ship", "aspect", "down_range"))
    alike = np.corrcoef(series.transpose("draw", "sample").values)
    assert np.abs(alike[np.triu_indices(6, 1)]).max() < 4 / np.sqrt(40)


def test_orders_and_learning_in_the_test_stand_side_by_side(folder, results):
    """The first order, without learning, is what a sweep of one has; phases train nothing more."""
    given = (*GIVEN[:-2], "grid.aspect=[0,30,60,90]", "classifier=acn", "grid.vigilance=[0.9,0.95]")
    several = ("classifier.orders=3", "classifier.learn_in_test=[true,false]", "ladar.phases=2")
    swept(folder / "all.zarr", results, *given, *several)
    swept(folder / "one.zarr", folder / "own", *given)
    every, one = groups_of(folder / "all.zarr"), groups_of(folder / "one.zarr")
    answers, plain = (groups["classification/acn"] for groups in (every, one))
    assert set(answers.training_category.dims) - set(plain.training_category.dims) == {"order"}
    first = answers.sel(order=0, learn_in_test=False, ifov_phase=0)
    for name, values in plain.data_vars.items():
        assert np.array_equal(first[name], values, equal_nan=values.dtype.kind == "f"), name
    learning = answers.similarity.sel(learn_in_test=True)
    assert (learning != answers.similarity.sel(learn_in_test=False)).any()
    table = every["tables/acn"]
    assert set(table.category_count.dims) >= {"order"}
    assert not {"order", "ifov_phase"} & set(table.accuracy.dims)
    assert "learn_in_test" in table.accuracy.dims
    assert "learn_in_test" not in table.training_accuracy.dims
    wanted = answers.correct.mean(("order", "ifov_phase", "ship", "aspect"))
    overall = table.accuracy.sel(aspect_bin="overall").transpose(*wanted.dims)
    np.testing.assert_allclose(overall, wanted, rtol=1e-6)

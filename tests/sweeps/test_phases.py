"""Places of a ship on the grid of IFOVs: an axis of what is tested, and not of what is learned."""

import numpy as np
from commands import FAST, assert_slice, chosen, groups_of, swept

from sweeps.engine.plan import Plan
from sweeps.experiment import EXPERIMENT

GIVEN = (
    *(*FAST, "grid.ship=[duncan,spruance]", "grid.aspect=[0,60]", "grid.frame_count=[2,16]"),
    *("classifier=all", "classifier.mnn.epochs=5", "grid.replicate=2"),
)


def keys(stage, *overrides):
    plan = Plan(EXPERIMENT, chosen(*GIVEN, *overrides))
    return {plan.key(plan.bound[stage], place) for place in plan.cells(plan.bound[stage])}


def test_the_first_phase_is_what_a_sweep_without_phases_has(folder, results):
    """Every group but tables and states: bit for bit, with the noise it always had."""
    swept(folder / "all.zarr", results, *GIVEN, "ladar.phases=3")
    swept(folder / "one.zarr", folder / "own", *GIVEN)
    assert assert_slice(folder / "all.zarr", folder / "one.zarr", ifov_phase=0) >= {"ifov_phase"}
    profiles = groups_of(folder / "all.zarr")["range_profile"]
    assert "ifov_phase" not in profiles.expected.dims
    assert profiles.sizes["ifov_phase"] == 3


def test_an_extent_a_phase_and_one_for_what_is_learned():
    """The first phase is what is learned; neither frames nor replicates make more of them."""
    views = 4
    assert len(keys("seen_extent", "ladar.phases=3")) == 3 * views
    assert keys("seen_extent") == keys("extent") == keys("extent", "ladar.phases=3")
    assert keys("extent") < keys("seen_extent", "ladar.phases=3")
    assert keys("expected") == keys("expected", "ladar.phases=3")


def test_phases_differ_in_profile_and_in_noise(folder, results):
    """Where no ship reaches there is noise alone, uncorrelated between phases and replicates.

    24 bins at either end, 4 views and a pulse of 4.5 bins: 40 independent numbers at least, so that
    correlations of all 15 pairs are below 4 / sqrt(40).
    """
    swept(folder / "all.zarr", results, *GIVEN, "ladar.phases=3")
    profiles = groups_of(folder / "all.zarr")["range_profile"].squeeze().sel(frame_count=16)
    ends = np.r_[0:24, 226:250]
    noise = (profiles.averaged - profiles.expected).isel(down_range=ends)
    series = noise.stack(draw=("ifov_phase", "replicate"), sample=("ship", "aspect", "down_range"))
    alike = np.corrcoef(series.transpose("draw", "sample").values)
    assert np.abs(alike[np.triu_indices(6, 1)]).max() < 4 / np.sqrt(40)

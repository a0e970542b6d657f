"""Noise of different cells is drawn apart: along every axis that another measurement would have.

A setting that is missing from the name of a stream leaves every result as probable as it was, each
for itself. It shows only where cells are averaged: their noise then does not average out.
"""

import numpy as np
import pytest
from commands import chosen, opened, swept

from sweeps.engine.plan import Plan
from sweeps.experiment import EXPERIMENT

RANGE = (
    *("sensor=range", "grid.ship=[duncan,texas]", "grid.aspect=[0,1]", "grid.pulse_width=[10,30]"),
    *("grid.range=[50,100]", "ladar.target_free_ifovs=[3000,4000]", "grid.replicate=2"),
    *("grid.frame_count=1", "render.engine=lines", "render.pixel=1", "render.samples=0"),
)
FLOWN = (
    *("sensor=irar", "grid.ship=[connole,roberts]", "grid.aspect=[175,176]", "grid.replicate=2"),
    *("grid.pulse_width=[10,30]", "irar.depression=[5,6.7]", "render.engine=embree"),
)
TIMED = (
    *("sensor=run_time", "grid.ship=[duncan,texas]", "grid.aspect=[0,1]", "render.engine=embree"),
    *("grid.pulse_width=[10,30]", "run_time.bin_width=[0.5,1]", "grid.frame_count=16"),
)


def streams(stage, *overrides):
    """Names of the noise of all cells of a stage, each with the values of its cell."""
    plan = Plan(EXPERIMENT, chosen(*overrides))
    bound = plan.bound[stage]
    return {
        repr(sorted(plan.stream(bound, place)[1].items())): place for place in plan.cells(bound)
    }, len(list(plan.cells(bound)))


@pytest.mark.parametrize(
    ("stage", "overrides", "cells"),
    [
        ("averaged", RANGE, 2**6),  # those of `OF_RANGE`, and the number of target-free IFOVs
        ("test_signature", FLOWN, 2**5),
        ("profile_noise", TIMED, 2**4),
    ],
)
def test_no_two_cells_have_one_stream(stage, overrides, cells):
    names, count = streams(stage, *overrides)
    assert count == cells
    assert len(names) == cells


def test_noise_of_profiles_that_differ_in_anything_is_uncorrelated(tmp_path, cache):
    """Of 2^6 cells, two by two at either pulse width.

    Bins l apart correlate by some exp(-4 l^2 / N_t^2), N_t = cT / 2 dR, so that the correlation of
    two cells over B bins has a variance of N_t sqrt(pi / 8) / B: at 30 ns 0.106 squared. Six times
    that is reached once in 5e8 pairs; cells that share their noise correlate by nearly 1.
    """
    swept(tmp_path / "s.zarr", cache, *RANGE)
    found = opened(tmp_path / "s.zarr", "range_profile")
    assert (found.within_tolerance == -1).all()  # no tolerance is asked for
    noise = (found.averaged - found.expected).squeeze("frame_count", drop=True)
    for width in noise.pulse_width.values:
        cells = noise.sel(pulse_width=width).transpose(..., "down_range").values
        alike = np.corrcoef(cells.reshape(-1, cells.shape[-1]))
        n_t = 299_792_458 * width * 1e-9 / 2
        reach = 6 * np.sqrt(max(1, n_t * np.sqrt(np.pi / 8)) / cells.shape[-1])
        pairs = np.abs(alike[np.triu_indices(len(alike), 1)])
        assert pairs.size == 32 * 31 / 2
        assert pairs.max() < reach < 0.7

"""Sweeps that see ships along lines, at a spacing or within a tolerance."""

import numpy as np
from commands import opened, swept

import ncti.ships
from ncti.ladar import expected_profile, range_extent
from ncti.render import line_image

GRID = ("grid.ship=[duncan,texas]", "grid.aspect=[0,40]", "grid.pulse_width=[10,30]")
SMALL = (*GRID, "grid.frame_count=4", "classifier.name=acn", "ladar.target_free_ifovs=10")


def profiles(folder, cache, *overrides):
    swept(folder / "lines.zarr", cache, *SMALL, *overrides)
    return opened(folder / "lines.zarr", "range_profile")


def test_profiles_by_lines_are_those_of_the_library(tmp_path, cache):
    found = profiles(tmp_path, cache, "render.engine=lines", "render.samples=0", "render.pixel=0.5")
    view = {"aspect": 40, "depression": 3.84, "slant_range": 100e3}
    lines = line_image(ncti.ships.load("texas"), **view, spacing=0.5)
    extent = range_extent(lines, slant_range=100e3)
    plain = expected_profile(extent, pulse_width=30e-9, cnr=10**3.2, target_free_ifovs=10)
    view = found.sel(ship="texas", aspect=40, pulse_width=30)
    np.testing.assert_allclose(view.expected.squeeze(), plain, rtol=1e-6)
    assert np.all((found.profile_error > 0) & (found.profile_error < 0.05))
    # a longer pulse forgives more
    assert np.all(found.profile_error.sel(pulse_width=30) < found.profile_error.sel(pulse_width=10))
    assert np.all(found.within_tolerance == -1)

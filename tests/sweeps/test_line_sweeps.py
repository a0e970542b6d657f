"""Sweeps that see ships along lines, at a spacing or within a tolerance."""

import numpy as np
import pytest
from commands import FAST, chosen, opened, swept

import ncti.ships
from ncti.ladar import expected_profile, range_extent
from ncti.render import line_image
from sweeps.engine.errors import ConfigurationError

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


def test_few_samples_get_finer_lines(tmp_path, cache):
    """As with pixels: the small ends of ships are seen better."""
    few = profiles(tmp_path / "a", cache, "render.engine=lines", "render.samples=0")
    many = profiles(tmp_path / "b", cache, "render.engine=lines", "render.samples=20000")
    assert np.all(many.profile_error.sel(aspect=0) < few.profile_error.sel(aspect=0) / 2)


def test_a_tolerance_is_kept_and_said(tmp_path, cache):
    found = profiles(tmp_path, cache, "render.tolerance=0.01")
    assert np.all(found.within_tolerance == 1)
    assert np.all(found.profile_error <= 0.01)


def test_a_tolerance_out_of_reach_is_said(tmp_path, cache):
    found = profiles(tmp_path, cache, "render.tolerance=0.00001", "grid.aspect=0")
    assert np.all(found.within_tolerance.sel(pulse_width=10) == 0)
    assert np.all(found.profile_error < 0.001)


def test_another_pulse_that_is_longer_changes_nothing(tmp_path, cache):
    """The tolerance holds after the shortest pulse of all."""
    first = profiles(tmp_path, cache, "render.tolerance=0.02")
    more = profiles(tmp_path, cache, "render.tolerance=0.02", "grid.pulse_width=[10,30,50]")
    assert first.identical(more.sel(pulse_width=[10, 30]))


def test_a_tolerance_leaves_beams_resolved(tmp_path, cache):
    """However loose, lines are at least as fine as pixels: 0.6 m beams at 4 km see the ship."""
    overrides = ("render.tolerance=0.4", "grid.range=4", "grid.aspect=40")
    found = profiles(tmp_path, cache, *overrides, "render.samples=0")
    assert np.all(np.isfinite(found.expected))


def test_images_have_no_error_in_the_store(tmp_path, cache):
    assert "profile_error" not in profiles(tmp_path, cache, *FAST)


def test_silhouettes_by_lines_and_by_pixels_agree(tmp_path, cache):
    """Which detector pixels show the ship, but for some at its outline."""
    shapes = []
    for engine in ("lines", "embree"):
        store = tmp_path / f"{engine}.zarr"
        overrides = ("sensor=infrared", "grid.ship=texas", "grid.aspect=[0,40]")
        swept(store, cache, *overrides, f"render.engine={engine}", "infrared.phases=1")
        shapes.append(opened(store, "infrared").image.values)
    lines, pixels = shapes
    both = np.isfinite(lines) & np.isfinite(pixels)
    assert np.mean(np.isfinite(lines) == np.isfinite(pixels)) > 0.99
    assert np.mean(lines[both] != pixels[both]) < 0.2


def test_a_tolerance_of_an_engine_with_pixels_is_refused():
    with pytest.raises(ConfigurationError, match=r"render\.tolerance is 0\.01, but must be null"):
        chosen("render.engine=embree", "render.tolerance=0.01")

"""The source's passive-infrared experiment at 16 frames, and its pattern in our tables."""

import pytest
import xarray as xr
from sweeping import command


@pytest.fixture(scope="module")
def tables(tmp_path_factory, cache):
    folder = tmp_path_factory.mktemp("table5")
    (folder / "cache").mkdir()
    (cache / "meshes").mkdir(parents=True, exist_ok=True)
    (folder / "cache" / "meshes").symlink_to(cache / "meshes", target_is_directory=True)
    run = command(
        "+experiment=table5",
        "grid.frame_count=16",
        "render.pixel=0.5",
        "store=s.zarr",
        folder=folder,
        cache=folder / "cache",
    )
    assert run.returncode == 0, run.stderr
    return xr.open_zarr(folder / "s.zarr", group="tables/acn_infrared").load()


def accuracy(tables, slant_range, way, part="accuracy"):
    return tables[part].sel(range=slant_range, super_resolution=way).squeeze()


def test_about_as_many_categories_form_as_in_the_source(tables):
    """11 in the source; mean over phases and orders of ours."""
    assert 8 <= tables.category_count.mean() <= 16


@pytest.mark.parametrize(("slant_range", "way"), [(25, "none"), (50, "perfect"), (50, "none")])
def test_ends_of_ships_are_told_apart_worst(tables, slant_range, way):
    near_bow, *others, _ = accuracy(tables, slant_range, way).values.tolist()
    assert near_bow + 0.1 < min(others)


def test_perfect_super_resolution_makes_50_km_as_good_as_25(tables):
    """In every bin within the intervals, of one quarter or so of a bin's 40 to 44 answers."""
    near, far = (accuracy(tables, *look).values for look in ((25, "none"), (50, "perfect")))
    low, high = (accuracy(tables, 25, "none", part).values for part in ("ci_low", "ci_high"))
    assert ((low <= far) & (far <= high)).all()
    assert abs(near - far).max() < 0.1


def test_the_detector_s_own_pixels_do_worse_at_50_km(tables):
    overall = [
        accuracy(tables, *look).values[-1] for look in ((25, "none"), (50, "none"), (100, "none"))
    ]
    assert overall[0] > overall[1] > overall[2] > 0.25  # which is chance

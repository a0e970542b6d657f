"""The infrared stage: what it shares, what it skips, and what low signals come to."""

import numpy as np
import pytest
import xarray as xr
from sweeping import command
from test_stages import INFRARED_GRID, plan_of

import ncti.ships
from ncti.features import log_polar, segment
from ncti.infrared import coverage_of
from sweeps import stages
from sweeps.infrared import STEPS, _Lattice, image_windows, infrared_code, view_images
from sweeps.schema import InfraredConfig, SceneConfig
from sweeps.stages import Ship, View, rendering_code, view_profiles

CODE = {name: name for name in ("rendering", "range", "infrared")}


@pytest.fixture
def duncan():
    return Ship("duncan", "duncan", ncti.ships.digest("duncan"))


def test_both_sensors_share_one_image(duncan, tmp_path, monkeypatch):
    drawn = []
    draw = stages.range_image
    monkeypatch.setattr(stages, "range_image", lambda *a, **k: drawn.append(k) or draw(*a, **k))
    view = View(duncan, 60.0, plan_of(tmp_path, code=CODE))
    view_profiles(view)
    view_images(view)
    assert len(drawn) == 1


def test_pairs_of_half_pixels_are_pixels_of_the_detector():
    rng = np.random.default_rng(3)
    x, y = rng.uniform(-60, 60, 20_000), rng.uniform(0, 30, 20_000)
    lattice = _Lattice.of(InfraredConfig(), 25.0, 3.84)
    for place in ((0.0, 0.0), (0.3, 0.9), (0.7, 0.2), (0.99, 0.5)):
        fine = lattice.fine(x, y, 0.01, place=place)
        rows, cols = fine.coverage.shape
        pairs = fine.coverage.reshape(rows // 2, 2, cols // 2, 2).mean(axis=(1, 3))
        coarse = coverage_of(x, y, area=0.01, footprint=3.75, phase=place, margin=0)
        ours = pairs[np.ix_(pairs.any(axis=1), pairs.any(axis=0))]
        np.testing.assert_allclose(ours, coarse.coverage, rtol=1e-12)


def test_windows_have_the_shape_of_the_images(duncan, tmp_path):
    plan = plan_of(tmp_path, code=CODE)
    images = view_images(View(duncan, 90.0, plan))["image"]
    windows = image_windows(INFRARED_GRID, plan.infrared, SceneConfig())
    there = ~np.isnan(images[0, :, :, 0])
    np.testing.assert_array_equal(there.any(axis=-1), ~np.isnan(windows["vertical"]))
    np.testing.assert_array_equal(there.any(axis=-2), ~np.isnan(windows["horizontal"]))
    # The pixels that show the ship lie where it is, within a pixel of 3.75 m.
    row, col = np.nonzero(images[0, 0, 0, 1] > 0.8)
    across, up = windows["horizontal"][0, 0, col], windows["vertical"][0, 0, row]
    assert np.ptp(across) == pytest.approx(135.6, abs=3 * 3.75)
    assert np.median(np.abs(across)) < 40
    assert -5 < up.min() < 5


def test_maps_in_the_store_are_the_librarys(duncan, tmp_path):
    plan = plan_of(tmp_path, code=CODE)
    found = view_images(View(duncan, 90.0, plan))
    image = found["image"][0, 0, 0, 1]
    image = image[~np.isnan(image[:, 0])][:, ~np.isnan(image[0])].astype(float)
    sigma = np.hypot(0.1, 0.1)
    mask = segment(image, contrast=1.28206, target_sigma=sigma, sea_sigma=sigma)
    ours = found["log_polar"][0, 0, 0, 0, 0, 0, 0, 1] / STEPS
    np.testing.assert_allclose(ours, log_polar(mask, inner_radius=0.75), atol=0.5 / STEPS + 1e-9)


def test_hashes_of_code_differ():
    assert len({infrared_code(), rendering_code(), stages.profile_code()}) == 3


@pytest.mark.parametrize("segmentation", ["matched", "otsu"])
def test_no_contrast_is_no_better_than_a_guess(segmentation, tmp_path, cache):
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / "meshes").symlink_to(cache / "meshes", target_is_directory=True)
    run = command(
        "sensor=infrared",
        "grid.aspect={start: 0, stop: 90, step: 6}",
        "grid.range=25",
        "grid.frame_count=16",
        "grid.vigilance=0.87",
        "infrared.contrast_at_zero=0",
        "infrared.super_resolution=none",
        f"infrared.segmentation={segmentation}",
        "cluster=inline",
        "store=s.zarr",
        folder=tmp_path,
        cache=tmp_path / "cache",
    )
    assert run.returncode == 0, run.stderr
    answers = xr.open_zarr(tmp_path / "s.zarr", group="classification/acn_infrared").load()
    right = answers.correct.isel(order=0).values == 1
    if segmentation == "matched":  # nothing tells the ship from the sea: nothing is cut out
        assert not right.any()
        assert np.all(answers.predicted == -1)
    else:
        # 4 ships x 16 aspects x 4 phases of independent noise: 256 guesses among four, of which
        # 25 % are right up to 4 standard deviations.
        assert right.size == 256
        assert abs(right.mean() - 0.25) < 4 * np.sqrt(0.25 * 0.75 / right.size)

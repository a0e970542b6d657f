"""The infrared stage: what it shares, what it skips, and what low signals come to."""

import warnings
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import xarray as xr
from scipy import stats
from sweeping import command
from test_stages import INFRARED_GRID, plan_of

import ncti.ships
from ncti.features import log_polar, segment
from ncti.infrared import contrast, pixel_sigma, shifted_images, thermal_images
from sweeps import stages
from sweeps.infrared import image_windows, infrared_code, view_images
from sweeps.schema import SceneConfig
from sweeps.seeds import cell_rng
from sweeps.sensor_schema import InfraredConfig
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


@pytest.mark.parametrize("slant_range", [25.0, 50.0])
@pytest.mark.parametrize("rule", [0.25, 0.5])
def test_a_cell_is_the_library_done_by_hand(slant_range, rule, duncan, tmp_path):
    """Every variable of every way to see the ship, from templates counted by histogram."""
    grid = replace(
        INFRARED_GRID,
        range=(25.0, 50.0),
        coverage_rule=(0.25, 0.5),
        inner_radius=(0.5, 0.75),
        interpolation=("nearest", "bilinear"),
        segmentation=("otsu", "matched"),
    )
    infrared = InfraredConfig(nedt=0.3, target_spread=0.15, sea_spread=0.08, false_alarm=1e-4)
    plan = plan_of(tmp_path, code=CODE, infrared_grid=grid, infrared=infrared, seed=3)
    view = View(duncan, 60.0, plan)
    found = view_images(view)
    i, j = grid.range.index(slant_range), grid.coverage_rule.index(rule)
    named = {"ship": "duncan", "aspect": 60.0, "range": slant_range}
    places = cell_rng(3, stage="infrared_place", **named).random((2, 2))
    x, y, area = view.points(slant_range)
    warmth = contrast(slant_range * 1e3)
    footprint = 150e-6 * slant_range * 1e3
    for k, way in enumerate(grid.super_resolution):
        rng = cell_rng(3, stage="infrared", super_resolution=way, **named)
        for phase, (across, up) in enumerate(places):
            # Whole pixels about the ship, and four more on each side of its own bounding box.
            edges = [
                footprint * (np.arange(np.floor(v.min() / footprint + part) - 4, 400) - part)
                for v, part in ((y, up), (x, across))
            ]
            long = [np.ptp(v) // footprint + 2 + 8 for v in (y, x)]
            edges = [line[: int(n) + 1] for line, n in zip(edges, long, strict=True)]
            half = [
                np.interp(np.arange(0, n + 0.5, 0.5), np.arange(n + 1), line)
                for line, n in zip(edges, long, strict=True)
            ]
            fine = np.histogram2d(y, x, half)[0] * area / (footprint / 2) ** 2 >= rule
            coarse = np.histogram2d(y, x, edges)[0] * area / footprint**2 >= rule
            draw = shifted_images if way == "shifted" else thermal_images
            images = draw(
                coarse if way == "none" else fine,
                contrast=warmth,
                frame_counts=(1, 16),
                rng=rng,
                nedt=0.3,
                target_spread=0.15,
                sea_spread=0.08,
            )
            doubled = images.repeat(2, 1).repeat(2, 2) if way == "none" else images
            for n, frames in enumerate((1, 16)):
                if phase == 0:
                    whole = found["image"][j, i, k, n]
                    ours = whole[~np.isnan(whole)].reshape(images[n].shape)
                    np.testing.assert_array_equal(ours, images[n].astype(np.float32))
                error = np.sqrt(np.mean((doubled[n] - warmth * fine) ** 2)) / warmth
                assert found["reconstruction_error"][j, phase, i, k, n] == pytest.approx(error)
                sigma = {
                    name: pixel_sigma(spread, frame_count=frames, nedt=0.3, super_resolution=way)
                    for name, spread in (("target_sigma", 0.15), ("sea_sigma", 0.08))
                }
                masks = (
                    segment(images[n], method="otsu"),
                    segment(images[n], method="matched", contrast=warmth, **sigma),
                )
                for m, inner, between in product(range(2), range(2), range(2)):
                    cells = log_polar(
                        masks[m],
                        inner_radius=grid.inner_radius[inner],
                        interpolation=grid.interpolation[between],
                    )
                    np.testing.assert_array_equal(
                        found["log_polar"][j, m, inner, between, phase, i, k, n],
                        np.rint(255 * cells),
                    )
                # 1 - (1 - p)^n, of pixels of the detector.
                noise = 0.3 / np.sqrt(frames)
                threshold = stats.norm.isf(1e-4, scale=np.hypot(0.08, noise))
                p = stats.norm.sf(threshold, warmth, np.hypot(0.15, noise))
                assert found["detection_probability"][j, phase, i, n] == pytest.approx(
                    1 - (1 - p) ** coarse.sum()
                )


@pytest.mark.parametrize("aspect", [84.0, 90.0])
def test_a_window_as_tight_as_the_ship_holds_it(aspect, duncan, tmp_path):
    """The ship and its margin are in the window, whatever pixel each of them begins with."""
    infrared = InfraredConfig(window_length=137, window_height=43, nedt=0.01, sea_spread=0.01)
    grid = replace(INFRARED_GRID, range=(25.0, 50.0, 1000.0))
    view = View(duncan, aspect, plan_of(tmp_path, code=CODE, infrared_grid=grid, infrared=infrared))
    found = view_images(view)["image"][0]
    assert np.isfinite(found).any(axis=(-2, -1)).all()
    # 1.28 K at 25 km: the ship is all there, to the half pixels at its outline.
    x, _, area = view.points(25.0)
    shown = (found[0, 1, 1] > 0.6).sum() * 1.875**2
    assert shown == pytest.approx(x.size * area, rel=0.2)


def test_more_phases_leave_the_first_as_they_are(duncan, tmp_path):
    few, many = (
        view_images(
            View(
                duncan,
                30.0,
                plan_of(
                    tmp_path,
                    code=CODE,
                    infrared_grid=replace(INFRARED_GRID, phase=tuple(range(phases))),
                ),
            )
        )
        for phases in (2, 5)
    )
    np.testing.assert_array_equal(few["log_polar"], many["log_polar"][:, :, :, :, :2])
    np.testing.assert_array_equal(
        few["template_log_polar"], many["template_log_polar"][:, :, :, :2]
    )
    np.testing.assert_array_equal(few["image"], many["image"])


@pytest.mark.parametrize(
    ("change", "templates", "images"),
    [
        ({"seed": 5}, 1, 2),
        ({"infrared": InfraredConfig(nedt=0.2)}, 1, 2),
        ({"infrared": InfraredConfig(false_alarm=1e-3)}, 1, 2),
        ({"infrared": InfraredConfig(window_length=260)}, 1, 1),
        ({"infrared": InfraredConfig(orders=7)}, 1, 1),
        ({"infrared_grid": replace(INFRARED_GRID, vigilance=(0.5,))}, 1, 1),
        ({"infrared_grid": replace(INFRARED_GRID, range=(25.0, 50.0))}, 1, 2),
        ({"infrared_grid": replace(INFRARED_GRID, inner_radius=(0.5,))}, 2, 2),
        ({"infrared": InfraredConfig(ifov=100)}, 2, 2),
        ({"infrared": InfraredConfig(training_range=50)}, 2, 1),
    ],
)
def test_a_stage_is_made_again_for_what_it_depends_on(change, templates, images, duncan, tmp_path):
    """Number of finished templates and images in the cache after a run and a changed one."""
    for changed in ({}, change):
        view_images(View(duncan, 30.0, plan_of(tmp_path, code=CODE, **changed)))
    kept = {
        name: len(list((tmp_path / name).rglob("*.npz"))) for name in ("silhouette", "infrared")
    }
    assert kept == {"silhouette": templates, "infrared": images}


@pytest.mark.parametrize(
    "infrared",
    [
        InfraredConfig(contrast_at_zero=0.0),
        InfraredConfig(extinction=10.0),
        InfraredConfig(contrast_at_zero=1e-3),
        InfraredConfig(nedt=1000.0, target_spread=1000.0, sea_spread=0.0),
    ],
)
def test_very_low_signals_are_seen_through_without_a_warning(infrared, duncan, tmp_path):
    grid = replace(INFRARED_GRID, range=(25.0, 1000.0), segmentation=("matched", "otsu", "li"))
    plan = plan_of(tmp_path, code=CODE, infrared_grid=grid, infrared=infrared)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = view_images(View(duncan, 45.0, plan))
    assert np.isfinite(found["detection_probability"]).all()
    assert not np.isinf(found["reconstruction_error"]).any()
    faint = contrast(
        np.array(grid.range) * 1e3,
        contrast_at_zero=infrared.contrast_at_zero,
        extinction=infrared.extinction * 1e-3,
    )
    unknown = np.isnan(found["reconstruction_error"]).all(axis=(0, 1, 3, 4))
    np.testing.assert_array_equal(unknown, faint < 1e-6)


def test_windows_hold_the_images(duncan, tmp_path):
    plan = plan_of(tmp_path, code=CODE)
    images = view_images(View(duncan, 90.0, plan))["image"]
    windows = image_windows(INFRARED_GRID, plan.infrared, SceneConfig())
    assert images.shape[-2:] == (windows["vertical"].shape[-1], windows["horizontal"].shape[-1])
    for k, footprint in enumerate((3.75, 1.875, 1.875)):
        image = images[0, 0, k, 1]
        across, up = windows["horizontal"][0, k], windows["vertical"][0, k]
        there = np.ix_(np.isfinite(up), np.isfinite(across))
        assert np.isfinite(image[there]).any()
        assert np.isfinite(image).sum() == np.isfinite(image[there]).sum()
        # The pixels that show the ship lie where it is, within a pixel of the detector.
        row, col = np.nonzero(image > 0.8)
        assert np.ptp(across[col]) + footprint == pytest.approx(135.6, abs=3 * 3.75)
        assert np.median(np.abs(across[col])) < 40
        assert -5 < up[row].min() < 5


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

"""Infrared images are equal to the library's by hand, and sensors of one view share them."""

import numpy as np
import pytest
import trimesh
from infrared_channel import PATCHES, WAYS, view_from
from range_channel import choose
from scipy import stats

from ncti.infrared import LargestWindow, contrast, shifted_images, thermal_images
from ncti.infrared.hits import MARGIN
from ncti.render import line_image
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.resolve.plan import Plan
from sweeps.engine.resolve.streams import cell_rng
from sweeps.experiment import EXPERIMENT
from sweeps.stages.infrared import thermal_image

WINDOW = {"depression": 3.84, "ifov": 150e-6, "length": 200.0, "height": 50.0}


def placed(view, slant_range, way, frame_count):
    """Return (frame_count, row, col) images in the window of the largest ship."""
    largest = LargestWindow(slant_range * 1e3, **WINDOW)
    images = thermal_image(view, largest, super_resolution=way, frame_count=frame_count)
    assert not images["first_row"].any() and not images["first_col"].any()
    return images["image"]


# The ship


@pytest.mark.parametrize("aspect", [0.0, 45.0, 90.0])
@pytest.mark.parametrize("slant_range", [1.0, 25.0])
def test_the_window_holds_the_largest_ship_at_any_range(slant_range, aspect):
    """Near parts of a box of 199 m look larger, at 1 km by up to a tenth."""
    block = trimesh.creation.box((199.0, 19.0, 49.0))
    block.apply_translation((0.0, 0.0, 24.5))
    view = {"aspect": aspect, "depression": 3.84, "slant_range": slant_range * 1e3}
    (left, right), (bottom, top) = line_image(block, spacing=0.5, **view).bounds
    window = LargestWindow(slant_range * 1e3, **WINDOW).half_pixels()
    margin = MARGIN * 2 * window.footprint  # in half pixels
    rows, columns = window.coverage.shape
    for low, high, first, count in (
        (left, right, window.origin[0], columns),
        (bottom, top, window.origin[1], rows),
    ):
        begin = first - window.footprint / 2
        assert begin + margin <= low
        assert high <= begin + count * window.footprint - margin


def test_images_of_one_view_are_drawn_once_for_all_sensors():
    """Lines serve the range channel, the imager and, in the far field, the training range.

    OpenGL draws images for the range channel alone: silhouettes are masks, one for both ranges.
    """
    overrides = {"sensor": "both", "grid__ship": "duncan", "grid__aspect": 60}
    overrides |= {"grid__range": 50, "infrared__range": 50, "infrared__training_range": 25}

    def keys(**more):
        plan = Plan(EXPERIMENT, choose(**overrides | more))
        names = ("image", "infrared_image", "training_image")
        return [plan.key(plan.bound[name], 0) for name in names]

    lines = {"render__engine": "lines"}
    of_range, of_imager, of_training = keys(**lines)
    assert of_range == of_imager != of_training
    far = {"render__tolerance": 0.05}  # 1.5 reach / range is 0.41 % at 25 km
    of_range, of_imager, of_training = keys(**far)
    assert of_range == of_imager == of_training
    of_range, of_imager, of_training = keys(**far, scene__geometry="altitude")
    assert of_range == of_imager != of_training
    of_range, of_imager, of_training = keys(render__engine="osmesa", infrared__training_range=50)
    assert of_range != of_imager == of_training


def test_templates_depend_on_the_training_range_only():
    """At one altitude the depression depends on the range: at 25 km it is 15.6 deg."""
    overrides = {"sensor": "infrared", "grid__ship": "duncan", "grid__aspect": 60}
    overrides |= {"scene__geometry": "altitude", "infrared__training_range": 25}
    overrides["infrared__subpixel_offsets"] = 1

    def template(**more):
        plan = Plan(EXPERIMENT, choose(**overrides, **more))
        (cell,) = plan.cells(plan.bound["template_log_polar"])
        return plan.key(plan.bound["template_log_polar"], cell)

    at_50 = template(infrared__range=50)
    assert at_50 == template(infrared__range=100) == template(infrared__range=[50, 100])
    assert at_50 != template(infrared__range=50, scene__altitude=3000)


def test_pixels_exactly_at_the_coverage_rule_count_as_ship():
    coverage = view_from(25.0).coverage_at(0).coverage
    rule = coverage[(coverage > 0.2) & (coverage < 0.9)][0]
    mask = view_from(25.0, coverage_rule=rule).mask(0, 1)
    np.testing.assert_array_equal(mask, coverage >= rule)


# One cell by hand


@pytest.mark.parametrize("slant_range", [25.0, 50.0])
@pytest.mark.parametrize("rule", [0.25, 0.5])
def test_cell_matches_direct_library_calls(slant_range, rule):
    """Every variable of every super-resolution is the library's, from masks by histogram."""
    frames, phases = (1, 16), (0, 1)
    view = view_from(slant_range, coverage_rule=rule)
    view_name = {"ship": "boxes", "aspect": 60.0, "range": slant_range}
    places = cell_rng(3, stage="infrared_place", **view_name).random((2, 2))
    x, y, area = PATCHES.horizontal, PATCHES.vertical, PATCHES.area
    warmth = contrast(slant_range * 1e3)
    footprint = 150e-6 * slant_range * 1e3
    detected = view.detection_probability(1e-4, phases, frames)
    for way in WAYS:
        rng = cell_rng(3, stage="infrared", super_resolution=way, **view_name)
        placed_images = placed(view, slant_range, way, frames)
        errors = view.reconstruction_error(way, phases, frames)
        for phase, (across, up) in enumerate(places):
            # Whole pixels about the ship, and four more on each side of its own bounding box.
            edges = [
                footprint * (np.arange(np.floor(v.min() / footprint + offset) - 4, 400) - offset)
                for v, offset in ((y, up), (x, across))
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
                frame_counts=frames,
                rng=rng,
                nedt=0.3,
                target_spread=0.15,
                sea_spread=0.08,
            )
            np.testing.assert_array_equal(view.images(way, (phase,), frames)[0], images)
            doubled = images.repeat(2, 1).repeat(2, 2) if way == "none" else images
            for n, count in enumerate(frames):
                if phase == 0:
                    ours = placed_images[n][~np.isnan(placed_images[n])].reshape(images[n].shape)
                    np.testing.assert_array_equal(ours, images[n])
                error = np.sqrt(np.mean((doubled[n] - warmth * fine) ** 2)) / warmth
                assert errors[phase, n] == pytest.approx(error)
                # 1 - (1 - p)^n, of pixels of the detector.
                noise = 0.3 / np.sqrt(count)
                threshold = stats.norm.isf(1e-4, scale=np.hypot(0.08, noise))
                p = stats.norm.sf(threshold, warmth, np.hypot(0.15, noise))
                assert detected[phase, n] == pytest.approx(1 - (1 - p) ** coarse.sum())


def test_a_threshold_is_refused_without_scikit_image(monkeypatch):
    choices = choose(sensor="infrared", grid__ship="duncan", infrared__segmentation=["otsu"])
    assert EXPERIMENT.check(choices)
    monkeypatch.setattr("sweeps.stages.infrared.find_spec", lambda name: None)
    sentence = r"infrared.segmentation has otsu, but must be matched without scikit-image: pip "
    with pytest.raises(ConfigurationError, match=sentence):
        EXPERIMENT.check(choices)

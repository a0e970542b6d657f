"""Infrared images: against the library by hand, in what company, and what is refused."""

import math
import warnings

import numpy as np
import pytest
import trimesh
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as some
from infrared_channel import (
    BOXES,
    EXPERIMENT,
    HEIGHT,
    LENGTH,
    PATCHES,
    WAYS,
    choose,
    drawn,
    look_from,
)
from scipy import stats

from ncti.infrared import contrast, shifted_images, thermal_images
from ncti.render import line_image
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.plan import Plan
from sweeps.engine.seeds import cell_rng
from sweeps.stages.images import (
    detection_probability,
    image_window,
    largest_window,
    reconstruction_error,
    tabulate_detection,
    tabulate_reconstruction,
    thermal_image,
)
from sweeps.stages.infrared import Infrared, check
from sweeps.stages.infrared_look import MARGIN, whole_window

WINDOW = {"depression": 3.84, "ifov": 150.0, "window_length": 200.0, "window_height": 50.0}
FAINT = [
    {"contrast_at_zero": 0.0},
    {"extinction": 10.0},
    {"contrast_at_zero": 1e-3},
    {"nedt": 1000.0, "target_spread": 1000.0, "sea_spread": 0.0},
]


def placed(look, slant_range, way, frame_count, **window):
    """(frame_count, row, col) images in the window of the largest ship."""
    largest = largest_window(slant_range, **{**WINDOW, **window})
    found = thermal_image(look, largest, super_resolution=way, frame_count=frame_count)
    assert not found["first_row"].any() and not found["first_col"].any()
    return found["image"]


# The ship


def test_hits_come_back_where_they_were():
    image = drawn()
    rows, cols = np.nonzero(image.hit)
    horizontal, vertical = image.cross_range_at(rows, cols)
    np.testing.assert_array_equal(PATCHES.horizontal, horizontal)
    np.testing.assert_array_equal(PATCHES.vertical, vertical)
    area = sum((right - left) * (top - bottom) for left, right, bottom, top in BOXES)
    assert PATCHES.area * PATCHES.horizontal.size == pytest.approx(area, rel=0.01)
    assert PATCHES.extent == pytest.approx((-LENGTH / 2, LENGTH / 2, 0, HEIGHT), abs=0.5)


@pytest.mark.parametrize("aspect", [0.0, 45.0, 90.0])
@pytest.mark.parametrize("slant_range", [1.0, 25.0])
def test_the_window_holds_the_largest_ship_at_any_range(slant_range, aspect):
    """Near parts look larger: at 1 km those of a box of 199 m by up to a tenth."""
    block = trimesh.creation.box((199.0, 19.0, 49.0))
    block.apply_translation((0.0, 0.0, 24.5))
    view = {"aspect": aspect, "depression": 3.84, "slant_range": slant_range * 1e3}
    (left, right), (bottom, top) = line_image(block, spacing=0.5, **view).bounds
    window = whole_window(slant_range, 3.84, 150.0, 200.0, 50.0)
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
    """The range channel's, the imager's and, in the far field, that of the training range."""
    given = {"sensor": "both", "grid__ship": "duncan", "grid__aspect": 60}
    given |= {"grid__range": 50, "infrared__range": 50, "infrared__training_range": 25}

    def keys(**more):
        plan = Plan(EXPERIMENT, choose(**given, **more))
        names = ("image", "infrared_image", "training_image")
        return [plan.key(plan.bound[name], ()) for name in names]

    of_range, of_imager, of_training = keys()
    assert of_range == of_imager != of_training
    far = {"render__tolerance": 0.05}  # 1.5 reach / range is 0.41 % at 25 km
    of_range, of_imager, of_training = keys(**far)
    assert of_range == of_imager == of_training
    of_range, of_imager, of_training = keys(**far, scene__geometry="altitude")
    assert of_range == of_imager != of_training


def test_templates_are_seen_from_the_training_range_whatever_is_tested():
    """At one altitude, where the depression goes by the range: 25 km is seen from 15.6 deg."""
    given = {"grid__ship": "duncan", "grid__aspect": 60, "infrared__phases": 1}
    given |= {"scene__geometry": "altitude", "infrared__training_range": 25}

    def template(**more):
        plan = Plan(EXPERIMENT, choose(**given, **more))
        (place,) = plan.cells(plan.bound["template_log_polar"])
        return plan.key(plan.bound["template_log_polar"], place)

    at_50 = template(infrared__range=50)
    assert at_50 == template(infrared__range=100) == template(infrared__range=[50, 100])
    assert at_50 != template(infrared__range=50, scene__altitude=3000)


# One cell by hand


@pytest.mark.parametrize("slant_range", [25.0, 50.0])
@pytest.mark.parametrize("rule", [0.25, 0.5])
def test_a_cell_is_the_library_done_by_hand(slant_range, rule):
    """Every variable of every way to see the ship, from templates counted by histogram."""
    frames, phases = (1, 16), (0, 1)
    look = look_from(slant_range, coverage_rule=rule)
    named = {"ship": "boxes", "aspect": 60.0, "range": slant_range}
    places = cell_rng(3, stage="infrared_place", **named).random((2, 2))
    x, y, area = PATCHES.horizontal, PATCHES.vertical, PATCHES.area
    warmth = contrast(slant_range * 1e3)
    footprint = 150e-6 * slant_range * 1e3
    detected = detection_probability(look, 1e-4, phases, frames)
    for way in WAYS:
        rng = cell_rng(3, stage="infrared", super_resolution=way, **named)
        shown = placed(look, slant_range, way, frames)
        errors = reconstruction_error(look, way, phases, frames)
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
                frame_counts=frames,
                rng=rng,
                nedt=0.3,
                target_spread=0.15,
                sea_spread=0.08,
            )
            np.testing.assert_array_equal(look.images(way, (phase,), frames)[0], images)
            doubled = images.repeat(2, 1).repeat(2, 2) if way == "none" else images
            for n, count in enumerate(frames):
                if phase == 0:
                    ours = shown[n][~np.isnan(shown[n])].reshape(images[n].shape)
                    np.testing.assert_array_equal(ours, images[n])
                error = np.sqrt(np.mean((doubled[n] - warmth * fine) ** 2)) / warmth
                assert errors[phase, n] == pytest.approx(error)
                # 1 - (1 - p)^n, of pixels of the detector.
                noise = 0.3 / np.sqrt(count)
                threshold = stats.norm.isf(1e-4, scale=np.hypot(0.08, noise))
                p = stats.norm.sf(threshold, warmth, np.hypot(0.15, noise))
                assert detected[phase, n] == pytest.approx(1 - (1 - p) ** coarse.sum())


# Company


@settings(max_examples=15, deadline=None)
@given(
    phases=some.sets(some.integers(0, 3), min_size=1),
    frame_count=some.sets(some.sampled_from([1, 3, 16, 40]), min_size=1),
    way=some.sampled_from(WAYS),
)
def test_a_value_does_not_depend_on_its_company(phases, frame_count, way):
    """A look asked again, and a new one asked for something else, to the last bit."""
    every, counts = (0, 1, 2, 3), (1, 3, 16, 40)
    phases, frame_count = tuple(sorted(phases)), tuple(sorted(frame_count))
    of_counts = [counts.index(count) for count in frame_count]
    at = np.ix_(phases, of_counts)
    known = look_from(50.0)
    images = known.images(way, every, counts)
    errors = reconstruction_error(known, way, every, counts)
    detected = detection_probability(known, 1e-6, every, counts)
    shown = placed(known, 50.0, way, counts)
    for look in (known, look_from(50.0)):
        np.testing.assert_array_equal(look.images(way, phases, frame_count), images[at])
        found = reconstruction_error(look, way, phases, frame_count)
        np.testing.assert_array_equal(found, errors[at])
        found = detection_probability(look, 1e-6, phases, frame_count)
        np.testing.assert_array_equal(found, detected[at])
        found = placed(look, 50.0, way, frame_count)
        np.testing.assert_array_equal(found, shown[of_counts])


# Windows


@pytest.mark.parametrize("slant_range", [25.0, 50.0, 1000.0])
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("seed", range(4))
def test_a_window_as_tight_as_the_ship_holds_it(slant_range, way, seed):
    """The ship and its margin are in the window, whatever pixel each of them begins with."""
    look = look_from(slant_range, seed=seed, nedt=0.001, sea_spread=0.01, target_spread=0.01)
    tight = {"window_length": LENGTH, "window_height": HEIGHT, "depression": 0.0}
    (shown,) = placed(look, slant_range, way, (16,), **tight)
    assert np.isfinite(shown).any()
    synthesised = look.images(way, (0,), (16,))[0, 0]
    half = look.contrast / 2
    assert (shown > half).sum() == (synthesised > half).sum()


@pytest.mark.parametrize("way", WAYS)
def test_windows_tell_where_images_lie(way):
    look = look_from(25.0, nedt=0.001, sea_spread=0.01, target_spread=0.01)
    (shown,) = placed(look, 25.0, way, (16,))
    lines = image_window(largest_window(25.0, **WINDOW), super_resolution=way)
    up, across = lines["vertical"], lines["horizontal"]
    assert shown.shape == (up.size, across.size)
    footprint = {"none": 3.75, "perfect": 1.875, "shifted": 1.875}[way]
    np.testing.assert_allclose(np.diff(up), footprint)
    np.testing.assert_allclose(np.diff(across), footprint)
    row, col = np.nonzero(shown > look.contrast / 2)
    # Within a pixel of the detector, whatever the place of the ship on it.
    assert across[col].min() == pytest.approx(-LENGTH / 2, abs=3.75)
    assert across[col].max() == pytest.approx(LENGTH / 2, abs=3.75)
    assert up[row].min() == pytest.approx(0, abs=3.75)
    assert up[row].max() == pytest.approx(HEIGHT, abs=3.75)


# Low signals


@pytest.mark.parametrize("faint", FAINT)
@pytest.mark.parametrize("slant_range", [25.0, 1000.0])
def test_very_low_signals_are_seen_through_without_a_warning(faint, slant_range):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        look = look_from(slant_range, **faint)
        found = detection_probability(look, 1e-6, (0,), (1, 16))
        errors = [reconstruction_error(look, way, (0,), (1, 16)) for way in WAYS]
    assert np.isfinite(found).all()
    unknown = look.contrast < 1e-6
    assert np.isnan(errors).all() if unknown else np.isfinite(errors).all()


# What a result depends on

BASE = {
    **{"grid__ship": "duncan", "grid__aspect": 30, "grid__range": 50, "grid__frame_count": 16},
    **{"classifier__name": "acn", "infrared__phases": 2, "infrared__orders": 2},
}
HITS_OF, TEMPLATE_HITS = {"hits"}, {"training_hits"}
TEMPLATE = {"template_log_polar"}
MASKS, MAPS = {"silhouettes"}, {"log_polar"}
DETECTED, ERRORS, IMAGE = {"detection_probability"}, {"reconstruction_error"}, {"thermal_image"}
SEEN = MASKS | MAPS | DETECTED | ERRORS | IMAGE


@pytest.mark.parametrize(
    ("change", "made_again"),
    [
        ({"seed": 5}, SEEN),
        ({"infrared__nedt": 0.2}, SEEN),
        ({"infrared__contrast_at_zero": 2}, SEEN),
        ({"infrared__false_alarm": 1e-3}, DETECTED),
        ({"infrared__window_length": 260}, IMAGE),
        ({"infrared__orders": 7}, set()),
        ({"infrared__vigilance": 0.5}, set()),
        ({"infrared__range": [25, 50]}, SEEN | HITS_OF),
        ({"infrared__inner_radius": [0.5, 0.6]}, MAPS | TEMPLATE),
        ({"infrared__interpolation": "bilinear"}, MAPS | TEMPLATE),
        ({"infrared__segmentation": ["matched", "li"]}, MASKS | MAPS),
        ({"infrared__phases": 3}, MASKS | MAPS | DETECTED | ERRORS | TEMPLATE),
        ({"infrared__frame_count": [16, 32]}, SEEN),
        ({"infrared__super_resolution": "none"}, set()),
        ({"infrared__ifov": 120}, SEEN | TEMPLATE),
        ({"infrared__coverage_rule": 0.3}, SEEN | TEMPLATE),
        ({"infrared__training_range": 50}, TEMPLATE | TEMPLATE_HITS),
        ({"render__pixel": 0.5}, SEEN | TEMPLATE | HITS_OF | TEMPLATE_HITS),
        ({"scene__depression": 3.0}, SEEN | TEMPLATE | HITS_OF | TEMPLATE_HITS),
    ],
)
def test_a_result_is_made_again_for_what_it_depends_on(change, made_again):
    """Stages with cells that a changed configuration has and the old one has not."""
    before, after = (cell_keys(choose(**BASE | one)) for one in ({}, change))
    of_images = [*HITS_OF, *TEMPLATE_HITS, *TEMPLATE, *SEEN]
    new = {name for name in of_images if after[name] - before[name]}
    assert new == made_again


def cell_keys(choices):
    plan = Plan(EXPERIMENT, choices)
    return {
        name: {plan.key(bound, place) for place in plan.cells(bound)}
        for name, bound in plan.bound.items()
        if bound.stage.kept
    }


# Settings


def test_what_is_not_given_is_the_grid_s():
    found = choose(grid__range=[25, 50], grid__frame_count=8, grid__vigilance=0.9)
    assert found[Infrared.range] == (25, 50)
    assert found[Infrared.frame_count] == (8,)
    assert found[Infrared.vigilance] == (0.9,)
    assert choose(infrared__range=75)[Infrared.range] == (75,)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"infrared__nedt": 0}, "infrared.nedt has 0, but every value must be a finite number "),
        (
            {"infrared__coverage_rule": [0.5, 1]},
            "infrared.coverage_rule has 1, but every value must be a finite number at least 0.01 "
            "and at most 0.95",
        ),
        (
            {"infrared__super_resolution": "magic"},
            "infrared.super_resolution has 'magic', but every value must be one of none, perfect, "
            "shifted",
        ),
        ({"infrared__phases": 0}, "infrared.phases is 0, but must be a whole number from 1 to"),
        (
            {"infrared__window_length": [100, 200]},
            "infrared.window_length has 2 values, but must have one: it shapes arrays",
        ),
        (
            {"infrared__range": [25, 1]},
            "infrared.range has 1, where half infrared.ifov of 75 urad is 0.075 m wide, but must "
            "be at least render.pixel, 0.25 m",
        ),
        ({"grid__range": 1}, "grid.range has 1, where half infrared.ifov of 75 urad is 0.075 m"),
        ({"infrared__training_range": 2}, "infrared.training_range has 2, where half infrared."),
        (
            {"infrared__ifov": [150, 4]},
            "grid.range has 100, where half infrared.ifov of 2 urad is 0.2 m",
        ),
        (
            {"infrared__range": 400, "scene__geometry": "altitude"},
            "infrared.range has 400: ",
        ),
    ],
)
def test_refusals(given, said):
    with pytest.raises(ConfigurationError) as raised:
        check(choose(grid__ship="duncan", render__pixel=0.25, **given))
    assert str(raised.value).startswith(said)


@pytest.mark.parametrize(
    ("key", "given", "needed"), [("window_length", 40, 41), ("window_height", 5, 6)]
)
def test_a_window_that_does_not_hold_a_ship_is_refused(key, given, needed, tmp_path):
    """A box of 40 x 8 m, whose corners turn on a circle of 40.8 m, 6 m above the sea."""
    mesh = trimesh.creation.box((40.0, 8.0, 8.0))
    mesh.apply_translation((0, 0, 2.0))
    path = tmp_path / "barge.stl"
    mesh.export(path)
    said = f"infrared.{key} is {given} m, but must be at least {needed} m to hold barge"
    with pytest.raises(ConfigurationError, match=f"^{said}$"):
        check(choose(grid__ship=str(path), **{f"infrared__{key}": given}))
    enough = choose(grid__ship=str(path), **{f"infrared__{key}": needed})
    assert check(enough) is enough


# Tables

SHIPS, ASPECTS = ["duncan", "texas"], [0.0, 15.0, 45.0]  # pooled as 0-15 and 45
NONE = np.nan
FOUND = [[[0.5, 1.0], [0.25, 0.25], [0.0, 1.0]], [[NONE, NONE], [0.5, 0.5], [1.0, 1.0]]]
ERROR = [[[1.0, 3.0], [2.0, 2.0], [1.0, 3.0]], [[NONE, NONE], [1.0, 3.0], [1.0, 3.0]]]


def group_of(found, error):
    """A store's group of images: (ship, aspect, phase) of one range and number of frames."""
    found, error = np.asarray(found, "f4"), np.asarray(error, "f4")
    return xr.Dataset(
        {
            "detection_probability": (
                ("ship", "aspect", "phase", "range", "frame_count"),
                found[..., None, None],
            ),
            "reconstruction_error": (
                ("ship", "aspect", "phase", "range", "super_resolution", "frame_count"),
                error[..., None, None, None],
            ),
        },
        {
            "ship": SHIPS,
            "aspect": ASPECTS,
            "phase": [0, 1],
            "range": [100.0],
            "super_resolution": ["shifted"],
            "frame_count": [16],
            "coverage_rule": 0.25,
            "segmentation": "matched",
        },
    )


def test_images_of_a_view_that_failed_are_left_out():
    images = group_of(FOUND, ERROR)
    detection = tabulate_detection(images, None)
    # 0-15: 0.5 + 1 + 0.25 + 0.25 + 0.5 + 0.5 = 3 of 6; 45: 3 of 4; overall: 6 of 10.
    assert detection.aspect_bin.values.tolist() == ["0-15", "45", "overall"]
    np.testing.assert_allclose(detection.probability.values.reshape(-1), [0.5, 0.75, 0.6])
    np.testing.assert_allclose(detection.lowest.values.reshape(-1), [0.25, 0.0, 0.0])
    restored = tabulate_reconstruction(images, None)
    # Four pairs of 1 and 3, and 2 twice: the mean is 2, the variance 8 / 10.
    assert restored.error.item() == pytest.approx(2)
    assert restored.error_spread.item() == pytest.approx(math.sqrt(0.8), rel=1e-6)
    for table in (detection, restored):
        assert "segmentation" not in table.coords  # images do not depend on it
        assert table.coverage_rule == 0.25


def test_a_bin_and_a_cell_without_images_are_unknown():
    found = np.array(FOUND)
    found[:, 2] = NONE
    images = group_of(found, np.full((2, 3, 2), NONE))
    detection = tabulate_detection(images, None)
    np.testing.assert_allclose(detection.probability.values.reshape(-1), [0.5, NONE, 0.5])
    np.testing.assert_allclose(detection.lowest.values.reshape(-1), [0.25, NONE, 0.25])
    restored = tabulate_reconstruction(images, None)
    assert np.isnan(restored.error) and np.isnan(restored.error_spread)

"""Detections have every hot pixel, cues hold ships, and probabilities are the library's."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ncti.infrared import detection_probability, detection_threshold, pixel_sigma
from studies.scan.field import Box, Field, cue, detect, elevation, thermal_field

IFOV = 150e-6
HOT = arrays(bool, (12, 20), fill=st.just(False))
REACH = st.tuples(st.integers(0, 6), st.integers(0, 4))


def field_of(rows, columns):
    return Field(width=(columns - 0.5) * IFOV, height=(rows - 0.5) * IFOV, ifov=IFOV)


def test_source_field_has_the_stated_number_of_pixels():
    assert Field(width=math.radians(3), height=math.radians(2), ifov=IFOV).shape == (233, 350)
    assert Field(width=0.03, height=0.015, ifov=IFOV).pixel(0.0, 0.0) == (100, 50)


@given(HOT, REACH)
def test_detections_partition_the_hot_pixels(hot, reach):
    detections = detect(hot.astype(float), threshold=0.5, reach=reach)
    pixels = [tuple(pixel) for detection in detections for pixel in detection.pixel.tolist()]
    assert sorted(pixels) == sorted((column, row) for row, column in np.argwhere(hot).tolist())
    for detection in detections:
        assert detection.box.holds(detection.pixel).all()
        assert detection.box[:2] == tuple(detection.pixel.min(axis=0))


@given(HOT, REACH)
def test_detections_are_separated_and_connected(hot, reach):
    regions = detect(hot.astype(float), threshold=0.5, reach=reach)
    for k, region in enumerate(regions):
        for earlier in regions[:k]:
            near = (np.abs(region.pixel[:, None] - earlier.pixel) <= reach).all(axis=-1)
            assert not near.any()
        linked = {0}  # of its pixels, by plain search
        grown = True
        while grown:
            steps = np.abs(region.pixel[:, None] - region.pixel[list(linked)])
            near = (steps <= reach).all(axis=-1)
            reached = set(np.flatnonzero(near.any(axis=1)).tolist())
            grown, linked = reached > linked, linked | reached
        assert len(linked) == len(region.pixel)


@given(
    ship=st.tuples(st.integers(-5, 5), st.integers(-5, 5), st.integers(1, 9), st.integers(1, 4)),
    more=st.tuples(st.integers(0, 5), st.integers(0, 3)),
    detector=st.integers(1, 4),
    data=st.data(),
)
def test_cue_contains_the_whole_ship_from_any_visible_part(ship, more, detector, data):
    left, bottom, columns, rows = ship
    cells = np.argwhere(np.ones((columns, rows), bool)) + np.array([left, bottom])
    reach = (columns - 1 + more[0], rows - 1 + more[1])  # of the largest ship, at least as large
    visible = cells[data.draw(st.lists(st.integers(0, len(cells) - 1), min_size=1))]
    box = Box(*visible.min(axis=0).tolist(), *(visible.max(axis=0) + 1).tolist())
    visit = cue(box, reach=reach, detector=detector)
    assert visit.holds(cells).all()
    assert not (np.array(visit.size) % detector).any()
    for size, seen_size, steps in zip(visit.size, box.size, reach, strict=True):
        least = 2 * steps + 2 - seen_size  # all places of a ship as long as the reach allows
        assert least <= size < least + detector


@pytest.mark.parametrize("false_alarm", [1e-2, 1e-3])
def test_detection_and_false_alarm_rates_match_the_library(false_alarm):
    """600 draws and their 600 x 288 pixels of sea pass binomial z-tests at 4 sigma (6e-5)."""
    field, draws = field_of(15, 20), 600
    ship = np.argwhere(np.ones((6, 2), bool)) + np.array([7, 6])
    noise = {"nedt": 0.4, "target_spread": 0.1, "sea_spread": 0.05}
    sigma = {
        f"{name}_sigma": float(pixel_sigma(noise[f"{name}_spread"], frame_count=16, nedt=0.4))
        for name in ("target", "sea")
    }
    threshold = detection_threshold(false_alarm=false_alarm, sigma=sigma["sea_sigma"])
    rng = np.random.default_rng(5)
    detected = alarms = 0
    for _ in range(draws):
        image = thermal_field(field, [ship], [0.15], frame_count=16, rng=rng, **noise)
        detections = detect(image, threshold=threshold, reach=(0, 0))
        box = Box(7, 6, 13, 8)
        inside = sum(int(box.holds(detection.pixel).sum()) for detection in detections)
        detected += inside > 0
        alarms += sum(len(detection.pixel) for detection in detections) - inside
    p = detection_probability(12, contrast=0.15, false_alarm=false_alarm, **sigma)
    assert 0.1 < p < 0.99
    assert abs(detected - draws * p) < 4 * math.sqrt(draws * p * (1 - p))
    sea = draws * (300 - 12)
    assert abs(alarms - sea * false_alarm) < 4 * math.sqrt(sea * false_alarm)


def test_farther_points_on_a_flat_sea_appear_higher():
    sensor = {"middle_range": 100e3, "depression": math.radians(3.84)}
    assert elevation(100e3, **sensor) == pytest.approx(0.0, abs=1e-15)
    # The sensor is 6,697 m up: 105 km away it looks down by asin(0.06378) = 3.657 deg.
    assert math.degrees(elevation(105e3, **sensor)) == pytest.approx(3.84 - 3.657, abs=1e-3)
    assert elevation(95e3, **sensor) < 0

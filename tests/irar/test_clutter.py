"""Clutter of the sea: its variance, its correlation, and what lies still on the water."""

import dataclasses
import math

import numpy as np
import pytest
from flown import flight, pole_on_box, seen_from
from scipy import stats

from ncti.irar import correct, fly, ship_window
from ncti.irar.clutter import WAVES, clutter, sea_places
from ncti.irar.scan import wander
from ncti.irar.scene import ScanPlan

DEVIATION, LENGTH = 0.3, 12.0
DRAWS = 2000


@pytest.fixture(scope="module")
def ship():
    return pole_on_box(60, 9, 5, 20)


@pytest.fixture(scope="module")
def flown(ship):
    return fly(ship, flight(175.0, samples=120, line_rate=60))


def with_sea(passed, **sea):
    """The same pass, before another sea."""
    changed = dataclasses.replace(passed.plan.flight, **sea)
    return dataclasses.replace(passed, plan=dataclasses.replace(passed.plan, flight=changed))


APART = np.array([0.0, 3.0, 6.0, 12.0, 24.0, 60.0])


def field(places, rng):
    return clutter(places, deviation=DEVIATION, length=LENGTH, rng=rng)


@pytest.fixture(scope="module")
def draws():
    """(draw, line, place): along x, and slantwise far from there."""
    rng = np.random.default_rng(6)
    lines = [(APART, 0 * APART), (100.0 + 0.6 * APART, 0.8 * APART)]
    places = np.moveaxis(np.array(lines), 1, -1)
    return np.array([field(places, rng) for _ in range(DRAWS)])


def test_clutter_has_its_deviation_and_its_correlation(draws):
    """2,000 draws at six distances, along and across: each within 4.5 standard errors.

    The product of two normals of correlation r scatters by sqrt(1 + r^2); 24 comparisons, of which
    one is beyond 4.5 with a probability of 2e-4.
    """
    found = draws / DEVIATION
    assert np.abs(found.mean(axis=0)).max() < 4.5 / math.sqrt(DRAWS)
    expected = np.exp(-((APART / LENGTH) ** 2))
    for line in np.moveaxis(found, 1, 0):
        ours = (line * line[:, :1]).mean(axis=0)
        error = np.sqrt((1 + expected**2) / DRAWS)
        assert (np.abs(ours - expected) < 4.5 * error).all()


def test_clutter_is_normal_but_for_its_kurtosis(draws):
    """Of 2,000 draws at one place: skewness 0, kurtosis -3 / (2 W), within 4 standard errors."""
    found = draws[:, 0, 0]
    assert abs(stats.skew(found)) < 4 * math.sqrt(6 / DRAWS)
    expected = -1.5 / WAVES
    assert stats.kurtosis(found) == pytest.approx(expected, abs=4 * math.sqrt(24 / DRAWS))


def test_one_sea_has_the_variance_of_many():
    """Over 300 lengths each way, where 64 cosines of unequal waves are all but orthogonal.

    The variance is deviation^2 in every draw but for the mean product of pairs, of the order of
    1 / 300 for the few that are alike: below 5 %.
    """
    rng = np.random.default_rng(1)
    places = rng.uniform(0, 300 * LENGTH, (40_000, 2))
    for _ in range(3):
        assert field(places, rng).std() == pytest.approx(DEVIATION, rel=0.05)


def test_no_deviation_is_no_clutter_and_no_sea_has_none():
    places = np.array([[0.0, 1.0], [math.nan, 2.0]])
    rng = np.random.default_rng(2)
    assert not clutter(places, deviation=0.0, length=LENGTH, rng=rng).any()
    found = clutter(places, deviation=1.0, length=LENGTH, rng=rng)
    assert found[0] != 0 and found[1] == 0


def test_lines_of_sight_meet_the_water_where_the_ships_frame_says(flown):
    """What is seen at the place at that time lies on the line of sight: angles from the speeds."""
    seen = flown.plan.flight
    columns = np.arange(0, seen.samples, 17)
    time = flown.plan.time(columns)[::40]
    along = np.broadcast_to(seen.scan_angles(columns), time.shape)
    places = sea_places(seen, time, along, np.zeros_like(along))
    on_ship = np.stack(
        [places[..., 0] - seen.ship_speed * time, places[..., 1], np.zeros_like(time)], axis=-1
    )
    right, above = seen.angles_to(on_ship, time)
    np.testing.assert_allclose(right, along, atol=1e-12)
    np.testing.assert_allclose(above, 0.0, atol=1e-12)
    assert (seen_from(seen, on_ship, time)[..., 2] > -seen.slant_range).all()


def test_above_the_horizon_there_is_no_sea(flown):
    seen, up = flown.plan.flight, np.array([0.0, math.radians(20.0)])
    places = sea_places(seen, np.zeros(2), np.zeros(2), up)
    assert np.isfinite(places[0]).all() and np.isnan(places[1]).all()


def test_clutter_is_of_the_sea_alone_and_changes_nothing_else(flown):
    plain, rough = (
        with_sea(flown, clutter=level).record(np.random.default_rng(5))
        for level in (0.0, DEVIATION)
    )
    np.testing.assert_array_equal(plain.intensity, rough.intensity)
    np.testing.assert_array_equal(plain.range, rough.range)
    share = 1 - flown.returns.without_leading(11).coverage()
    added = rough.infrared[0] - plain.infrared[0]
    np.testing.assert_allclose(added[share == 0], 0.0, atol=1e-6)
    assert added[share == 1].std() == pytest.approx(DEVIATION, rel=0.5)  # a few patches
    # Detector k looks k samples behind the first, at the same water.
    after = (rough.infrared - plain.infrared)[7, :, 7:]
    np.testing.assert_allclose(after, added[:, :-7], atol=1e-6)
    quiet = with_sea(flown, clutter=DEVIATION).noiseless()
    np.testing.assert_array_equal(quiet.infrared, flown.noiseless().infrared)


def test_averages_of_lines_keep_clutter(flown, ship):
    """Where noise falls by the root of all samples of a pixel, of patches 40 m wide all is left.

    A pixel is 0.8 m across and 7 m deep on the water: the mean of its looks is one of them, but for
    (7 / 40)^2 / 12 of a patch, 0.3 %, and the sea between the middles of pixels and samples.
    """
    passed = with_sea(flown, nedt=0.0, clutter=DEVIATION, clutter_length=40.0)
    scan = passed.record(np.random.default_rng(8))
    window = ship_window(ship, scan.flight, margin=10)
    clean = passed.noiseless()
    sea = correct(clean, window=window).infrared == 0
    averaged = correct(scan, window=window).infrared[sea]
    single = correct(dataclasses.replace(scan, infrared=scan.infrared[:1]), window=window)
    assert np.nanstd(averaged) == pytest.approx(np.nanstd(single.infrared[sea]), rel=0.05)
    noise = with_sea(flown, contrast_at_zero=0.0).record(np.random.default_rng(8))
    looks = correct(noise, window=window)
    expected = noise.flight.nedt / np.sqrt(12 * looks.looks[looks.looks > 0]).mean()
    assert np.nanstd(looks.infrared) == pytest.approx(expected, rel=0.15)


def test_jitter_moves_the_sea_with_the_ship(ship):
    """The attitude of a pass is that of its clutter."""
    shaken = flight(175.0, jitter=3e-4, jitter_time=0.02, clutter=DEVIATION)
    passed = fly(ship, shaken, rng=np.random.default_rng(6))
    errors = wander(ScanPlan(passed.plan.flight, 0, passed.plan.lines), np.random.default_rng(6))
    np.testing.assert_array_equal(passed.attitude, errors)
    calm = dataclasses.replace(passed, attitude=None)
    one, other = (each.record(np.random.default_rng(1)).infrared for each in (passed, calm))
    assert not np.array_equal(one, other)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"deviation": -1.0}, r"deviation is -1\.0"),
        ({"length": 0.0}, r"length is 0\.0, but must be a finite number above 0"),
        ({"rng": 3}, "rng is 3, but must be"),
    ],
)
def test_bad_input_is_named(change, message):
    given = {"deviation": 1.0, "length": 1.0, "rng": np.random.default_rng(0)} | change
    with pytest.raises(ValueError, match=message):
        clutter(np.zeros((1, 2)), **given)

"""The whole chain, from a flight to a profile, recovers the true image and profile of a ship."""

import dataclasses
import math

import numpy as np
import pytest
import trimesh
from flown import CLEAN, flight
from scipy.ndimage import binary_dilation, binary_erosion

from ncti import irar, ships
from ncti.irar.chain import RANGE_FILTERS, SHIP_CONTRAST, nearest_ship_range

CELLS = 4
HANGAR = 4.0


@pytest.fixture(scope="module")
def roberts():
    return ships.load("roberts")


@pytest.fixture(scope="module")
def flown(roberts):
    """Return the study's pass over the ship, near stern, at 3.9 km."""
    return irar.fly(roberts, flight(175.0))


@pytest.fixture(scope="module")
def window(roberts, flown):
    return irar.ship_window(roberts, flown.plan.flight)


@pytest.fixture(scope="module")
def truth(roberts, flown, window):
    return irar.true_snapshot(roberts, flown.plan.flight, window, cells=CELLS)


@pytest.fixture(scope="module")
def true_profile(flown, truth):
    return irar.profile(truth, flown.plan.flight)


@pytest.fixture(scope="module")
def scans(flown):
    """Return two scans of the pass at each of 15, 20 and 30 dB."""
    by_snr = {}
    for decibels in (15, 20, 30):
        changed = dataclasses.replace(flown.plan.flight, cnr=10 ** (decibels / 10))
        there = dataclasses.replace(flown, plan=dataclasses.replace(flown.plan, flight=changed))
        by_snr[decibels] = [there.record(np.random.default_rng((decibels, n))) for n in range(2)]
    return by_snr


def correlation(a, b):
    return np.corrcoef(a, b)[0, 1]


def averaged(snapshot):
    """Return the means over the cells of each pixel."""
    rows, columns = snapshot.window.rows, snapshot.window.columns
    return snapshot.intensity.reshape(rows, CELLS, columns, CELLS).mean(axis=(1, 3))


def without_hangar(expected):
    """Return a mask of the bins more than 4 m from the highest one."""
    return np.abs(np.arange(expected.size) - expected.argmax()) > HANGAR


def measured(scan, window, **how):
    image = irar.correct(scan, irar.Correction(**how), window=window, overscanned=True)
    return irar.profile(irar.segmented(image, scan.flight), scan.flight)


def test_noiseless_flight_reproduces_the_true_snapshot(flown, window, truth):
    """Check the image, its energy, and the ranges of faces towards the sensor.

    A corrected pixel averages looks spread over it, and the truth averages cells, but looks come
    from up to 400 m further or nearer: energy agrees to 1 %. At a step, or on a deck, a pixel
    reports the range of one of several returns, so only ranges of faces are compared.
    """
    scan = flown.noiseless()
    image = irar.correct(scan, window=window)
    expected = averaged(truth)
    intensity = np.nan_to_num(image.intensity)
    assert correlation(intensity.ravel(), expected.ravel()) > 0.995
    assert intensity.sum() == pytest.approx(expected.sum(), rel=0.01)
    assert expected[intensity == 0].sum() < 1e-3 * expected.sum()
    middle = truth.range.reshape(window.rows, CELLS, window.columns, CELLS)
    spread = np.ptp(middle, axis=(1, 3))
    face = spread < 0.5  # NaN where a cell sees none
    assert face.sum() > 100
    off = (image.range - middle.mean(axis=(1, 3)))[face]
    assert np.median(np.abs(off)) < 0.2
    assert np.mean(np.abs(off) < 1) > 0.95


@pytest.mark.parametrize("decibels", [15, 30])
def test_measured_profile_correlates_with_true_profile(decibels, scans, window, true_profile):
    """Correlation is 0.95 from 15 dB on, and 0.90 without the hangar, which dominates the first."""
    beside = without_hangar(true_profile)
    for scan in scans[decibels]:
        profile = measured(scan, window)
        assert correlation(profile, true_profile) >= 0.95
        assert correlation(profile[beside], true_profile[beside]) >= 0.90


@pytest.mark.parametrize("threshold", [5.0, 7.0, 12.0])
def test_dropout_threshold_does_not_change_ship_ranges(scans, threshold):
    """The threshold drops half or nearly all of the sea's samples; ship ranges stay the same."""
    scan = scans[20][0]
    flight = dataclasses.replace(scan.flight, threshold=threshold)
    reported = scan.intensity >= threshold
    censored = dataclasses.replace(
        scan,
        plan=dataclasses.replace(scan.plan, flight=flight),
        intensity=np.where(reported, scan.intensity, 0),
        range=np.where(reported, scan.range, np.nan),
    )
    level = SHIP_CONTRAST * np.median(scan.intensity)
    assert level > 12.0  # no sample of the ship is lost
    # Compare near the ship. The median of a scan includes some samples of the ship, so that few
    # samples fall on the other side of the level of pure noise.
    beside = binary_dilation(scan.intensity > 2 * level, iterations=2)
    equal = nearest_ship_range(censored) == nearest_ship_range(scan)
    assert equal[beside].mean() > 0.99


def test_clusters_are_better_than_the_median_and_the_mean(scans, window, true_profile):
    """Check this at 20 dB on both scans, with the hangar's bins and without them."""
    beside = without_hangar(true_profile)
    for scan in scans[20]:
        profiles = [measured(scan, window, range_filter=name) for name in RANGE_FILTERS]
        for bins in (slice(None), beside):
            cluster, median, mean = (correlation(p[bins], true_profile[bins]) for p in profiles)
            assert cluster > median > mean


def test_snr_grows_as_root_of_looks_and_detectors():
    """Check a flat wall that faces the sensor to 5 %: 3 standard errors of 2,000 pixels or more.

    Where the number N of looks varies, the mean of 1 / N counts. The expected number is the lines
    in the time of one pixel's climb, corrected by cos L + sin L drift / climb for tilted lines
    and drift, and by the range that the aircraft has closed.
    """
    plate = trimesh.creation.box((1.0, 70.0, 28.0))
    plate.apply_transform(trimesh.transformations.rotation_matrix(math.radians(6.7), [0, 1, 0]))
    plate.apply_translation((0, 0, 14.0))
    flyby = irar.fly(plate, flight(180.0, samples=200, pulse_rate=1e6, cnr=CLEAN))
    scan = flyby.record(np.random.default_rng(7))
    image = irar.correct(scan)
    cover = irar.true_snapshot(plate, scan.flight, image.window).infrared == 1
    inner = binary_erosion(cover, iterations=2)
    assert inner.sum() >= 2000
    assert image.looks[inner].min() >= 8
    frames = 1 / np.mean(1 / image.looks[inner])
    lean = math.radians(irar.mirror_rotation(scan.flight.depression))
    denser = math.cos(lean) + math.sin(lean) * scan.flight.drift / scan.flight.climb
    closer = scan.flight.slant_range - scan.flight.closing_speed * 14 / scan.flight.climb
    expected = scan.flight.lines_per_pixel / denser * scan.flight.slant_range / closer
    assert frames == pytest.approx(expected, rel=0.03)

    def snr(values):
        return values.mean() / values.std()

    active = snr(image.intensity[inner])
    assert active == pytest.approx(math.sqrt(frames), rel=0.05)
    raw = flyby.noiseless().infrared
    single = raw.max() / scan.flight.nedt
    passive = snr(image.infrared[inner])
    assert passive / single == pytest.approx(math.sqrt(12 * frames), rel=0.05)
    np.testing.assert_array_less(
        np.abs(image.range[inner] - _plane(image, scan.flight)[inner]), 3.0
    )


def _plane(image, flown):
    """Return the range of a plane across the line of sight through the plate's near side."""
    right = image.column * flown.ifov
    up = image.row[:, None] * flown.ifov
    # The plate's middle lies 14 m over the origin, half a metre of thickness before it.
    away = flown.slant_range - 14 * math.sin(math.radians(flown.depression)) - 0.5
    return away * np.sqrt(1 + right**2 + up**2)

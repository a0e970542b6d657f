"""The whole chain: a flight past a ship against the view that it should recover."""

import dataclasses
import math

import numpy as np
import pytest
import trimesh
from flown import CLEAN, flight
from scipy import stats
from scipy.ndimage import binary_erosion

from ncti import ships
from ncti.irar import (
    Correction,
    Pass,
    Window,
    chain,
    correct,
    fly,
    mirror_rotation,
    profile,
    segmented,
    ship_window,
    snapshot,
    true_snapshot,
)
from ncti.irar.chain import FALSE_ALARM, RANGE_FILTERS, STANDS_OUT, nearest_ship_range
from ncti.irar.registration import motion_displacement
from ncti.irar.scene import RAYS, Returns, ScanPlan
from ncti.render import cast_rays

CELLS = 4
HANGAR = 4.0


@pytest.fixture(scope="module")
def roberts():
    return ships.load("roberts")


@pytest.fixture(scope="module")
def flown(roberts):
    """The study's flight past it, near stern, at 3.9 km."""
    return fly(roberts, flight(175.0))


@pytest.fixture(scope="module")
def window(roberts, flown):
    return ship_window(roberts, flown.plan.flight)


@pytest.fixture(scope="module")
def truth(roberts, flown, window):
    return true_snapshot(roberts, flown.plan.flight, window, cells=CELLS)


@pytest.fixture(scope="module")
def true_profile(flown, truth):
    return profile(truth, flown.plan.flight)


@pytest.fixture(scope="module")
def scans(flown):
    """Two scans of it at each of 15, 20 and 30 dB."""
    found = {}
    for decibels in (15, 20, 30):
        at = dataclasses.replace(flown.plan.flight, cnr=10 ** (decibels / 10))
        there = dataclasses.replace(flown, plan=dataclasses.replace(flown.plan, flight=at))
        found[decibels] = [there.record(np.random.default_rng((decibels, n))) for n in range(2)]
    return found


@pytest.fixture(scope="module")
def plate():
    """A flat wall of 70 m by 28 m that faces the line of sight from astern."""
    found = trimesh.creation.box((1.0, 70.0, 28.0))
    found.apply_transform(trimesh.transformations.rotation_matrix(math.radians(6.7), [0, 1, 0]))
    return found.apply_translation((0, 0, 14.0))


def correlation(a, b):
    return np.corrcoef(a, b)[0, 1]


def averaged(snapshot):
    """Means of the cells of each pixel."""
    rows, columns = snapshot.window.rows, snapshot.window.columns
    return snapshot.intensity.reshape(rows, CELLS, columns, CELLS).mean(axis=(1, 3))


def without_hangar(expected):
    """Bins more than 4 m from the highest."""
    return np.abs(np.arange(expected.size) - expected.argmax()) > HANGAR


def measured(scan, window, *, overscanned=True, **how):
    found = correct(scan, Correction(**how), window=window, overscanned=overscanned)
    return profile(segmented(found, scan.flight), scan.flight)


def test_the_wall_faces_the_line_of_sight(plate):
    flown = flight(180.0)
    away = flown.snapshot_axes[2]
    assert np.abs(plate.face_normals @ away).max() == pytest.approx(1, abs=1e-12)


def test_a_noiseless_flight_gives_the_view_of_the_snapshot(flown, window, truth):
    """The image, its energy, and the ranges of what faces the sensor.

    A corrected pixel is the mean of looks spread over it, as are the cells of the truth, but
    looks come from up to 400 m further or nearer: energy to 1 %. A range at a step, or on a deck,
    is that of one of several returns; the faces' are within the tenth of a pixel's slope.
    """
    scan = flown.noiseless()
    image = correct(scan, window=window)
    expected = averaged(truth)
    found = np.nan_to_num(image.intensity)
    assert correlation(found.ravel(), expected.ravel()) > 0.995
    assert found.sum() == pytest.approx(expected.sum(), rel=0.01)
    assert expected[found == 0].sum() < 1e-3 * expected.sum()
    middle = truth.range.reshape(window.rows, CELLS, window.columns, CELLS)
    spread = np.ptp(middle, axis=(1, 3))
    face = spread < 0.5  # NaN where a cell sees none
    assert face.sum() > 100
    off = (image.range - middle.mean(axis=(1, 3)))[face]
    assert np.median(np.abs(off)) < 0.2
    assert np.mean(np.abs(off) < 1) > 0.95


def test_a_noiseless_flight_gives_the_true_profile(flown, window, true_profile):
    found = profile(correct(flown.noiseless(), window=window, overscanned=True), flown.plan.flight)
    beside = without_hangar(true_profile)
    assert correlation(found, true_profile) > 0.99
    assert correlation(found[beside], true_profile[beside]) > 0.98
    assert found.sum() == pytest.approx(true_profile.sum(), rel=0.02)


@pytest.mark.parametrize("decibels", [15, 20, 30])
def test_a_measured_profile_is_the_true_one(decibels, scans, window, true_profile):
    """From 15 dB on 0.95, and 0.90 without the hangar, which alone makes most of the first."""
    beside = without_hangar(true_profile)
    for scan in scans[decibels]:
        found = measured(scan, window)
        assert correlation(found, true_profile) >= 0.95
        assert correlation(found[beside], true_profile[beside]) >= 0.90


@pytest.mark.parametrize("overscanned", [False, True])
def test_clusters_are_better_than_the_median_and_the_mean(scans, window, true_profile, overscanned):
    """At 20 dB, whole and without the hangar, on either scan."""
    beside = without_hangar(true_profile)
    for scan in scans[20]:
        found = [
            measured(scan, window, range_filter=name, overscanned=overscanned)
            for name in RANGE_FILTERS
        ]
        for part in (slice(None), beside):
            cluster, median, mean = (correlation(p[part], true_profile[part]) for p in found)
            assert cluster > median > mean


def test_the_motion_must_be_corrected(scans, window, true_profile):
    """Without the ranges' correction the profile is spread over 300 m; one rate for all of the
    pass does nearly as well as each pixel's. Without the columns' correction masts lean, but what
    they are summed into is the same: a profile hardly tests it."""
    scan = scans[20][0]
    reach = nearest_ship_range(scan)
    by_pixel, by_rate = (
        motion_displacement(scan.flight, scan.time, reach, method=method)[2]
        for method in ("pixel", "constant")
    )
    # The chain adds `by_pixel` to the ranges.
    uncorrected = dataclasses.replace(scan, range=scan.range - by_pixel)
    assert correlation(measured(uncorrected, window), true_profile) < 0.5
    at_one_rate = dataclasses.replace(scan, range=scan.range - by_pixel + by_rate)
    assert correlation(measured(at_one_rate, window), true_profile) > 0.95
    wide = Window(window.bottom, window.left - 60, window.rows, window.columns + 120)
    assert correlation(measured(scan, wide, azimuth="none"), true_profile) > 0.9


def test_a_wrong_belief_of_the_closing_speed_spoils_the_profile(scans, window, true_profile):
    scan = scans[20][0]
    scores = []
    for factor in (1.0, 1.01, 1.02, 1.05):
        belief = dataclasses.replace(scan.flight, aircraft_speed=90.0 * factor)
        found = correct(scan, belief=belief, window=window, overscanned=True)
        scores.append(correlation(profile(segmented(found, scan.flight), belief), true_profile))
    assert scores[0] > 0.95 and scores == sorted(scores, reverse=True)
    assert scores[1] < 0.95 and scores[2] < 0.9 and scores[3] < 0.7


def test_frames_and_delays_gain_the_roots_of_their_numbers(plate):
    """On a flat wall through the whole chain: 5 % over at least 2,000 pixels, 3 standard errors.

    Of pixels with unlike numbers of looks the mean of 1 / N counts. They are more than the lines
    in the time of one pixel's climb, as the tilted lines and the drift lie denser by
    cos L + sin L drift / climb, and samples by what the aircraft has come closer.
    """
    seen = fly(plate, flight(180.0, samples=200, pulse_rate=1e6, cnr=CLEAN))
    scan = seen.record(np.random.default_rng(7))
    image = correct(scan)
    cover = true_snapshot(plate, scan.flight, image.window).infrared == 1
    inner = binary_erosion(cover, iterations=2)
    assert inner.sum() >= 2000
    assert image.looks[inner].min() >= 8
    frames = 1 / np.mean(1 / image.looks[inner])
    lean = math.radians(mirror_rotation(scan.flight.depression))
    denser = math.cos(lean) + math.sin(lean) * scan.flight.drift / scan.flight.climb
    closer = scan.flight.slant_range - scan.flight.closing_speed * 14 / scan.flight.climb
    expected = scan.flight.lines_per_pixel / denser * scan.flight.slant_range / closer
    assert frames == pytest.approx(expected, rel=0.03)

    def snr(values):
        return values.mean() / values.std()

    active = snr(image.intensity[inner])
    assert active == pytest.approx(math.sqrt(frames), rel=0.05)
    raw = seen.noiseless().infrared
    single = raw.max() / scan.flight.nedt
    passive = snr(image.infrared[inner])
    assert passive / single == pytest.approx(math.sqrt(12 * frames), rel=0.05)
    np.testing.assert_array_less(
        np.abs(image.range[inner] - _plane(image, scan.flight)[inner]), 3.0
    )


def _plane(image, flown):
    """Range of a plane across the line of sight through the plate's near side."""
    right = image.column * flown.ifov
    up = image.row[:, None] * flown.ifov
    # The plate's middle lies 14 m over the origin, half a metre of thickness before it.
    away = flown.slant_range - 14 * math.sin(math.radians(flown.depression)) - 0.5
    return away * np.sqrt(1 + right**2 + up**2)


def sea(lines, samples, **changes):
    """A scan of nothing but the sea."""
    seen = flight(samples=samples, pulse_rate=1e9, detectors=1, **changes)
    nothing = Returns((lines, samples), *[np.empty(0, np.intp)] * 2, *[np.empty(0)] * 2, 9)
    return Pass(ScanPlan(seen, 0, lines), nothing).record(np.random.default_rng(1))


@pytest.mark.parametrize("change", [{}, {"pulse_width": 100e-9}, {"threshold": 12.0}])
def test_the_sea_reaches_its_threshold_as_seldom_as_stated(change):
    """Through the whole chain, 70,000 pixels of 1 to 24 looks: binomial, 1e-3 over the cases."""
    scan = sea(400, 2000, **change)
    image = correct(scan, Correction(range_filter="mean"))
    seen = image.looks > 0
    assert seen.sum() > 70_000
    alarms = np.count_nonzero(segmented(image, scan.flight).intensity[seen])
    assert stats.binomtest(alarms, int(seen.sum()), FALSE_ALARM).pvalue > 1e-3 / 3


def test_overscanned_sea_passes_as_seldom_as_pixels_a_row_apart(monkeypatch):
    """Neighbours share looks, each has as many as a pixel: every tenth row is independent.

    At a false-alarm rate of 5 %, for which some 4,000 pixels a tenth of the rows are enough:
    binomial, 1e-3 over the ten.
    """
    monkeypatch.setattr(chain, "FALSE_ALARM", 0.05)
    scan = sea(160, 1000)
    wide = correct(scan, Correction(range_filter="mean")).window
    part = Window(wide.bottom, wide.left + 300, wide.rows, 300)
    image = correct(scan, Correction(range_filter="mean"), window=part, overscanned=True)
    passed = segmented(image, scan.flight).intensity > 0
    for first in range(10):
        seen = image.looks[first::10] > 0
        alarms = np.count_nonzero(passed[first::10][seen])
        assert seen.sum() > 4000
        assert stats.binomtest(alarms, int(seen.sum()), 0.05).pvalue > 1e-3 / 10
    together = np.mean(passed[1:] & passed[:-1]) / np.mean(passed)
    assert together > 0.5


def test_the_sea_around_a_ship_is_cut_away(roberts, flown, scans):
    """Few of the pixels of the sea pass, at the scan's rim too, and none of the ship's bright."""
    found = correct(scans[20][0])
    expected = true_snapshot(roberts, flown.plan.flight, found.window)
    sea = binary_erosion(expected.intensity == 0, iterations=2) & (found.looks > 0)
    cut = segmented(found, flown.plan.flight)
    assert sea.sum() > 5000
    assert np.mean(cut.intensity[sea] > 0) < 2e-3
    assert np.mean(cut.intensity[expected.intensity > 50] > 0) > 0.99
    assert np.isnan(cut.range[cut.intensity == 0]).all()
    higher = segmented(found, flown.plan.flight, threshold=50.0)
    assert (higher.intensity > 0).sum() < (cut.intensity > 0).sum()
    assert higher.intensity[higher.intensity > 0].min() >= 50


def test_overscanned_rows_hold_the_same_power(flown, window):
    scan = flown.noiseless()
    plain, fine = (
        profile(correct(scan, window=window, overscanned=over), scan.flight)
        for over in (False, True)
    )
    assert fine.sum() == pytest.approx(plain.sum(), rel=0.01)
    image = correct(scan, window=window, overscanned=True)
    assert image.intensity.shape == (10 * window.rows, window.columns)
    np.testing.assert_allclose(np.diff(image.row), 0.1)


def test_a_window_only_cuts_out(scans):
    scan = scans[20][0]
    whole = correct(scan)
    part = Window(0, -5, 20, 10)
    found = correct(scan, window=part)
    rows = slice(-whole.window.bottom, -whole.window.bottom + 20)
    columns = slice(-5 - whole.window.left, 5 - whole.window.left)
    for name in ("intensity", "range", "infrared", "looks"):
        expected = getattr(whole, name)[rows, columns]
        # Sums over more columns' deepest pixel are taken in another order.
        np.testing.assert_allclose(getattr(found, name), expected, rtol=1e-14)


def test_a_profile_is_energy_over_range(flown, truth):
    found = profile(truth, flown.plan.flight)
    assert found.shape == (250,)
    assert found.sum() == pytest.approx(truth.intensity.sum() / CELLS**2)
    half = profile(truth, flown.plan.flight, bins=500, bin_width=0.5)
    np.testing.assert_allclose(half.reshape(250, 2).sum(axis=1), found)


@pytest.mark.parametrize("bad", [{"azimuth": "row"}, {"mirror": "x"}, {"range_filter": "mode"}])
def test_bad_corrections_are_named(bad):
    ((name, _),) = bad.items()
    with pytest.raises(ValueError, match=f"^{name} is .*, but must be"):
        Correction(**bad)


def test_no_looks_no_ship(flown):
    """A window that the scan does not reach holds nothing, and is no error."""
    scan = flown.noiseless()
    empty = correct(scan, window=Window(5000, 5000, 4, 4))
    cut = segmented(empty, scan.flight)
    assert (cut.intensity == 0).all() and np.isnan(cut.range).all()


def test_the_sea_moves_as_the_edge_beside_it(flown, scans):
    """Ranges for registration: the ship's own where it is, the nearest of its samples beside it."""
    scan = scans[20][0]
    reach = nearest_ship_range(scan)
    bright = scan.intensity > STANDS_OUT * np.median(scan.intensity)
    np.testing.assert_array_equal(reach[bright], scan.range[bright])
    places = np.argwhere(bright)
    rng = np.random.default_rng(0)
    for line, sample in rng.choice(np.argwhere(~bright), 200):
        apart = ((places - (line, sample)) ** 2).sum(axis=1)
        nearest = places[apart == apart.min()]
        assert reach[line, sample] in scan.range[tuple(nearest.T)]
    dark = dataclasses.replace(scan, intensity=np.ones_like(scan.intensity))
    np.testing.assert_array_equal(nearest_ship_range(dark), scan.range)


def test_overscanned_rows_are_cells_of_the_pixels(roberts, flown, window):
    scan = flown.noiseless()
    fine = correct(scan, window=window, overscanned=True)
    plain = correct(scan, window=window)
    lines = round(scan.flight.lines_per_pixel)
    np.testing.assert_allclose(fine.row.reshape(-1, lines).mean(axis=1), plain.row, atol=1e-12)
    truth = true_snapshot(roberts, scan.flight, window, cells=2)
    np.testing.assert_allclose(truth.row.reshape(-1, 2).mean(axis=1), plain.row, atol=1e-12)
    np.testing.assert_allclose(truth.column.reshape(-1, 2).mean(axis=1), plain.column, atol=1e-12)


def test_a_truth_of_the_wrong_facets_is_refused(roberts, flown, window):
    with pytest.raises(ValueError, match="reflectivity has shape"):
        true_snapshot(roberts, flown.plan.flight, window, reflectivity=np.ones(3))


@pytest.mark.parametrize("cells", [1, 8])
def test_a_look_of_the_truth_is_what_its_rays_meet(roberts, flown, window, cells):
    """Peaks of the mean waveform of 25 rays, cast one look at a time."""
    seen = flown.plan.flight
    whole = true_snapshot(roberts, seen, window, cells=cells)
    part = (np.arange(RAYS) - (RAYS - 1) / 2) / RAYS
    start = seen.position(np.zeros(()))
    rng = np.random.default_rng(cells)
    lit = np.argwhere(whole.infrared > 0)
    for m, n in lit[rng.choice(len(lit), 25, replace=False)]:
        up, right = np.meshgrid(whole.row[m] + part, whole.column[n] + part, indexing="ij")
        ways = np.stack([right * seen.ifov, up * seen.ifov, np.ones_like(up)], axis=-1)
        ways = (ways / np.linalg.norm(ways, axis=-1, keepdims=True)).reshape(-1, 3)
        ways = ways @ seen.snapshot_axes
        hits = cast_rays(roberts, np.broadcast_to(start, ways.shape), ways)
        assert whole.infrared[m, n] == pytest.approx(len(hits.ray) / RAYS**2)
        response = np.exp(-4 * np.subtract.outer(hits.distance, hits.distance) ** 2
                          / seen.pulse_length**2)  # fmt: skip
        total = response.sum(axis=1) / RAYS**2
        assert whole.intensity[m, n] == pytest.approx(seen.cnr * total.max(), rel=1e-5)


def test_a_truth_in_blocks_is_the_truth(roberts, flown, window, monkeypatch):
    seen = flown.plan.flight
    whole = true_snapshot(roberts, seen, window, cells=2)
    monkeypatch.setattr(snapshot, "RAYS_AT_ONCE", 7000)
    parts = true_snapshot(roberts, seen, window, cells=2)
    for name in ("intensity", "range", "infrared"):
        # rays from blocks of other sizes are rounded in another order
        np.testing.assert_allclose(getattr(parts, name), getattr(whole, name), atol=1e-5)

"""Registration maps samples to the snapshot as exact geometry does, in steps and at once."""

import math

import numpy as np
import pytest
from flown import crossing, flight, flights, scanned_at, seen_from
from hypothesis import given
from hypothesis import strategies as st

from ncti.irar import mirror_rotation, registration

SAMPLES = 160
HEIGHTS = np.linspace(6.0, 36.0, 31)
POLE = np.stack([0 * HEIGHTS, 0 * HEIGHTS, HEIGHTS], axis=-1)
ABEAM = np.linspace(-55.0, 55.0, 23)


def level(flown):
    """Return waterline points abeam of the line of sight, which are level in the snapshot."""
    right, _, _ = flown.snapshot_axes
    return ABEAM[:, None] * right


def registered(flown, points, *, mirror="exact", azimuth="pixel"):
    """Return rows and columns by the registration steps of points, where endless lines meet them.

    The steps are smooth, so they are interpolated between samples.
    """
    time = crossing(flown, points)
    along = scanned_at(flown, points, time)[:, 0]
    sample = (along / flown.ifov + (flown.samples - 1) / 2).astype(float)
    assert sample.min() > 0 and sample.max() < flown.samples - 1
    reach = np.linalg.norm(seen_from(flown, points, time), axis=-1).astype(float)
    shape = len(points), flown.samples
    times = np.broadcast_to(time.astype(float)[:, None], shape)
    ranges = np.broadcast_to(reach[:, None], shape)
    numbers = np.arange(flown.samples)
    row, column = (
        np.broadcast_to(places, shape) for places in registration.raw_places(flown, numbers)
    )
    if mirror != "none":
        up, right = registration.mirror_displacement(flown, numbers, form=mirror)
        row, column = row + up, column + right
    row = row + registration.motion_displacement(flown, times, ranges)[0]
    if azimuth != "none":
        column = column + registration.motion_displacement(flown, times, ranges, method=azimuth)[1]

    def at(image):
        return np.array(
            [np.interp(s, numbers, line) for s, line in zip(sample, image, strict=True)]
        )

    return at(row), at(column)


def true_places(flown, points):
    """Return rows, columns and ranges of points in the snapshot, in extended precision."""
    right, up, away = np.moveaxis(seen_from(flown, points, 0.0), -1, 0)
    reach = np.sqrt(right**2 + up**2 + away**2)
    return [
        np.asarray(a, float) for a in (up / away / flown.ifov, right / away / flown.ifov, reach)
    ]


def tilt(row, column, *, upright):
    """Return the tilt of a line [deg]: an upright one to the right, a level one upwards."""
    x, y = (row, column) if upright else (column, row)
    return math.degrees(math.atan(np.polyfit(x, y, 1)[0]))


@given(flights(), st.integers(0, 2**32))
def test_registration_matches_exact_geometry(flown, seed):
    """Compare points at a sample's time and range with extended precision from the speeds alone.

    Coordinates of 30 km rounded in float64 are known to 1e-11 m: rows and columns to 1e-7 pixel.
    Raw place, mirror and motion add up to the whole, also where a range is unknown.
    """
    rng = np.random.default_rng(seed)
    time = rng.uniform(-3, 3, (3, SAMPLES))
    ranges = np.linalg.norm(flown.position(time), axis=-1) + rng.uniform(-100, 100, time.shape)
    ranges[rng.random(time.shape) < 0.1] = np.nan
    known, numbers = ~np.isnan(ranges), np.arange(SAMPLES)
    row, column = registration.raw_places(flown, numbers)
    up, right = registration.mirror_displacement(flown, numbers)
    down, left, closer = registration.motion_displacement(flown, time, ranges)
    places = registration.snapshot_places(flown, time, ranges)
    for steps, whole in zip(
        (row + up + down, column + right + left, ranges + closer), places, strict=True
    ):
        np.testing.assert_allclose(steps, whole, rtol=0, atol=1e-9)
    origin = np.linalg.norm(flown.position(np.zeros(()))) - np.linalg.norm(
        flown.position(time), axis=-1
    )
    np.testing.assert_allclose(closer[~known], origin[~known], atol=1e-9)
    # These are points of the scan: each lies on its line, at its sample.
    angles = np.broadcast_to(flown.scan_angles(numbers), time.shape)
    ways = flown.directions(angles, np.zeros_like(angles))
    points = flown.position(time[known]) + ranges[known][:, None] * ways[known]
    along, across = scanned_at(flown, points, time[known]).astype(float).T
    np.testing.assert_allclose(across, 0, atol=1e-12)
    np.testing.assert_allclose(along, angles[known], atol=1e-12)
    for computed, expected in zip(places, true_places(flown, points), strict=True):
        np.testing.assert_allclose(computed[known], expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize("offset", [5.0, -5.0])
def test_only_per_pixel_shifts_straighten_the_mast(offset):
    """Compare the lean of a mast, 30 m high and 45 m before the ship's origin, with the truth.

    Without a shift it leans by drift over climb, 37 and 42 deg at time 0. One shift leaves some
    degrees, as range and direction change during the pass. A shift per line is exact at the origin
    only: z behind it, it errs by drift z / R, and x beside it by x / R of the closing speed; with
    equal signs these make 1 deg. A shift per pixel leaves no lean.
    """
    flown = flight(175.0, offset, samples=400, pulse_rate=1e6)
    mast = np.stack([45.0 + 0 * HEIGHTS, 0 * HEIGHTS, HEIGHTS], axis=-1)
    upright = tilt(*true_places(flown, mast)[:2], upright=True)
    leans = {
        method: tilt(*registered(flown, mast, azimuth=method), upright=True) - upright
        for method in ("none", "constant", "line", "pixel")
    }
    drift = math.degrees(math.atan(flown.drift / flown.climb))
    assert leans["none"] == pytest.approx(drift, abs=6)
    assert 2 < abs(leans["constant"]) < 6
    x, _, z = flown.snapshot_axes @ [45.0, 0, 0]
    slope = (x * flown.closing_speed - z * flown.drift) / (flown.slant_range * flown.climb)
    assert leans["line"] == pytest.approx(math.degrees(slope), abs=0.3)
    if offset == 5:
        assert leans["line"] == pytest.approx(-1, abs=0.3)
    assert abs(leans["pixel"]) < 1e-3


@pytest.mark.parametrize("depression", [6.7, 15.0])
@pytest.mark.parametrize("mirror_angle", [45.0, 35.0])
def test_shear_corrects_mast_and_waterline_unlike_rotation(depression, mirror_angle):
    """Lines lean by L: x of a level line spans x / cos L of samples and x tan L of climb.

    Uncorrected, the waterline rises by sin |L| per sample and the mast is upright. The exact shear
    corrects both. A rotation by L levels the waterline up to L^3 / 2 but tilts the mast. The
    printed shear leaves tan L_printed - sin L per sample: zero at 45 deg, where its small-angle
    form happens to equal the sine.
    """
    kind = {"samples": 400, "pulse_rate": 1e6, "slant_range": 20_000.0, "ifov": 4e-5}
    flown = flight(
        175.0, 0.0, ship_speed=0.0, depression=depression, mirror_angle=mirror_angle, **kind
    )
    lean, printed = (
        math.radians(mirror_rotation(depression, mirror_angle=mirror_angle, form=form))
        for form in ("exact", "printed")
    )
    sine, tangent = math.sin(-lean), math.tan(-lean)
    expected = {
        "none": (0, sine),
        "exact": (0, 0),
        "printed": (0, math.tan(printed) - math.sin(lean)),
        "rotation": (tangent, (sine - tangent) / (1 + sine * tangent)),
    }
    water = level(flown)
    for step, slopes in expected.items():
        for points, upright, slope in zip((POLE, water), (True, False), slopes, strict=True):
            row, column = registered(flown, points, mirror="none" if step == "rotation" else step)
            if step == "rotation":
                row, column = registration.rotate(row, column, clockwise=-math.degrees(lean))
            leaning = tilt(row, column, upright=upright)
            assert leaning == pytest.approx(math.degrees(math.atan(slope)), abs=0.05), step
    if mirror_angle == 45:
        assert expected["printed"][1] == pytest.approx(0, abs=1e-12)

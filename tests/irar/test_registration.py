"""Registration: where static points land, step by step and all at once, and what is left over."""

import math

import numpy as np
import pytest
from flown import crossing, flight, scanned_at, seen_from
from hypothesis import given
from hypothesis import strategies as st

from ncti.irar import Course, azimuth_shift, mirror_rotation, registration

SAMPLES = 160
HEIGHTS = np.linspace(6.0, 36.0, 31)
POLE = np.stack([0 * HEIGHTS, 0 * HEIGHTS, HEIGHTS], axis=-1)
ABEAM = np.linspace(-55.0, 55.0, 23)


@st.composite
def flights(draw):
    """Passes of any heading that scan a little beside the ship."""
    offset = draw(st.floats(-20, 20))
    return flight(
        aspect=draw(st.floats(0, 360)),
        offset=offset,
        slant_range=draw(st.floats(1500, 30_000)),
        depression=draw(st.floats(2, 25)),
        aircraft_speed=draw(st.floats(60, 250)),
        ship_speed=draw(st.floats(0, 15)),
        aircraft_heading=draw(st.floats(-180, 180)),
        pointing=offset + draw(st.floats(-1, 1)),
        mirror_angle=draw(st.floats(20, 60)),
        samples=SAMPLES,
    )


def level(flown):
    """Points of the waterline that lie level in the snapshot, abeam of the line of sight."""
    right, _, _ = flown.snapshot_axes
    return ABEAM[:, None] * right


def registered(flown, points, *, mirror="exact", azimuth="pixel"):
    """Rows and columns that the steps give to points where endless lines meet them.

    Between samples the steps are interpolated: they are smooth.
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
    """Rows, columns and ranges in the snapshot, in extended precision."""
    right, up, away = np.moveaxis(seen_from(flown, points, 0.0), -1, 0)
    reach = np.sqrt(right**2 + up**2 + away**2)
    return [
        np.asarray(a, float) for a in (up / away / flown.ifov, right / away / flown.ifov, reach)
    ]


def tilt(row, column, *, upright):
    """Lean of a straight line [deg]: to the right of an upright one, rising of a level one."""
    x, y = (row, column) if upright else (column, row)
    return math.degrees(math.atan(np.polyfit(x, y, 1)[0]))


@given(flights(), st.integers(0, 2**32))
def test_the_steps_add_up_to_the_whole(flown, seed):
    """Raw place, mirror and motion, to rounding: of 1e5 columns, 1e-10."""
    rng = np.random.default_rng(seed)
    time = rng.uniform(-3, 3, (4, SAMPLES))
    ranges = flown.slant_range + rng.uniform(-150, 150, time.shape)
    ranges[rng.random(time.shape) < 0.1] = np.nan
    numbers = np.arange(SAMPLES)
    places = registration.snapshot_places(flown, time, ranges)
    row, column = registration.raw_places(flown, numbers)
    up, right = registration.mirror_displacement(flown, numbers)
    down, left, closer = registration.motion_displacement(flown, time, ranges)
    np.testing.assert_allclose(row + up + down, places[0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(column + right + left, places[1], rtol=0, atol=1e-9)
    np.testing.assert_allclose(ranges + closer, places[2], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(np.isnan(places[2]), np.isnan(ranges))
    assert not np.isnan(places[0]).any() and not np.isnan(closer).any()


@given(flights(), st.integers(0, 2**32))
def test_points_land_where_the_snapshot_sees_them(flown, seed):
    """What a sample meets, by its time and range, against extended precision from speeds alone.

    Coordinates of 30 km rounded in float64 are known to 1e-11 m: rows and columns to 1e-7 pixel.
    """
    rng = np.random.default_rng(seed)
    time = rng.uniform(-3, 3, (3, SAMPLES))
    ranges = np.linalg.norm(flown.position(time), axis=-1) + rng.uniform(-100, 100, time.shape)
    row, column, there = registration.snapshot_places(flown, time, ranges)
    angles = flown.scan_angles(np.arange(SAMPLES))
    ways = flown.directions(angles, np.zeros(SAMPLES))
    points = flown.position(time) + ranges[..., None] * ways
    # These are points of the scan: each lies on its line, at its sample.
    angles_seen = scanned_at(flown, points, time)
    np.testing.assert_allclose(angles_seen[..., 1].astype(float), 0, atol=1e-12)
    np.testing.assert_allclose(
        angles_seen[..., 0].astype(float), np.broadcast_to(angles, time.shape), atol=1e-12
    )
    for computed, expected in zip((row, column, there), true_places(flown, points), strict=True):
        np.testing.assert_allclose(computed, expected, rtol=0, atol=1e-6)


@given(flights())
def test_one_shift_is_the_derivative_of_the_exact_one(flown):
    """Of the ship's origin, by central differences over 2 ms in extended precision.

    The equation is that of a shift per scan with the line rate; `constant` uses it.
    """
    step = 1e-3
    before, after = (seen_from(flown, np.zeros(3), t) for t in (-step, step))
    moved = (after[0] / after[2] - before[0] / before[2]) / flown.ifov / (2 * step)
    shift_of_a_scan = float(moved) / flown.line_rate
    courses = (
        Course(flown.aircraft_speed, flown.aircraft_heading),
        Course(flown.ship_speed, flown.ship_heading),
    )
    geometry = {name: getattr(flown, name) for name in ("offset", "slant_range", "ifov")}
    shift = azimuth_shift(*courses, **geometry, rate=flown.line_rate)
    scale = (flown.aircraft_speed + flown.ship_speed) / (flown.pixel * flown.line_rate)
    assert shift == pytest.approx(shift_of_a_scan, abs=1e-5 * scale)
    rows = azimuth_shift(*courses, **geometry, rate=flown.line_rate, scans=flown.lines_per_pixel)
    assert rows == pytest.approx(shift * flown.lines_per_pixel)
    # With a pulse rate that just serves the scan it is too small by the samples of a line.
    pulses = azimuth_shift(*courses, **geometry, rate=flown.line_rate * flown.samples)
    assert pulses * flown.samples == pytest.approx(shift)
    time = np.full((1, SAMPLES), 2.0)
    column = registration.motion_displacement(flown, time, time, method="constant")[1]
    # offset is heading and offset less track there, rounded: 360 deg times eps, of the speeds
    rounding = 1e-12 * scale * flown.line_rate * 2.0
    np.testing.assert_allclose(column, -shift * flown.line_rate * 2.0, atol=rounding)


@pytest.mark.parametrize("offset", [5.0, -5.0])
def test_a_mast_is_straight_with_each_pixels_shift_only(offset):
    """Of a mast 30 m high and 45 m before the ship's origin: its lean against the truth.

    None: the drift over the climb, 37 and 42 deg at time 0. One shift: some degrees, as range and
    direction change while the ship passes. Each line's: that of the origin, which z behind it is
    too large by drift z / R, and leaves x beside it the closing speed's x / R; with the two of one
    sign 1 deg. Each pixel's: nothing.
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
def test_a_shear_mends_both_and_a_rotation_the_waterline_only(depression, mirror_angle):
    """Lines lean by L, so that x of a level line takes x / cos L of samples and x tan L of climb.

    Raw, the waterline rises by sin |L| a sample and the mast stands. The shear by the exact
    reflection mends both; turned by L as a whole the waterline is level but for L^3 / 2, and the
    mast leans. The printed shear leaves tan L_printed - sin L a sample: nothing at 45 deg, where
    its small-angle form happens to be the sine.
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


def test_a_track_beside_the_heading_is_what_moves_the_aircraft():
    """The printed equation with the track for the heading: the drift across the line of sight."""
    crabbing = flight(aircraft_track=3.0)
    time = np.array([[0.0, 1.0]])
    _, column, _ = registration.motion_displacement(
        crabbing, time, np.full((1, 2), np.nan), method="constant"
    )
    assert -column[0, 1] * crabbing.pixel == pytest.approx(crabbing.drift)
    assert abs(crabbing.drift - flight().drift) > 4  # 90 m/s times the sine of 3 deg

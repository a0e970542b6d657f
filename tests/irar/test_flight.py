"""Flights give correct positions, angles and rates, and refuse impossible geometry."""

import dataclasses
import math

import numpy as np
import pytest
from flown import flight, scanned_at, seen_from
from hypothesis import given
from hypothesis import strategies as st

from ncti.irar import Flight

angles = st.floats(-180, 180)
POINTS = np.array([(60.0, 0, 0), (-60.0, 7, 3), (0.0, 0, 40), (0.0, -7, 0)])


@st.composite
def flights(draw):
    """Draw passes of any headings that close on the ship."""
    return flight(
        aspect=draw(st.floats(0, 360)),
        offset=draw(st.floats(-40, 40)),
        slant_range=draw(st.floats(1e3, 1e5)),
        depression=draw(st.floats(1, 40)),
        aircraft_speed=draw(st.floats(60, 250)),
        ship_speed=draw(st.floats(0, 18)),
        aircraft_heading=draw(angles),
    )


@given(flights())
def test_the_aircraft_is_seen_where_aspect_and_depression_say(flown):
    """The direction is (cos d cos a, cos d sin a, sin d) in the ship frame at time 0."""
    a, d = math.radians(flown.aspect), math.radians(flown.depression)
    towards = np.array([math.cos(d) * math.cos(a), math.cos(d) * math.sin(a), math.sin(d)])
    position = flown.position(np.zeros(()))
    np.testing.assert_allclose(position, flown.slant_range * towards, rtol=0, atol=1e-9)
    np.testing.assert_allclose(flown.snapshot_axes[2], -towards, rtol=0, atol=1e-13)
    right = np.array([-math.sin(a), math.cos(a), 0])
    np.testing.assert_allclose(flown.snapshot_axes[0], right, rtol=0, atol=1e-13)
    np.testing.assert_allclose(flown.snapshot_axes[1], np.cross(towards, right), atol=1e-13)


@given(flights())
def test_speeds_are_the_derivatives_of_what_is_seen(flown):
    """Closing speed, drift and climb match central differences over 2 ms, to (v h / R)^2."""
    step = 1e-3
    before, after = (seen_from(flown, np.zeros(3), t) for t in (-step, step))

    def horizontal(p):
        d = math.radians(flown.depression)
        return p[2] * math.cos(d) + p[1] * math.sin(d)

    closing = float((horizontal(before) - horizontal(after)) / (2 * step))
    drift = float((after[0] - before[0]) / (2 * step))
    # Up in the image by angle: the ship sinks as the lines climb it.
    sinking = [p[1] / p[2] * flown.slant_range for p in (before, after)]
    climb = float((sinking[0] - sinking[1]) / (2 * step))
    size = flown.aircraft_speed + flown.ship_speed
    assert flown.closing_speed == pytest.approx(closing, abs=1e-9 * size)
    assert flown.drift == pytest.approx(drift, abs=1e-9 * size)
    assert flown.climb == pytest.approx(climb, abs=1e-5 * size)


@given(flights(), st.floats(-8, 8), st.floats(10, 70), st.floats(-3, 3))
def test_angles_to_points_are_those_of_the_scanner(flown, time, mirror_angle, aside):
    """Compare with axes turned by hand in extended precision, and map back to the same points."""
    flown = dataclasses.replace(flown, mirror_angle=mirror_angle, pointing=flown.offset + aside)
    along, across = flown.angles_to(POINTS, np.array(time))
    expected = scanned_at(flown, POINTS, time).astype(float)
    np.testing.assert_allclose(np.stack([along, across], axis=-1), expected, rtol=0, atol=1e-12)
    away = POINTS - flown.position(np.array(time))
    away /= np.linalg.norm(away, axis=-1, keepdims=True)
    np.testing.assert_allclose(flown.directions(along, across), away, rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    "opening",
    [{"offset": 90.0}, {"offset": 180.0}, {"aircraft_speed": 5.0}, {"aircraft_track": 200}],
)
def test_a_ship_that_opens_is_refused(opening):
    with pytest.raises(ValueError, match=r"aircraft_speed is .* now opens at [\d.]+ m/s$"):
        Flight(slant_range=3900.0, ship_heading=10.0, **opening)

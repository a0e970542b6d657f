"""Flights give correct positions, angles and rates, and refuse impossible geometry."""

import math

import numpy as np
import pytest
from flown import flights, seen_from
from hypothesis import given

from ncti.irar import Flight
from ncti.irar.registration import azimuth_shift, motion_displacement


@given(flights())
def test_aircraft_position_matches_aspect_and_depression(flown):
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
def test_apparent_speeds_match_finite_differences(flown):
    """Closing speed, drift and climb match central differences over 2 ms, to (v h / R)^2.

    The printed shift of a line is the drift in pixels, and the method `constant` takes it.
    """
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
    shift = azimuth_shift(flown, flown.slant_range, rate=flown.line_rate)
    assert shift * flown.pixel * flown.line_rate == pytest.approx(drift, abs=1e-5 * size)
    time = np.full((1, flown.samples), 2.0)
    column = motion_displacement(flown, time, time, method="constant")[1]
    np.testing.assert_allclose(column * flown.pixel, -2 * drift, atol=2e-5 * size)


@pytest.mark.parametrize(
    "opening",
    [{"offset": 90.0}, {"offset": 180.0}, {"aircraft_speed": 5.0}, {"aircraft_track": 200}],
)
def test_geometry_with_opening_range_is_refused(opening):
    with pytest.raises(ValueError, match=r"aircraft_speed is .* now opens at [\d.]+ m/s$"):
        Flight(slant_range=3900.0, ship_heading=10.0, **opening)

"""Autofocus estimates the closing speed from upright faces, close to the true speed."""

from dataclasses import replace

import numpy as np
import pytest
from flown import flight
from trimesh.creation import box

from ncti import ships
from ncti.checks import NothingSeenError
from ncti.irar import autofocus, correct, fly, profile, segmented, ship_window, true_snapshot
from ncti.irar.autofocus import SLOPE_HEIGHT, SMOOTHING, closing_per_speed, slope_spectrum


def navigated(flown, error):
    """Return the flight with a relative error in its closing speed."""
    change = error * flown.closing_speed / closing_per_speed(flown)
    return replace(flown, aircraft_speed=flown.aircraft_speed + change)


def closing_error(estimate, flown):
    return estimate.closing_speed / flown.closing_speed - 1


def test_spectrum_of_one_slope_is_the_kernel():
    slope, count = slope_spectrum(np.array([0.25]), steepest=1.0)
    # counted in steps of 0.01: half a step of the kernel's steepest flank, exp(-1/2) / WIDTH
    assert (
        np.abs(count - np.exp(-(((slope - 0.25) / SMOOTHING) ** 2) / 2)).max() < 0.005 / SMOOTHING
    )
    assert slope[0] == pytest.approx(-1) and slope[-1] == pytest.approx(1)


@pytest.mark.parametrize(
    ("aspect", "errors"),
    [(90, (-0.01, 0.05)), (150, (-0.05,))],
)
def test_a_block_with_upright_sides_gives_its_closing_speed(aspect, errors):
    block = box((100, 16, 20)).apply_translation((0, 0, 10))
    scan = fly(block, flight(aspect=aspect, samples=260, pulse_rate=31e3)).noiseless()
    flown = scan.flight
    # Half a step of the spectrum, 0.005 m/m, and as much for the line spacing at the end of a
    # face. Looks are placed to a quarter of a column, which tilts a face seen obliquely.
    aside = abs((aspect + 45) % 90 - 45)
    turned = 0.25 * flown.pixel * np.tan(np.radians(aside)) / SLOPE_HEIGHT
    slope = 2 * 0.005 + turned
    for error in errors:
        estimate = autofocus(scan, navigated(flown, error))
        assert abs(closing_error(estimate, flown)) < slope * flown.climb / flown.closing_speed


@pytest.mark.parametrize(
    ("name", "aspect", "errors"),
    [("roberts", 175, [-0.05]), ("duncan", 90, [0.05])],
)
def test_most_of_an_error_of_five_per_cent_is_recovered(name, aspect, errors):
    mesh = ships.load(name)
    flown = fly(mesh, flight(aspect=aspect, samples=300, pulse_rate=36e3))
    window = ship_window(mesh, flown.plan.flight)
    truth = profile(true_snapshot(mesh, flown.plan.flight, window), flown.plan.flight)
    scan = flown.record(np.random.default_rng(5))

    def likeness(estimate):
        image = segmented(
            correct(scan, estimate=estimate, window=window, overscanned=True), estimate
        )
        return np.corrcoef(profile(image, flown.plan.flight), truth)[0, 1]

    for error in errors:
        estimate = navigated(flown.plan.flight, error)
        focused = autofocus(scan, estimate)
        assert abs(closing_error(focused, flown.plan.flight)) < 0.5 * abs(error)
        assert likeness(focused) > likeness(estimate) + 0.1


def test_what_is_refused():
    block = box((20, 16, 10)).apply_translation((0, 0, 5))
    flown = fly(block, flight()).plan.flight
    scan = fly(block, flown).noiseless()
    with pytest.raises(ValueError, match="reach is 0, but must be"):
        autofocus(scan, flown, reach=0)
    with pytest.raises(NothingSeenError, match=r"shows nothing 3\.2 m high"):
        autofocus(replace(scan, intensity=np.zeros_like(scan.intensity)), flown)

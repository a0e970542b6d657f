"""Autofocus estimates the closing speed from upright faces, close to the true speed."""

from dataclasses import replace

import numpy as np
import pytest
from flown import flight
from trimesh.creation import box

from ncti.checks import NothingSeenError
from ncti.irar import autofocus, fly
from ncti.irar.autofocus import SLOPE_HEIGHT, SMOOTHING, closing_per_speed, slope_spectrum


def navigated(flown, error):
    """Return the flight with a relative error in its closing speed."""
    change = error * flown.closing_speed / closing_per_speed(flown)
    return replace(flown, aircraft_speed=flown.aircraft_speed + change)


def test_spectrum_of_one_slope_is_the_kernel():
    slope, count = slope_spectrum(np.array([0.25]), steepest=1.0)
    # counted in steps of 0.01: half a step of the kernel's steepest flank, exp(-1/2) / WIDTH
    assert (
        np.abs(count - np.exp(-(((slope - 0.25) / SMOOTHING) ** 2) / 2)).max() < 0.005 / SMOOTHING
    )
    assert slope[0] == pytest.approx(-1) and slope[-1] == pytest.approx(1)


@pytest.mark.parametrize(("aspect", "error"), [(90, 0.05), (150, -0.05)])
def test_autofocus_recovers_closing_speed_of_a_block(aspect, error):
    block = box((100, 16, 20)).apply_translation((0, 0, 10))
    scan = fly(block, flight(aspect=aspect, samples=260, pulse_rate=31e3)).noiseless()
    flown = scan.flight
    # Half a step of the spectrum, 0.005 m/m, and as much for the line spacing at the end of a
    # face. Looks are placed to a quarter of a column, which tilts a face seen obliquely.
    aside = abs((aspect + 45) % 90 - 45)
    turned = 0.25 * flown.pixel * np.tan(np.radians(aside)) / SLOPE_HEIGHT
    slope = 2 * 0.005 + turned
    estimate = autofocus(scan, navigated(flown, error))
    left = estimate.closing_speed / flown.closing_speed - 1
    assert abs(left) < slope * flown.climb / flown.closing_speed


def test_empty_scan_is_refused():
    block = box((20, 16, 10)).apply_translation((0, 0, 5))
    scan = fly(block, flight()).noiseless()
    with pytest.raises(NothingSeenError, match=r"shows nothing 3\.2 m high"):
        autofocus(replace(scan, intensity=np.zeros_like(scan.intensity)), scan.flight)

"""The source's own chain beside ours: what its order and its equations leave behind."""

import numpy as np
import pytest
from flown import flight, pole_on_box

from ncti.irar import (
    correct,
    correct_as_printed,
    fly,
    mirror_rotation,
    ship_window,
    tilts,
    true_snapshot,
)

MARGIN = 40  # pixels around the ship, wider than any lean leaves it


@pytest.fixture(scope="module")
def leaning():
    """A pole on a box from 5 deg off the stern: scan, window, and the truth."""
    mesh = pole_on_box(120, 14, 10, 25)
    scan = fly(mesh, flight(samples=220, pulse_rate=30e3)).noiseless()
    window = ship_window(mesh, scan.flight, margin=MARGIN)
    return scan, window, true_snapshot(mesh, scan.flight, window, cells=4), mesh


def likeness(image, truth):
    fine = truth.infrared.reshape(image.infrared.shape[0], 4, -1, 4).mean(axis=(1, 3))
    return np.corrcoef(np.nan_to_num(image.infrared).ravel(), fine.ravel())[0, 1]


def test_turning_leans_the_mast_by_the_mirror(leaning):
    """The waterline is level, the mast is not: by the mirror's angle, and what shifts leave."""
    scan, window, truth, _ = leaning
    ours, printed = correct(scan, window=window), correct_as_printed(scan, window=window)
    lean = -mirror_rotation(scan.flight.depression)
    assert abs(tilts(ours.infrared, truth.infrared).mast) < 0.1
    # shifts with each row's range and the offset of time 0: a degree or two remain
    assert tilts(printed.infrared, truth.infrared).mast == pytest.approx(lean, abs=3)
    assert likeness(ours, truth) > 0.99 > likeness(printed, truth)


def test_the_pulse_rate_shifts_nothing(leaning):
    """With f the pulse rate the shift is as many times smaller as pulses go to a line."""
    scan, window, truth, _ = leaning
    lines = correct_as_printed(scan, window=window)
    pulses = correct_as_printed(scan, window=window, rate="pulse")
    drift = np.degrees(np.arctan(scan.flight.drift / scan.flight.climb))
    more = tilts(pulses.infrared, truth.infrared).mast - tilts(lines.infrared, truth.infrared).mast
    assert more == pytest.approx(drift, abs=8)
    assert likeness(pulses, truth) < likeness(lines, truth)


def test_a_still_level_scene_is_the_same_in_either_order():
    """No drift and 1 deg of lean: hardly anything to shift or turn, and both give the truth."""
    mesh = pole_on_box(120, 40, 40, 40, 10)
    seen = flight(offset=0.0, aspect=180.0, depression=1.0, slant_range=20e3, line_rate=14.0)
    scan = fly(mesh, seen).noiseless()
    window = ship_window(mesh, scan.flight)
    ours, printed = correct(scan, window=window), correct_as_printed(scan, window=window)
    truth = true_snapshot(mesh, scan.flight, window, cells=4)
    lean = tilts(printed.infrared, truth.infrared)
    # The turn is the mirror's 1 deg; averaged rows lie up to half a pixel from those they fill.
    half = np.degrees(np.arctan(0.5 / window.rows))
    assert lean.mast == pytest.approx(1.0, abs=half + 0.2)
    assert abs(tilts(ours.infrared, truth.infrared).mast) < 0.2


def test_looks_are_lines_averaged(leaning):
    scan, window, _, _ = leaning
    found = correct_as_printed(scan, window=window)
    lines = round(scan.flight.lines_per_pixel)
    assert set(np.unique(found.looks % lines)) == {0}


def test_other_rates_are_refused(leaning):
    with pytest.raises(ValueError, match="rate is 'prf', but must be one of line, pulse"):
        correct_as_printed(leaning[0], rate="prf")


def test_a_pointing_is_an_angle():
    """From 355 deg to -5 are none."""
    mesh = pole_on_box()
    flown = [fly(mesh, flight(offset=-5.0, pointing=turn)) for turn in (-5.0, 355.0)]
    window = ship_window(mesh, flown[0].plan.flight)
    images = [correct_as_printed(one.noiseless(), window=window).intensity for one in flown]
    assert np.nansum(images[0]) > 0
    np.testing.assert_allclose(images[1], images[0], rtol=1e-6)

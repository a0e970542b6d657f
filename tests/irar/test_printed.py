"""The article's correction chain leaves the mast leaning that our chain sets upright."""

import numpy as np
import pytest
from flown import flight, pole_on_box

from ncti import irar

MARGIN = 40  # pixels around the ship, wider than any lean


@pytest.fixture(scope="module")
def leaning():
    """Return scan, window, truth and mesh of a pole on a box seen 5 deg off the stern."""
    mesh = pole_on_box(120, 14, 10, 25)
    scan = irar.fly(mesh, flight(samples=220, pulse_rate=30e3)).noiseless()
    window = irar.ship_window(mesh, scan.flight, margin=MARGIN)
    return scan, window, irar.true_snapshot(mesh, scan.flight, window, cells=4), mesh


def likeness(image, truth):
    fine = truth.infrared.reshape(image.infrared.shape[0], 4, -1, 4).mean(axis=(1, 3))
    return np.corrcoef(np.nan_to_num(image.infrared).ravel(), fine.ravel())[0, 1]


def test_printed_chain_tilts_mast_by_mirror_rotation(leaning):
    """The printed chain leaves the mast leaning by the mirror's angle, within 3 deg."""
    scan, window, truth, _ = leaning
    ours, printed = irar.correct(scan, window=window), irar.correct_as_printed(scan, window=window)
    lean = -irar.mirror_rotation(scan.flight.depression)
    assert abs(irar.tilts(ours.infrared, truth.infrared).mast) < 0.1
    # the printed shifts use each row's range and the offset of time 0: a degree or two remain
    assert irar.tilts(printed.infrared, truth.infrared).mast == pytest.approx(lean, abs=3)
    assert likeness(ours, truth) > 0.99 > likeness(printed, truth)


def test_pulse_rate_leaves_the_drift_uncorrected(leaning):
    """With f the pulse rate the shift is divided by the pulses of a line, so the drift remains."""
    scan, window, truth, _ = leaning
    lines = irar.correct_as_printed(scan, window=window)
    pulses = irar.correct_as_printed(scan, window=window, rate="pulse")
    drift = np.degrees(np.arctan(scan.flight.drift / scan.flight.climb))
    more = (
        irar.tilts(pulses.infrared, truth.infrared).mast
        - irar.tilts(lines.infrared, truth.infrared).mast
    )
    assert more == pytest.approx(drift, abs=8)
    assert likeness(pulses, truth) < likeness(lines, truth)

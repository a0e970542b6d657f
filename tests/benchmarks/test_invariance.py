"""The invariance report, run small."""

import numpy as np
import pytest

from benchmarks import __main__ as command
from benchmarks import invariance
from benchmarks.invariance import BILINEAR, NEAREST, Change, coverage


@pytest.fixture(scope="module")
def report():
    return invariance.measure(repeats=2, ships=("duncan",), aspects=(45.0, 90.0))


def test_every_mask_and_change_has_both_maps(report):
    changes = [
        invariance.SHIFT,
        invariance.SCALE,
        invariance.ANGLE,
        invariance.ANGLE_BEST,
        invariance.ALL_BEST,
    ]
    assert [(row["mask"], row["change"]) for row in report.rows] == [
        (pixels.name, change) for pixels in invariance.PIXELS for change in changes
    ]
    for row in report.rows:
        for kind in (NEAREST, BILINEAR):
            assert row[kind].n == 4
            assert 0 <= row[kind].low <= row[kind].median <= row[kind].high <= 1


def test_same_seed_gives_the_same_table(report):
    again = invariance.measure(repeats=2, ships=("duncan",), aspects=(45.0, 90.0))
    assert again.rows == report.rows


def test_command_prints_it(monkeypatch, report, capsys):
    monkeypatch.setitem(command.REPORTS, "invariance", lambda asked: report)
    command.main(["invariance"])
    printed = capsys.readouterr().out
    assert invariance.SENSOR.name in printed
    assert "…" not in printed  # nothing is cut off at 100 columns


def square(side, pixel=invariance.POINT):
    """Points of a square, about the origin."""
    line = (np.arange(round(side / pixel)) + 0.5) * pixel - side / 2
    return np.stack([values.ravel() for values in np.meshgrid(line, line)])


def test_coverage_keeps_the_area_whatever_the_change():
    # Only the clipping at full pixels loses any: a lattice of 4 points a metre, turned, puts at
    # most a row too many into a pixel, and as many too few into the next.
    change = Change(shift=(0.3, 0.8), scale=2.0, angle=30.0)
    area = coverage(square(20.0), side=1.0, change=change).sum()
    assert 0.93 * 1600 < area <= 1600


def test_coverage_of_a_square_is_exact():
    expected = np.ones((5, 5))
    expected[[0, -1]] *= 0.5
    expected[:, [0, -1]] *= 0.5
    np.testing.assert_allclose(
        coverage(square(4.0), side=1.0, change=Change(shift=(0.5, 0.5))), expected
    )
    np.testing.assert_array_equal(coverage(square(4.0), side=1.0), np.ones((4, 4)))


def test_drawn_changes_stay_in_their_ranges():
    rng = np.random.default_rng(0)
    for change in (Change.drawn(rng) for _ in range(200)):
        assert 0 <= min(change.shift) <= max(change.shift) < 1
        assert 0.5 <= change.scale <= 2
        assert 0 <= change.angle < 360

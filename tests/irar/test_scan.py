"""A scan as it is recorded: trailing detectors, what averaging gains, jitter, and its metadata."""

import math

import numpy as np
import pytest
from flown import flight

from ncti.infrared import band_contrast
from ncti.irar import fly
from ncti.irar.scan import draw_attitude_errors
from ncti.irar.scene import ScanPlan, plan_scan, scan_scene


def test_detectors_trail_each_other_over_the_ship(ship, flown):
    """Detector k sees at sample j the column j - k, before the first sample as well."""
    scan = flown.noiseless()
    plan = flown.plan
    assert scan.infrared.shape == (12, plan.lines, 120)
    coverage = scan_scene(ship, plan, leading=11).coverage()
    warmth = band_contrast(plan.flight.slant_range)
    expected = coverage * warmth
    for k in range(12):
        columns = np.arange(120) - k + 11
        np.testing.assert_allclose(scan.infrared[k], expected[:, columns], rtol=1e-6)
    np.testing.assert_array_equal(scan.infrared[5, :, 5:], scan.infrared[0, :, :-5])
    assert scan.infrared[0].max() == pytest.approx(warmth, rel=1e-6)


@pytest.mark.parametrize("jitter_time", [0.004, 0.1, 10.0])
def test_attitude_wanders_as_a_markov_sequence(jitter_time):
    """20,000 lines: deviation and correlation of neighbours, with 4 of their standard errors."""
    flown_ = flight(jitter=2e-4, jitter_time=jitter_time)
    errors = draw_attitude_errors(ScanPlan(flown_, 0, 20_000), np.random.default_rng(2))
    correlation = math.exp(-1 / (119.0 * jitter_time))
    independent = 20_000 * (1 - correlation) / (1 + correlation)
    assert (errors**2).mean() == pytest.approx((2e-4) ** 2, rel=4 * math.sqrt(1 / independent))
    innovation = errors[1:] - correlation * errors[:-1]
    expected = (2e-4) ** 2 * (1 - correlation**2)
    assert (innovation**2).mean() == pytest.approx(expected, rel=4 * math.sqrt(1 / 20_000))
    level = 4 / math.sqrt(20_000)
    for a, b in ((innovation[1:], innovation[:-1]), (innovation[:, 0], innovation[:, 1])):
        assert abs((a * b).mean()) < level * expected


def test_jitter_moves_whole_lines(ship):
    """Of a pole its column moves by the error to the right, over the IFOV, line by line."""
    calm = fly(ship, flight(175.0))
    plan = plan_scan(ship, flight(175.0, jitter=3e-4, jitter_time=0.02))
    errors = draw_attitude_errors(plan, np.random.default_rng(6))
    shaken = fly(ship, flight(175.0, jitter=3e-4, jitter_time=0.02), rng=np.random.default_rng(6))
    columns = np.arange(plan.flight.samples)

    def column(flown_, number):
        coverage = flown_.returns.drop_leading(11).coverage()[number - flown_.plan.first]
        return (coverage * columns).sum() / coverage.sum() if 0 < coverage.sum() < 3 else math.nan

    numbers = np.arange(calm.plan.first, calm.plan.first + calm.plan.lines)
    moved = np.array([column(shaken, n) - column(calm, n) for n in numbers])
    expected = -errors[numbers - plan.first, 0] / plan.flight.ifov
    known = ~np.isnan(moved)
    assert known.sum() > 100
    # A third of a pixel is resolved; an error upward moves what a leaning pole shows a little.
    assert np.abs(moved - expected)[known].max() < 0.7
    assert np.corrcoef(moved[known], expected[known])[0, 1] > 0.98

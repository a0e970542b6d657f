"""A recorded scan has trailing detectors and Markov attitude jitter of whole lines."""

import math

import numpy as np
import pytest
from flown import flight

from ncti.infrared import band_contrast
from ncti.irar import fly
from ncti.irar.scan import draw_attitude_errors
from ncti.irar.scene import ScanPlan, scan_scene


def test_each_detector_lags_by_one_sample(ship, flown):
    """Detector k sees column j - k at sample j, also before the first sample."""
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
def test_attitude_errors_form_a_markov_sequence(jitter_time):
    """Deviation and lag-one correlation of 20,000 lines are within 4 standard errors."""
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


def test_fly_applies_the_drawn_attitude_errors(ship):
    """A pass has the returns of its plan with the attitude errors that its generator draws."""
    shaken = flight(175.0, jitter=3e-4, jitter_time=0.02)
    passed = fly(ship, shaken, rng=np.random.default_rng(6))
    errors = draw_attitude_errors(passed.plan, np.random.default_rng(6))
    expected = scan_scene(ship, passed.plan, leading=11, attitude=errors)
    for name, values in vars(expected).items():
        np.testing.assert_array_equal(getattr(passed.returns, name), values, err_msg=name)

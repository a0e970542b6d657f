"""Goodness of fit agrees with the chi-squared distribution and with samples of templates."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2, kstest

from ncti.classify import GaussianTemplates
from ncti.classify.misfit import log_fit


@given(distance=st.floats(0, 1e3), bins=st.integers(2, 400))
def test_log_fit_is_the_upper_chi_squared_tail(distance, bins):
    fit = log_fit(np.array([[-distance / 2]]), [0.0], bins)[0, 0]
    if (exact := chi2.sf(distance, bins)) > 1e-280:
        assert fit == pytest.approx(np.log(exact), rel=1e-9, abs=1e-12)


def test_log_fit_keeps_decreasing_beyond_underflow():
    """The series starts within a part in a thousand, and decreases without end."""
    distance = np.geomspace(1.0, 1e9, 20_000)
    fit = log_fit(-distance[:, None] / 2, [0.0], 250)[:, 0]
    assert np.isfinite(fit).all()
    assert (np.diff(fit)[distance[1:] > 300] < 0).all()
    small = fit[1:] < -600
    assert (np.diff(fit)[small] / fit[1:][small]).max() < 2e-3


@pytest.mark.parametrize(("gain", "floor"), [(0.0, 0.0), (0.3, 2.0)])
def test_fits_of_template_samples_are_uniform(gain, floor):
    """2,000 averages drawn from the full model pass a Kolmogorov-Smirnov test at level 1e-4."""
    rng = np.random.default_rng(8)
    bins, frames, count = 40, 4, 2000
    mean = 5 + np.abs(rng.normal(size=bins)).cumsum()
    templates = GaussianTemplates(gain_sigma=gain, floor_sigma=floor, diagonal_loading=0.0)
    band = np.stack([np.full(bins, 0.5), np.append(np.full(bins - 1, 0.25), 0.0)])
    templates.fit(mean[None], band[None], ["a"], floor=5.0)
    samples = np.stack(
        [templates.draw_averages(np.array([True]), frames, rng)[0] for _ in range(count)]
    )
    samples += gain * rng.standard_normal((count, 1)) * (mean - 5)
    samples += floor * np.sqrt(0.5) * rng.standard_normal((count, 1))
    scores = templates.log_likelihood(samples, frames)
    share = np.exp(log_fit(scores, templates.peak(frames), bins))[:, 0]
    assert kstest(share, "uniform").pvalue > 1e-4


def test_likelihood_peaks_at_the_template_mean():
    rng = np.random.default_rng(9)
    means = rng.exponential(size=(3, 30))
    templates = GaussianTemplates(template_error=0.5)
    band = np.full((3, 1, 30), 0.1)
    templates.fit(means, band, ["a", "a", "a"], floor=0.0, aspect=[0.0, 10.0, 20.0])
    peaks = np.diag(templates.log_likelihood(means, 7))
    np.testing.assert_allclose(templates.peak(7), peaks, rtol=1e-12)
    beside = templates.log_likelihood(means + 0.01 * rng.normal(size=means.shape), 7)
    assert (np.diag(beside) < peaks).all()
    assert not np.allclose(templates.peak(7, gain_sigma=0.0), peaks)

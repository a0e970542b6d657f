"""Distances between figures, and posteriors of settings, agree with closed forms."""

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from studies.reproduction.agreement import (
    Posterior,
    binomial_variance,
    chi_square,
    measure_reach,
    posterior_weights,
)


def test_binomial_variance_follows_laplaces_rule():
    """A beta posterior has the mean (k + 1) / (n + 2); many trials leave p (1 - p) / n."""
    k, n = np.array([0, 3, 10]), 10
    p = (k + 1) / (n + 2)
    np.testing.assert_allclose(binomial_variance(100 * k / n, n), 1e4 * p * (1 - p) / n)
    assert binomial_variance(30, 1e9) == pytest.approx(1e4 * 0.3 * 0.7 / 1e9, rel=1e-7)


def test_distances_at_the_truth_are_chi_square_distributed():
    """This holds for figures that vary together, at a level of 1 in 1,000."""
    rng = np.random.default_rng(3)
    sigma, article = rng.uniform(1, 5, 4), rng.uniform(0, 100, 4)
    correlation = np.full((4, 4), 0.4) + 0.6 * np.eye(4)
    covariance = np.outer(sigma, sigma) * correlation
    simulated = rng.multivariate_normal(article, covariance, 4000)
    distances = chi_square(simulated, article, sigma**2, correlation=correlation)
    assert kstest(distances, chi2(4).cdf).pvalue > 1e-3
    assert kstest(chi_square(simulated, article, sigma**2), chi2(4).cdf).pvalue < 1e-6


def test_posterior_of_a_linear_model_is_the_analytic_normal():
    """Two parameters of three figures A p, with a flat prior, have covariance (A' S^-1 A)^-1.

    Figures are simulated with noise of variance v, and the distance has the sum of variances:
    the posterior is then the one of figures with variance s^2 + 2 v.
    """
    rng = np.random.default_rng(2)
    design = np.array([[1.0, 0.5], [0.0, 1.0], [1.0, -1.0]])
    sigma, noise, truth = np.array([1.0, 1.5, 2.0]), 0.7, np.array([0.5, -1.0])
    article = design @ truth
    parameter = rng.uniform(-9, 9, (400_000, 2))
    simulated = parameter @ design.T + rng.normal(0, noise, (len(parameter), 3))
    posterior = posterior_weights(chi_square(simulated, article, sigma**2 + noise**2))
    precision = design.T @ np.diag(1 / (sigma**2 + 2 * noise**2)) @ design
    covariance = np.linalg.inv(precision)
    assert posterior.temperature == 1
    # Bounds are five standard errors of mean and variance from as many effective draws.
    n = posterior.effective
    mean = posterior.mean(parameter)
    assert (np.abs(mean - truth) < 5 * np.sqrt(np.diag(covariance) / n)).all()
    off = parameter - mean
    ours = np.einsum("n,ni,nj->ij", posterior.weight, off, off)
    diagonal = np.diag(covariance)
    error = np.sqrt((np.outer(diagonal, diagonal) + covariance**2) / n)
    assert (np.abs(ours - covariance) < 5 * error).all()


@pytest.mark.parametrize("effective", [40.0, 150.0])
def test_temperature_yields_the_requested_effective_sample_size(effective):
    """On a grid of spacing h normal weights of deviation s count for 2 sqrt(pi) s / h settings."""
    h, sigma = 0.05, 0.25
    grid = np.arange(-400, 401) * h
    posterior = posterior_weights((grid / sigma) ** 2, effective=effective)
    wide = effective * h / (2 * np.sqrt(np.pi))
    assert posterior.effective == pytest.approx(effective, rel=1e-6)
    assert posterior.temperature == pytest.approx((wide / sigma) ** 2, rel=1e-6)
    assert posterior.mean(grid**2) ** 0.5 == pytest.approx(wide, rel=1e-6)


def test_equal_distances_give_uniform_weights():
    for distance in (np.zeros(9), np.full(9, 1e4)):
        posterior = posterior_weights(distance, effective=9)
        np.testing.assert_allclose(posterior.weight, 1 / 9)
        assert posterior.temperature == 1


def test_quantiles_are_weighted():
    posterior = Posterior(np.array([0.1, 0.2, 0.7]), 1.0)
    columns = np.array([[1.0, 9.0], [2.0, 8.0], [3.0, 7.0]])
    assert posterior.quantiles(columns, [0.2, 0.5]).tolist() == [[2.0, 7.0], [3.0, 7.0]]


def test_reach_matches_manual_counts():
    simulated = np.array([[10.0, 50.0, 3.0], [30.0, 60.0, 5.0], [50.0, 40.0, 7.0]])
    variance = np.array([[25.0, 25.0, 1.0]] * 3)
    reach = measure_reach(simulated, [22.0, 90.0, 5.0], variance)
    np.testing.assert_allclose(reach.share, [1 / 3, 0, 3 / 3])
    np.testing.assert_allclose(reach.nearest, [8 / 5, 6, 0])
    assert reach.together.tolist() == [1, 2, 1]
    np.testing.assert_allclose([reach.low, reach.high], [[10, 40, 3], [50, 60, 7]])

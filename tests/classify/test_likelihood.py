"""The likelihood classifier agrees with dense Gaussians and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from sklearn.base import clone

from ncti.classify import GaussianTemplates, label_posterior
from ncti.classify.bands import mean_correlation, residual_band, whiten
from ncti.classify.between import cells
from ncti.classify.whitening import band_products

BINS, LAGS = 24, 5
LABELS = np.array(["horne", "duncan", "horne", "texas"])


def templates(seed: int = 0, count: int = 4):
    """Return means (template, bin), floors (bin,) and dense covariances (template, bin, bin)."""
    rng = np.random.default_rng(seed)
    floor = 5.0 + rng.random(BINS)
    means = floor + 3 * rng.random((count, BINS))
    factors = np.zeros((count, BINS, BINS))
    for lag in range(LAGS):
        n = np.arange(BINS - lag)
        factors[:, n + lag, n] = rng.uniform(0.2, 1.0, (count, len(n))) / (1 + 2 * lag)
    dense = factors @ factors.transpose(0, 2, 1)
    return means, floor, dense


def lower_band(dense):
    """Return the LAGS lower diagonals of dense covariances (template, bin, bin)."""
    diagonals = [np.diagonal(dense, -lag, axis1=1, axis2=2) for lag in range(LAGS)]
    return np.stack([np.pad(d, ((0, 0), (0, lag))) for lag, d in enumerate(diagonals)], axis=1)


@pytest.mark.parametrize("gain_sigma", [0.0, 3.0])
@pytest.mark.parametrize("floor_sigma", [0.0, 0.7])
def test_multi_place_density_is_mean_of_single_place_densities(gain_sigma, floor_sigma):
    """With equal priors densities are averaged; the tolerance is rounding of some hundred nats."""
    means, floor, dense = templates(count=4 * 3)
    by_place, band = means.reshape(4, 3, BINS), lower_band(dense[:4])
    settings = {"gain_sigma": gain_sigma, "floor_sigma": floor_sigma}
    X = means[::5] + np.random.default_rng(1).standard_normal((3, BINS)) / 4
    for frames in (16, np.arange(1, 4)):
        single = [
            GaussianTemplates(**settings)
            .fit(by_place[:, p], band, LABELS, floor)
            .log_likelihood(X, frames)
            for p in range(3)
        ]
        joint = GaussianTemplates(**settings).fit(by_place, band, LABELS, floor)
        averaged = np.logaddexp.reduce(single) - np.log(3)
        np.testing.assert_allclose(joint.log_likelihood(X, frames), averaged, rtol=1e-9)
        np.testing.assert_allclose(
            joint.without([True, False, False, False]).log_likelihood(X, frames),
            averaged[:, 1:],
            rtol=1e-9,
        )


def test_duplicate_places_change_nothing_with_template_error():
    """Two equal places have the mean of two equal densities, which is that density."""
    means, floor, dense = templates(count=6)
    labels, aspect = ["duncan"] * 3 + ["horne"] * 3, [0.0, 2.0, 4.0] * 2
    X = means[:3] + np.random.default_rng(2).standard_normal((3, BINS)) / 4
    once, twice = (
        GaussianTemplates(template_error=0.3).fit(
            places, lower_band(dense), labels, floor, aspect=aspect
        )
        for places in (means, np.stack([means, means], axis=1))
    )
    np.testing.assert_allclose(
        twice.log_likelihood(X, 16), once.log_likelihood(X, 16), rtol=1e-9, atol=1e-9
    )
    np.testing.assert_allclose(twice.peak(16), once.peak(16), rtol=1e-9)


@pytest.mark.parametrize("frames", [1, 4, 32, np.arange(1, 7)], ids=str)
@pytest.mark.parametrize("floor_sigma", [0.0, 0.7])
@pytest.mark.parametrize("gain_sigma", [0.0, 0.05, 3.0])
@pytest.mark.parametrize("diagonal_loading", [0.0, 0.1])
def test_log_likelihood_matches_a_dense_gaussian(gain_sigma, floor_sigma, diagonal_loading, frames):
    """Unknowns of an average are integrated out; posteriors follow by Bayes's rule.

    Two triangular solves with condition numbers below 1e5 err by 1e-10 of some hundred nats.
    """
    means, floor, dense = templates()
    X = means.mean(axis=0) + np.random.default_rng(1).standard_normal((6, BINS))
    classifier = GaussianTemplates(
        gain_sigma=gain_sigma, floor_sigma=floor_sigma, diagonal_loading=diagonal_loading
    )
    classifier.fit(means, lower_band(dense), LABELS, floor)
    logs = classifier.log_likelihood(X, frames)
    mean_variance = np.mean(np.diagonal(dense, axis1=1, axis2=2))
    for t, mean in enumerate(means):
        signal, frame = mean - floor, dense[t] + diagonal_loading * mean_variance * np.eye(BINS)
        unknown = gain_sigma**2 * np.outer(signal, signal) + floor_sigma**2 * mean_variance
        for x, n, log in zip(X, np.broadcast_to(frames, len(X)), logs[:, t], strict=True):
            by_hand = stats.multivariate_normal(mean, frame / n + unknown).logpdf(x)
            np.testing.assert_allclose(log, by_hand, rtol=1e-10)
    np.testing.assert_array_equal(classifier.posterior(X, frames), label_posterior(logs, LABELS)[1])


@pytest.mark.parametrize("frames", [1, 16])
def test_a_template_error_is_the_same_in_all_frames(frames):
    """Averages have its covariance whole, and that of a frame over their number."""
    means, floor, dense = templates(count=3)
    aspect, band = np.array([0.0, 2.0, 4.0]), lower_band(dense)
    known = {"gain_sigma": 0.0, "floor_sigma": 0.0, "diagonal_loading": 0.0}
    classifier = GaussianTemplates(template_error=0.3, **known)
    classifier.fit(means, band, ["duncan"] * 3, floor, aspect=aspect)
    correlation = mean_correlation(band)
    tangents, residuals = cells(means, np.zeros(3), aspect, correlation)
    for t, mean in enumerate(means):
        lower = residual_band(residuals[t], correlation)
        error = sum(np.diag(row[: BINS - lag], -lag) for lag, row in enumerate(lower))
        error = error + np.tril(error, -1).T
        covariance = dense[t] / frames + 0.3 * error + np.outer(tangents[t], tangents[t])
        by_hand = stats.multivariate_normal(mean, covariance).logpdf(means)
        np.testing.assert_allclose(
            classifier.log_likelihood(means, frames)[:, t], by_hand, rtol=1e-9
        )


def test_excluding_templates_equals_fitting_without_them():
    means, floor, dense = templates()
    X = means + 0.3
    # Diagonal loading and floor have their units from all templates given.
    known = GaussianTemplates(floor_sigma=0.0, diagonal_loading=0.0)
    classifier = clone(known).fit(means, lower_band(dense), LABELS, floor)
    fewer = clone(known).fit(means[1:], lower_band(dense[1:]), LABELS[1:], floor)
    np.testing.assert_allclose(
        classifier.without([True, False, False, False]).posterior(X, 4),
        fewer.posterior(X, 4),
        rtol=1e-10,
        atol=1e-300,
    )
    rest = classifier.without([False, True, False, False])  # the only one of duncan
    assert rest.classes_.tolist() == ["horne", "texas"]
    best = rest.posterior(X, 4).argmax(axis=1)
    np.testing.assert_array_equal(rest.predict(X, 4), rest.classes_[best])


def test_non_positive_definite_covariance_is_refused():
    means, floor, _ = templates()
    with pytest.raises(ValueError, match=r"^diagonal_loading is 0\.001.*covariance\[0\]"):
        GaussianTemplates().fit(means, np.zeros((4, 1, BINS)), LABELS, floor)


@given(
    st.integers(0, 2**32 - 1), st.integers(1, 30), st.integers(1, 40), st.sampled_from([1, 64, 150])
)
def test_whitening_is_independent_per_column(seed, bins, lags, count):
    rng = np.random.default_rng(seed)
    factor = rng.uniform(-0.3, 0.3, (min(lags, bins), bins)) / lags
    factor[0] = rng.uniform(1.0, 2.0, bins)
    lower = sum(np.diag(band[: bins - lag], -lag) for lag, band in enumerate(factor))
    columns = rng.standard_normal((bins, count))
    white = whiten(factor, columns)
    # Rounding of a backward stable solution: the factor is diagonally dominant.
    np.testing.assert_allclose(lower @ white, columns, rtol=0, atol=1e-13 * bins)
    chosen = np.flatnonzero(rng.random(count) < 0.5)
    np.testing.assert_array_equal(whiten(factor, columns[:, chosen]), white[:, chosen])


@given(
    *(st.integers(0, 2**32 - 1), st.integers(1, 30), st.integers(1, 40)),
    *(st.sampled_from([1, 64, 150]), st.integers(0, 3)),
)
def test_band_products_match_whitening_per_vector(seed, bins, lags, count, number):
    rng = np.random.default_rng(seed)
    factor = rng.uniform(-0.3, 0.3, (min(lags, bins), bins)) / lags
    factor[0] = rng.uniform(1.0, 2.0, bins)
    vectors, mean = rng.standard_normal((count, bins)), rng.standard_normal(bins)
    directions = rng.standard_normal((bins, number))
    squared, along = band_products(factor, vectors, mean, directions)
    white = whiten(factor, (vectors - mean).T)
    # Sums of up to 30 terms, in another order.
    bound = 1e-14 * bins * (1 + np.abs(white).max() ** 2) * (1 + np.abs(directions).sum())
    np.testing.assert_allclose(squared, (white**2).sum(axis=0), rtol=0, atol=bound)
    np.testing.assert_allclose(along, white.T @ directions, rtol=0, atol=bound)
    chosen = rng.random(count) < 0.5
    products = band_products(factor, vectors[chosen], mean, directions)
    np.testing.assert_array_equal(products[0], squared[chosen])
    np.testing.assert_array_equal(products[1], along[chosen])

"""Template errors between aspects match closed forms, and give calibrated probabilities."""

from __future__ import annotations

import numpy as np
import pytest

from ncti.classify import GaussianTemplates, label_posterior
from ncti.classify.bands import mean_correlation, residual_band
from ncti.classify.between import cells
from ncti.classify.calibration import likely_outlier_fraction
from ncti.classify.fusion import add_outliers

WHITE = np.array([1.0])
BINS = 40


def parabola(aspect, curvature=0.02):
    """Return profiles that are a parabola in aspect in every bin."""
    bins = np.linspace(0.5, 1.5, BINS)
    x = np.asarray(aspect)[:, None] - 40
    return bins * (3 + 0.1 * x + curvature * x**2 / 2)


@pytest.mark.parametrize("aspect", [[10, 20, 30, 40], [0.0, 7.0, 11.0, 30.0, 31.0]])
def test_tangents_and_residuals_are_exact_for_parabolas(aspect):
    """Both are exact for polynomials of the second degree, except the slope at open ends."""
    aspect = np.array(aspect, dtype=float)
    tangent, residual = cells(parabola(aspect), np.zeros(len(aspect)), aspect, WHITE)
    bins = np.linspace(0.5, 1.5, BINS)
    before, behind = np.diff(aspect)[:-1], np.diff(aspect)[1:]
    moment = (before**3 + behind**3) / (12 * (before + behind))
    slope = 0.1 + 0.02 * (aspect[1:-1] - 40)
    np.testing.assert_allclose(tangent[1:-1], np.outer(np.sqrt(moment) * slope, bins))
    step = np.concatenate([[before[0]], (before + behind) / 2, [behind[-1]]])
    np.testing.assert_allclose(residual, np.outer(0.02 * step**2 / 2, bins), rtol=1e-9)


def test_the_band_of_a_residual_is_positive_semidefinite():
    rng = np.random.default_rng(3)
    factor = np.tril(np.triu(rng.normal(size=(BINS, BINS)), -6))
    dense = factor @ factor.T
    band = np.stack([np.append(np.diag(dense, -lag), np.zeros(lag)) for lag in range(7)])
    along = mean_correlation(band[None])
    residual = residual_band(rng.exponential(size=BINS), along)
    matrix = sum(
        np.diag(residual[lag, : BINS - lag], -lag) + np.diag(residual[lag, : BINS - lag], lag)
        for lag in range(1, 7)
    ) + np.diag(residual[0])
    assert np.linalg.eigvalsh(matrix).min() > -1e-10 * residual.max()


# Calibration


def smooth_ships(aspect, ships=3, scale=6.0, seed=4):
    """Return random ships whose profiles change over some degrees, (ship, aspect, bin)."""
    rng = np.random.default_rng(seed)
    knots = np.arange(-60, 151, 3.0)
    weights = np.exp(-0.5 * ((np.asarray(aspect)[:, None] - knots) / scale) ** 2)
    drawn = rng.normal(size=(ships + 1, len(knots), BINS))
    alike = drawn[0] + 0.3 * drawn[1:]
    return 10 + 3 * np.einsum("ak,skn->san", weights, alike)


def taught(spacing, error, noise=0.5):
    aspect = np.arange(0, 90.1, spacing)
    means = smooth_ships(aspect)
    count = means.shape[0] * len(aspect)
    band = np.full((count, 1, BINS), noise**2)
    templates = means.reshape(count, BINS), band, np.repeat([0, 1, 2], len(aspect))
    classifier = GaussianTemplates(gain_sigma=0.0, floor_sigma=0.0, template_error=error)
    aspects = np.tile(aspect, 3)
    return classifier.fit(*templates, 0.0, aspect=aspects, rng=np.random.default_rng(5))


def fresh(count=120, frames=16, noise=0.5):
    rng = np.random.default_rng(6)
    aspect = rng.uniform(0, 90, count)
    means = smooth_ships(aspect)
    return means + noise / np.sqrt(frames) * rng.normal(size=means.shape)


def test_posteriors_at_unseen_aspects_are_not_overconfident():
    """Calibrated errors lower the negative log-likelihood, and avoid overconfident answers.

    The share of wrong ones among 360 answers is below the mean claim plus 3 standard errors.
    """
    samples = fresh().reshape(-1, BINS)
    true = np.repeat([0, 1, 2], 120)
    results = {}
    for error in (0.0, None):
        posterior = taught(12.0, error).posterior(samples, 16)
        wrong = np.mean(posterior.argmax(axis=1) != true)
        claimed = 1 - posterior.max(axis=1)
        spread = 3 * np.sqrt(np.mean(claimed * (1 - claimed)) / len(true)) + 3 / len(true)
        negative_log_likelihood = -np.log(
            np.maximum(posterior[np.arange(360), true], 1e-300)
        ).mean()
        results[error] = wrong - claimed.mean() - spread, negative_log_likelihood
    assert results[0.0][0] > 0 > results[None][0]
    assert results[None][1] < 0.2 * results[0.0][1]


def test_errors_are_calibrated_on_averages_of_sixteen_frames(monkeypatch):
    """With sixteen frames the noise variance is a sixteenth, and the density is told so.

    The mean square of 480 normals scatters by 6.5 %; five of that are allowed.
    """
    density, calls = GaussianTemplates.density, []

    def noted(self, template, samples, frames, priors):
        calls.append((samples, frames))
        return density(self, template, samples, frames, priors)

    monkeypatch.setattr(GaussianTemplates, "density", noted)
    noise = 0.5
    means = taught(12.0, None, noise=noise).mean_[:, 0]
    assert {float(count) for _, frames in calls for count in frames} == {16.0}
    samples = np.unique(np.concatenate([drawn for drawn, _ in calls]), axis=0)
    assert samples.size == 480
    nearest = np.square(samples[:, None] - means).sum(axis=2).min(axis=1)
    assert nearest.sum() / samples.size == pytest.approx(noise**2 / 16, rel=5 * 0.065)


# Limits on how far one sensor may outweigh another


@pytest.mark.parametrize("added", [0.25, 1.0])
def test_likely_outlier_fraction_matches_grid_search(added):
    """Compare with the sum's maximum on a grid of 1 in 1,000 of fractions, for several weights."""
    rng = np.random.default_rng(10)
    sure = rng.beta(5, 1, 80)
    weight = rng.random((3, 80))
    tried = np.geomspace(1e-6, 1, 14_000)

    def likelihood(p):
        return np.log((1 - tried) * p + tried / 4)

    expected = [
        tried[
            np.argmax(
                sum(w * likelihood(p) for w, p in zip(row, sure, strict=True))
                + added * (likelihood(1.0) + likelihood(0.0))
            )
        ]
        for row in weight
    ]
    np.testing.assert_allclose(
        likely_outlier_fraction(sure, 4, weight, added=added), expected, rtol=2e-3
    )


def test_outlier_fraction_mixes_posterior_with_uniform():
    """With outlier fraction e the posterior is (1 - e) p + e / labels, by definition."""
    scores = np.random.default_rng(8).normal(scale=30, size=(50, 6))
    uneven = np.array([0, 0, 0, 1, 1, 2])
    plain = label_posterior(scores, uneven)[1]
    softened = label_posterior(add_outliers(scores, uneven, outlier_fraction=0.06), uneven)[1]
    np.testing.assert_allclose(softened, 0.94 * plain + 0.06 / 3, rtol=1e-9)


def test_outlier_fractions_apply_per_template():
    """Scores become log((1 - e) p + e) with p relative to its mean; e = 1 removes them."""
    scores = np.random.default_rng(8).normal(size=(5, 4))
    outlier_fractions = np.array([0.0, 0.2, 1.0, 1.0])
    relative = np.exp(scores) / np.exp(scores).mean(axis=1, keepdims=True)
    mixed = add_outliers(scores, [0, 0, 1, 1], outlier_fraction=outlier_fractions)
    np.testing.assert_allclose(
        mixed, np.log((1 - outlier_fractions) * relative + outlier_fractions), rtol=1e-9
    )

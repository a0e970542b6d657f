"""Scores of several sensors are calibrated, and fuse to the scores of the joint sensor."""

import numpy as np
import pytest
from scipy import stats

from ncti.classify import GaussianTemplates, fuse, label_posterior
from ncti.classify.calibration import (
    EXCLUDED_COSINE,
    NEW_ASPECT_RATIO,
    fit_held_out_phases,
    fit_outlier_fraction,
    fit_temperature_and_outliers,
)
from ncti.classify.fusion import add_outliers, similarity_between_phases

LABELS = np.repeat([0, 1, 2, 3], 5)  # four ships, five aspects


def looks(rng, samples, *, sigma, templates=None):
    """Return true template numbers, exact log densities of noisy looks, and the templates."""
    templates = rng.normal(size=(20, 6)) if templates is None else templates
    which = rng.integers(0, 20, samples)
    noisy = templates[which] + sigma * rng.normal(size=(samples, templates.shape[1]))
    distance = ((noisy[:, None] - templates) ** 2).sum(axis=2)
    return which, -distance / (2 * sigma**2), templates


def fit(scores, labels, truth):
    """Return the inverse temperature and the outlier fraction of scores of equal weights."""
    weights = np.ones(len(truth))
    return fit_temperature_and_outliers([lambda: scores], np.array(labels), truth, weights)


def mistaken(samples, share, seed, distance=3.0):
    """Return log densities of looks at four templates, with a share from random templates."""
    rng = np.random.default_rng(seed)
    truth = rng.integers(4, size=samples)
    template = np.where(rng.random(samples) < share, rng.integers(4, size=samples), truth)
    looks = distance * np.eye(4)[template] + rng.normal(size=(samples, 4))
    return -((looks[:, None] - distance * np.eye(4)) ** 2).sum(axis=2) / 2, truth


@pytest.mark.parametrize("scale", [1e-9, 1e6])
@pytest.mark.parametrize("share", [0.05, 0.3])
def test_inverse_temperature_and_outlier_fraction_are_found_together(scale, share):
    """The outlier fraction is the share of mistakes in 4,000 looks within four standard errors.

    The inverse temperature scatters by some 5 % (found by repeating).
    """
    logs, truth = mistaken(4000, share, seed=11)
    inverse_temperature, outlier_fraction = fit(logs / scale, np.arange(4), truth)
    assert abs(outlier_fraction - share) < 4 * np.sqrt(share * (1 - share) / 4000)
    assert inverse_temperature == pytest.approx(scale, rel=0.2)


def apart(rng, samples, distance):
    """Return exact log densities of looks at two templates `distance` sigma apart, and truth."""
    truth = np.arange(samples) % 2
    noisy = truth * distance + rng.normal(size=samples)
    return -((noisy[:, None] - [0.0, distance]) ** 2) / 2, truth


def test_always_correct_sensor_does_not_dominate_fusion():
    """124 correct looks make the next correct by 125 to 1 at most, which limits its score.

    That sensor favours label 1; another one favours label 0 by 2.5 log(126), and wins.
    """
    rng = np.random.default_rng(8)
    logs, truth = apart(rng, 124, 8.0)
    factor, outliers = fit(100 * logs, [0, 1], truth)
    sure = np.array([[0.0, -2.5 * np.log(126)]])
    wrong = add_outliers([[-3200.0 * factor, 0.0]], [0, 1], outlier_fraction=outliers)
    posterior = label_posterior(fuse(sure, wrong, inverse_temperature=(1.0, 1.0)), [0, 1])[1]
    assert posterior[0, 0] > 0.99


def test_calibrated_probabilities_match_frequencies():
    """Scores in wrong units, calibrated on other looks, give true frequencies per tenth.

    Chi-square test of 8,000 answers over tenths of probability at a level of 1e-3.
    """
    rng = np.random.default_rng(3)
    which, logs, templates = looks(rng, 4000, sigma=1.5)
    factor, outliers = fit(logs / 40, LABELS, LABELS[which])
    which, logs, _ = looks(rng, 8000, sigma=1.5, templates=templates)
    _, posterior = label_posterior(factor * logs / 40, LABELS)
    posterior = (1 - outliers) * posterior + outliers / 4
    answer, certain = posterior.argmax(axis=1), posterior.max(axis=1)
    right = answer == LABELS[which]
    tenth = np.digitize(certain, np.arange(0.3, 1.0, 0.1))
    terms = []
    for k in np.unique(tenth):
        p, n, hits = certain[tenth == k].mean(), (tenth == k).sum(), right[tenth == k].sum()
        variance = (certain[tenth == k] * (1 - certain[tenth == k])).sum()
        if n >= 50 and variance > 5:
            terms.append((hits - n * p) ** 2 / variance)
    assert len(terms) >= 5
    assert sum(terms) < stats.chi2.isf(1e-3, len(terms))


def test_fused_scores_equal_joint_sensor_scores():
    """The scores of independent halves of a look add up to the score of the look."""
    rng = np.random.default_rng(4)
    templates = rng.normal(size=(20, 8))
    noisy = templates[rng.integers(0, 20, 50)] + rng.normal(size=(50, 8))
    halves = [
        -((noisy[:, None, half] - templates[:, half]) ** 2).sum(axis=2) / 2
        for half in (slice(0, 3), slice(3, 8))
    ]
    joint = halves[0] + halves[1]
    fused = fuse(*halves, inverse_temperature=(1.0, 1.0))
    np.testing.assert_allclose(np.diff(fused, axis=1), np.diff(joint, axis=1), atol=1e-9)


def test_blocked_held_out_fit_equals_fit_of_all_rows():
    """Test more templates than a block has rows, with scores in single precision."""
    phases, ships, aspects = 3, 4, 60
    rng = np.random.default_rng(3)
    labels, aspect = np.divmod(np.arange(ships * aspects), aspects)
    near = np.exp(-(((aspect[:, None] - aspect) / 5) ** 2)) * (labels[:, None] == labels)
    scores = (near + 0.3 * rng.standard_normal((phases, *near.shape))).astype(np.float32)
    fitted = fit_held_out_phases(scores, labels, aspect)
    unlike = np.where(aspect[:, None] == aspect, EXCLUDED_COSINE, scores)
    for phase, constants in enumerate(fitted.T):
        rows = [
            np.delete(table, phase, axis=0).reshape(-1, len(labels)) for table in (scores, unlike)
        ]
        truth = np.tile(labels, 2 * (phases - 1))
        weight = np.repeat([1 - NEW_ASPECT_RATIO, NEW_ASPECT_RATIO], len(truth) // 2)
        together = [lambda rows=rows: np.concatenate(rows).astype(float)]
        plain = fit_temperature_and_outliers(together, labels, truth, weight)
        # Rounding changes where the search stops, but within its tolerance.
        np.testing.assert_allclose(constants, plain, rtol=1e-6)


def test_exact_templates_have_no_outliers():
    means = [[0, 1, 0], [1, 0, 0]]
    exact = GaussianTemplates().fit(means, np.ones((2, 1, 3)), ["duncan", "roberts"], 0)
    assert not fit_outlier_fraction(exact, 16, np.random.default_rng(0)).any()


def test_a_silhouette_is_compared_with_templates_of_other_phases():
    maps = np.array([[[1, 0]], [[1, 1]]], np.float32)
    similarity = similarity_between_phases(maps, maps)
    np.testing.assert_allclose(similarity.ravel(), np.sqrt(0.5), rtol=1e-6)

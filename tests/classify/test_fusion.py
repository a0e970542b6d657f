"""Scores of several sensors as one: calibration, and what two sensors know together."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from ncti.classify import fit_sharpness, fuse, label_posterior

LABELS = np.repeat([0, 1, 2, 3], 5)  # four ships, five aspects


def looks(rng, samples, *, sigma, size=6, templates=None):
    """True templates, and exact log densities of noisy looks at them."""
    templates = rng.normal(size=(20, size)) if templates is None else templates
    which = rng.integers(0, 20, samples)
    seen = templates[which] + sigma * rng.normal(size=(samples, templates.shape[1]))
    distance = ((seen[:, None] - templates) ** 2).sum(axis=2)
    return which, -distance / (2 * sigma**2), templates


@given(
    arrays(float, (3, 20), elements=st.floats(-1e6, 1e6)),
    st.floats(0, 1e6),
)
def test_probabilities_are_probabilities(scores, sharpness):
    classes, posterior = label_posterior(scores, LABELS, sharpness=sharpness)
    np.testing.assert_array_equal(classes, [0, 1, 2, 3])
    assert ((posterior >= 0) & (posterior <= 1)).all()
    np.testing.assert_allclose(posterior.sum(axis=1), 1.0)


def test_posterior_is_bayes_rule():
    rng = np.random.default_rng(0)
    scores = rng.normal(size=(7, 20))
    _, posterior = label_posterior(scores, LABELS, sharpness=2.0)
    density = np.exp(2.0 * scores).reshape(7, 4, 5).mean(axis=2)
    np.testing.assert_allclose(posterior, density / density.sum(axis=1, keepdims=True))


def test_a_label_with_more_templates_is_no_likelier():
    _, posterior = label_posterior(np.zeros((1, 5)), np.array(["a", "a", "a", "a", "b"]))
    np.testing.assert_allclose(posterior, [[0.5, 0.5]])


@pytest.mark.parametrize("sharpness", [0.0, 0.3, 2.0])
def test_templates_left_out_are_as_if_never_there(sharpness):
    """By one rule for all samples, and by one for each; a label left with none is impossible."""
    rng = np.random.default_rng(6)
    # Those left out are the best by far, beyond what an exponential holds.
    scores = 3 * rng.normal(size=(9, 20))
    hidden = rng.random((9, 20)) < 0.5
    hidden[:, :5], hidden[4, 5:10] = hidden[0, :5], True
    scores[hidden] += 2000
    answers = label_posterior(scores, LABELS, sharpness=sharpness, exclude=hidden)[1]
    for row, (score, gone, answer) in enumerate(zip(scores, hidden, answers, strict=True)):
        few = score[None, ~gone]
        classes, alone = label_posterior(few, LABELS[~gone], sharpness=sharpness)
        wanted = np.zeros(4)
        wanted[classes] = alone[0]
        # Sums of 20 terms in another order, over rounding of differences of some 10.
        np.testing.assert_allclose(answer, wanted, rtol=1e-13)
        same = label_posterior(scores[[row]], LABELS, sharpness=sharpness, exclude=gone)[1]
        np.testing.assert_allclose(same[0], answer, rtol=1e-13)
    assert answers[4, 1] == 0


@pytest.mark.parametrize("scale", [1e-3, 1.0, 50.0])
def test_exact_densities_are_found_to_be_exact(scale):
    """Scores that are log densities over a scale have that scale as their sharpness.

    The maximum-likelihood estimate scatters by 1 / sqrt(n I): some 3 % for 4,000 looks here,
    found by repeating; 10 % is beyond three of them.
    """
    rng = np.random.default_rng(1)
    which, logs, _ = looks(rng, 4000, sigma=1.5)
    found = fit_sharpness(logs / scale, LABELS, LABELS[which])
    assert found == pytest.approx(scale, rel=0.1)


def test_scores_without_sense_count_for_little():
    rng = np.random.default_rng(2)
    which, logs, _ = looks(rng, 2000, sigma=1.5)
    noise = rng.normal(size=logs.shape)
    sharpness = fit_sharpness(noise, LABELS, LABELS[which])
    _, posterior = label_posterior(noise, LABELS, sharpness=sharpness)
    assert np.abs(posterior - 0.25).max() < 0.1
    assert fit_sharpness(np.zeros((5, 20)), LABELS, LABELS[:5]) == 0.0


def test_calibrated_probabilities_come_true():
    """Scores in wrong units, calibrated on other looks: frequencies by tenths of probability.

    8,000 answers; chi-square over the tenths at a level of 1e-3, probabilities as they are.
    """
    rng = np.random.default_rng(3)
    which, logs, templates = looks(rng, 4000, sigma=1.5)
    sharpness = fit_sharpness(logs / 40, LABELS, LABELS[which])
    which, logs, _ = looks(rng, 8000, sigma=1.5, templates=templates)
    _, posterior = label_posterior(logs / 40, LABELS, sharpness=sharpness)
    named, certain = posterior.argmax(axis=1), posterior.max(axis=1)
    right = named == LABELS[which]
    tenth = np.digitize(certain, np.arange(0.3, 1.0, 0.1))
    terms = []
    for k in np.unique(tenth):
        p, n, hits = certain[tenth == k].mean(), (tenth == k).sum(), right[tenth == k].sum()
        variance = (certain[tenth == k] * (1 - certain[tenth == k])).sum()
        if n >= 50 and variance > 5:
            terms.append((hits - n * p) ** 2 / variance)
    assert len(terms) >= 5
    assert sum(terms) < stats.chi2.isf(1e-3, len(terms))


def test_two_sensors_together_are_the_sensor_with_both_views():
    """Independent halves of one look: the sum of their scores is its own score."""
    rng = np.random.default_rng(4)
    templates = rng.normal(size=(20, 8))
    seen = templates[rng.integers(0, 20, 50)] + rng.normal(size=(50, 8))
    halves = [
        -((seen[:, None, part] - templates[:, part]) ** 2).sum(axis=2) / 2
        for part in (slice(0, 3), slice(3, 8))
    ]
    whole = halves[0] + halves[1]
    both = fuse(*halves, sharpness=(1.0, 1.0))
    np.testing.assert_allclose(np.diff(both, axis=1), np.diff(whole, axis=1), atol=1e-9)


def test_sensors_of_unlike_worth_lose_nothing_together():
    """A good and a useless one, calibrated: at least as many right as the good one, by 3 sigma."""
    rng = np.random.default_rng(5)
    which, logs, _ = looks(rng, 4000, sigma=1.0)
    useless = 100 * rng.normal(size=logs.shape)
    half = slice(0, 2000)
    truth = LABELS[which]
    sharpness = tuple(fit_sharpness(s[half], LABELS, truth[half]) for s in (logs, useless))
    rest = slice(2000, None)
    together = label_posterior(fuse(logs[rest], useless[rest], sharpness=sharpness), LABELS)[1]
    alone = label_posterior(logs[rest], LABELS)[1]
    right = [(p.argmax(axis=1) == truth[rest]).mean() for p in (together, alone)]
    assert right[0] > right[1] - 3 * np.sqrt(2 * 0.25 / 2000)


def test_what_does_not_fit_is_refused():
    with pytest.raises(ValueError, match=r"^scores has shape"):
        label_posterior(np.zeros((2, 3)), [0, 1])
    with pytest.raises(ValueError, match=r"^exclude has shape \(3,\), but must be \(2, 4\) or"):
        label_posterior(np.zeros((2, 4)), [0, 1, 2, 3], exclude=[True, False, False])
    for everything in (True, [[False, True], [True, True]]):
        with pytest.raises(ValueError, match=r"^exclude leaves out all templates"):
            label_posterior(np.zeros((2, 2)), [0, 1], exclude=everything)
    with pytest.raises(ValueError, match=r"^truth has"):
        fit_sharpness(np.zeros((2, 3)), [0, 1, 2], [0, 7])
    with pytest.raises(ValueError, match=r"^scores have shapes"):
        fuse(np.zeros((2, 3)), np.zeros((2, 4)), sharpness=(1.0, 1.0))
    with pytest.raises(ValueError, match=r"^scores"):
        label_posterior(np.full((1, 2), np.nan), [0, 1])

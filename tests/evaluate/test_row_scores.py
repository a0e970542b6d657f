"""Scores of rows, comparisons and learning curves agree with closed forms and simulations."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest, norm
from sklearn.metrics import roc_auc_score
from sklearn.neighbors import KNeighborsClassifier

from ncti.evaluate import (
    accuracy_by_aspect,
    compare,
    grouped_accuracy,
    learning_curve,
    score,
    wilson_interval,
)


def rng():
    return np.random.default_rng(7)


def test_one_row_per_view_gives_independent_intervals():
    aspects = np.arange(0.0, 91.0, 3.0)
    correct = rng().random((1, 31)) < 0.7
    plain = accuracy_by_aspect(correct, aspects)
    rows = grouped_accuracy(correct[0], aspects, np.arange(31))
    assert rows.labels == plain.labels
    for name in ("fraction", "ci_low", "ci_high", "n"):
        np.testing.assert_allclose(getattr(rows, name), getattr(plain, name), rtol=1e-12)


def test_identical_rows_of_a_view_count_once():
    view = np.repeat(np.arange(40), 6)
    accuracy = grouped_accuracy(view % 4 > 0, np.full(240, 50.0), view)
    low, high = wilson_interval(30, 40)
    assert accuracy.ci_low[-1] == pytest.approx(float(low), abs=0.005)  # an imaginary view
    assert accuracy.ci_high[-1] == pytest.approx(float(high), abs=0.005)


def test_the_order_of_rows_and_the_names_of_views_do_not_matter():
    view = rng().integers(0, 20, 200)
    correct, aspects = rng().random(200) < 0.6, 9.0 * view
    shuffled = rng().permutation(200)
    ordered = grouped_accuracy(correct, aspects, view)
    names = np.char.add("view ", view.astype(str))[shuffled]
    mixed = grouped_accuracy(correct[shuffled], aspects[shuffled], names)
    np.testing.assert_allclose(ordered.ci_low, mixed.ci_low, rtol=1e-12)


def test_intervals_cover_accuracy_of_correlated_rows():
    """If intervals cover 95 %, fewer than 92 % of 400 cover with probability 0.004."""
    generator, covered = rng(), 0
    view = np.repeat(np.arange(60), 8)
    for _ in range(400):
        easy = generator.beta(1.5, 0.5, 60)  # 75 % in the mean, correlation 1/3 within a view
        correct = generator.random(480) < easy[view]
        accuracy = grouped_accuracy(correct, np.zeros(480), view)
        covered += bool(accuracy.ci_low[-1] <= 0.75 <= accuracy.ci_high[-1])
    assert binomtest(covered, 400, 0.95, alternative="less").pvalue > 0.004


def answers(generator, rows=2000, classes=3):
    """Return true classes drawn with the probabilities that a perfect classifier states."""
    likely = generator.dirichlet(np.ones(classes), rows)
    truth = (generator.random((rows, 1)) > likely.cumsum(axis=1)).sum(axis=1)
    return truth, likely


WHERE = {"aspect": np.zeros(2000), "groups": np.arange(2000), "classes": [0, 1, 2]}


def test_sharpening_true_probabilities_breaks_calibration():
    truth, likely = answers(rng())
    scores = score(truth, likely, **WHERE)
    # Every bin's share of right answers is within 4 standard deviations of its confidence.
    curve = scores.reliability
    filled = curve.n > 0
    deviation = np.sqrt(curve.confidence * (1 - curve.confidence) / np.maximum(curve.n, 1))
    assert (np.abs(curve.fraction - curve.confidence)[filled] < 4 * deviation[filled]).all()
    sharp = likely**3 / (likely**3).sum(axis=1, keepdims=True)
    sharpened = score(truth, sharp, **WHERE)
    assert sharpened.ece > 0.1 > scores.ece
    assert sharpened.log_loss > scores.log_loss
    np.testing.assert_array_equal(sharpened.confusion, scores.confusion)
    assert scores.log_loss == pytest.approx(-np.log(likely[np.arange(2000), truth]).mean())


@given(st.permutations([0, 1, 2]))
def test_the_order_of_the_columns_does_not_matter(order):
    truth, likely = answers(rng(), 200)
    views = {"aspect": np.zeros(200), "groups": np.arange(200)}
    ordered = score(truth, likely, classes=[0, 1, 2], **views)
    mixed = score(truth, likely[:, order], classes=order, **views)
    assert ordered.log_loss == pytest.approx(mixed.log_loss)
    np.testing.assert_array_equal(ordered.confusion, mixed.confusion)


def test_open_set_scores_match_scikit_learn_and_counts():
    truth, likely = answers(rng())
    known = truth < 2
    pair = likely[:, :2] / likely[:, :2].sum(axis=1, keepdims=True)
    options = WHERE | {"classes": [0, 1]}
    alike = np.random.default_rng(8).random(2000)  # large for some wrong answers, too
    scores = score(truth, pair, similarity=alike, **options)
    assert scores.auroc == pytest.approx(roc_auc_score(known, alike))
    level = np.sort(alike[~known])[int(np.ceil(0.9 * (~known).sum())) - 1]
    right = (pair.argmax(axis=1) == truth) & (alike > level)
    assert scores.kept == pytest.approx(right[known].mean())
    assert scores.confusion.sum() == known.sum() == scores.accuracy.n[-1]


def test_decision_values_give_classes_but_no_probabilities():
    truth, likely = answers(rng())
    scores = score(truth, np.log(likely), **WHERE)
    assert scores.reliability is None
    assert np.isnan([scores.log_loss, scores.ece, scores.auroc, scores.kept]).all()
    named = likely.argmax(axis=1)
    of_names = score(truth, named, **WHERE)
    np.testing.assert_array_equal(scores.confusion, of_names.confusion)
    assert scores.confusion[0, 1] == np.sum((truth == 0) & (named == 1))


def test_compare_equals_mcnemar_test_for_independent_rows():
    first, second = rng().random((2, 500)) < [[0.6], [0.7]]
    outcome = compare(first, second, np.arange(500), rng=rng())
    b, c = outcome.first_only, outcome.second_only
    assert outcome.difference == pytest.approx((c - b) / 500)
    # Chi-squared of one degree of freedom is the square of a normal variate.
    assert outcome.p_value == pytest.approx(2 * norm.sf(abs(b - c) / np.sqrt(b + c)))
    spread = np.sqrt(b + c - (b - c) ** 2 / 500) / 500
    assert outcome.ci_high - outcome.ci_low == pytest.approx(2 * 1.96 * spread, rel=0.1)
    opposite = compare(second, first, np.arange(500), rng=rng())
    assert opposite.difference == -outcome.difference
    assert opposite.p_value == outcome.p_value


def test_compare_rejects_equal_classifiers_at_nominal_rate():
    """5 % of 400 equal pairs differ significantly; more than 8 % have probability 0.005."""
    generator = rng()
    view = np.repeat(np.arange(80), 5)
    refused = outside = 0
    for trial in range(400):
        easy = generator.beta(1, 1, (2, 80))  # equally good in the mean, not on each view
        first, second = generator.random((2, 400)) < easy[:, view]
        outcome = compare(first, second, view, rng=np.random.default_rng(trial), resamples=500)
        refused += outcome.p_value < 0.05
        outside += not outcome.ci_low <= 0 <= outcome.ci_high
    assert max(refused, outside) <= 32


def test_learning_curve_subsets_are_nested():
    subsets = []

    class Watched(KNeighborsClassifier):
        def fit(self, X, y):
            subsets.append(set(X[:, 0]))
            return super().fit(X, y)

    view = np.repeat(np.arange(30), 4)
    X, y = np.arange(120.0)[:, None], np.array(["duncan", "texas", "horne"])[view % 3]
    sizes = {"views": [1, 4, 10], "draws": [1, 4], "rng": rng()}
    curve = learning_curve(Watched(1), (X, y, view), (X, y, view), **sizes)
    np.testing.assert_array_equal(curve.rows, [[3, 12], [12, 48], [30, 120]])
    assert all(small <= large for small, large in zip(subsets[:-2], subsets[2:], strict=True))
    assert all(small <= large for small, large in zip(subsets[::2], subsets[1::2], strict=True))
    assert curve.fraction[-1, -1] == 1.0


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"predicted": [[0.5, 0.5]] * 2, "classes": None}, ("classes", "None")),
        ({"y": ["texas", "horne"]}, ("similarity", "None")),
    ],
)
def test_missing_dependent_arguments_are_refused(wrong, words):
    good = {"y": ["texas", "duncan"], "predicted": ["texas", "texas"], "aspect": [0.0, 1.0]}
    good |= {"groups": [0, 1], "classes": ["texas", "duncan"]}
    with pytest.raises(ValueError, match=".*".join(map(re.escape, words))):
        score(**(good | wrong))

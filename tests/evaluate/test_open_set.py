"""AUROC and OSCR: closed forms, chance, and scikit-learn's area on the same answers."""

import numpy as np
import pytest
from scipy import stats
from sklearn.metrics import roc_auc_score

from ncti.evaluate import open_set_scores


def test_both_are_one_where_a_threshold_separates():
    scores = open_set_scores([3, 4, 1, 2], [True, True, False, False], [True, True, False, False])
    assert (scores.auroc, scores.oscr) == (1, 1)


def test_wrong_answers_cost_only_the_second():
    scores = open_set_scores([3, 4, 1, 2], [True, False, False, True], [True, True, False, False])
    assert (scores.auroc, scores.oscr) == (1, 0.5)


def test_equal_similarities_are_chance():
    known, right = np.arange(90) < 60, np.arange(90) < 45
    scores = open_set_scores(np.full(90, 0.7), right, known)
    assert (scores.auroc, scores.oscr) == (0.5, 45 / 60 / 2)


def test_opposite_order_gives_the_complement():
    rng = np.random.default_rng(0)
    similarity, known = rng.integers(0, 9, 300), rng.random(300) < 0.6
    up, down = (open_set_scores(sign * similarity, known, known) for sign in (1, -1))
    assert up.auroc + down.auroc == pytest.approx(1)
    assert up.oscr == up.auroc  # where all known ones are right


@pytest.mark.parametrize("seed", range(3))
def test_auroc_is_that_of_scikit_learn_and_oscr_the_area_under_a_curve(seed):
    """Ties among answers included; the curve is walked threshold by threshold."""
    rng = np.random.default_rng(seed)
    similarity = rng.integers(0, 30, (5, 40)) / 30
    known, right = (rng.random(similarity.shape) < share for share in (0.7, 0.6))
    scores = open_set_scores(similarity, right, known)
    assert scores.auroc == pytest.approx(roc_auc_score(known.ravel(), similarity.ravel()))
    named, through = [0.0], [0.0]
    for threshold in np.unique(similarity)[::-1]:
        accepted = similarity >= threshold
        named.append((accepted & right)[known].mean())
        through.append(accepted[~known].mean())
    assert scores.oscr == pytest.approx(np.trapezoid(named, through))


def test_similarities_of_two_normal_distributions():
    """Phi(d / sqrt 2) for means d apart, and the accuracy times that where it is independent.

    Of n pairs at least in independent samples the area is off by sqrt(ln(2 / p) / (2 n)) with
    probability p at most (Hoeffding 1963); here p is 1e-6 for both together.
    """
    rng = np.random.default_rng(5)
    count, apart, accuracy = 20_000, 1.3, 0.8
    known = np.arange(2 * count) < count
    similarity = rng.normal(size=2 * count) + apart * known
    scores = open_set_scores(similarity, rng.random(2 * count) < accuracy, known)
    off = np.sqrt(np.log(4e6) / (2 * count))
    area = stats.norm.cdf(apart / np.sqrt(2))
    assert scores.auroc == pytest.approx(area, abs=off)
    assert scores.oscr == pytest.approx(accuracy * area, abs=off)


@pytest.mark.parametrize("known", [[True, True], [False, False], []])
def test_nothing_to_tell_apart_is_nan(known):
    scores = open_set_scores(np.ones(len(known)), np.ones(len(known), bool), np.array(known, bool))
    assert np.isnan([scores.auroc, scores.oscr]).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"similarity": [0.5, np.nan]}, "similarity is nan"),
        ({"similarity": [[0.5], [0.5, 0.1]]}, "similarity is "),
        ({"similarity": ["a", "b"]}, "similarity is 'a'"),
        ({"correct": [1.0, 0.0]}, r"correct is \[1\.0, 0\.0\], but must be true or false"),
        ({"known": [True, False, True]}, r"known has shape \(3,\), but must be \(2,\)"),
    ],
)
def test_refusals(change, message):
    given = {"similarity": [0.5, 0.6], "correct": [True, False], "known": [True, False]} | change
    with pytest.raises(ValueError, match=f"^{message}"):
        open_set_scores(**given)

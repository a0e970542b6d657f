"""Intervals of answers that were given several times to the same views."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ncti.evaluate import accuracy_by_aspect, replicated_accuracy, wilson_interval

ASPECTS = np.arange(0.0, 91.0, 3.0)


@given(arrays(bool, (4, 31)), arrays(bool, (4, 31)))
def test_one_replicate_is_no_replicate(correct, answered):
    one = replicated_accuracy(correct[None], ASPECTS, answered=answered)
    plain = accuracy_by_aspect(correct, ASPECTS, answered=answered)
    assert one.labels == plain.labels
    for name in ("fraction", "ci_low", "ci_high", "n"):
        np.testing.assert_allclose(getattr(one, name), getattr(plain, name), rtol=1e-12, atol=1e-15)


@given(arrays(bool, (4, 31)), st.integers(2, 6))
def test_equal_answers_are_worth_one(correct, replicates):
    """A classifier that no noise moves: as many answers as views."""
    several = replicated_accuracy(np.repeat(correct[None], replicates, axis=0), ASPECTS)
    plain = accuracy_by_aspect(correct, ASPECTS)
    np.testing.assert_allclose(several.ci_low, plain.ci_low, atol=1e-9)
    np.testing.assert_allclose(several.ci_high, plain.ci_high, atol=1e-9)
    np.testing.assert_array_equal(several.n, replicates * plain.n)


def test_independent_answers_are_worth_all():
    """Width against that of as many independent answers, over 400 draws: within 5 %."""
    rng = np.random.default_rng(0)
    several = replicated_accuracy(rng.random((400, 8, 4, 31)) < 0.6, ASPECTS)
    width = (several.ci_high - several.ci_low)[:, -1].mean()
    low, high = wilson_interval(0.6 * 992, 992)
    # The estimated correlation is held at 0 or above: half of the draws are taken as worth a
    # little less than they are.
    assert 1.0 < width / (high - low) < 1.05


def alike_by_hand(groups):
    """Intraclass correlation of (view, replicate) answers in groups, view by view.

    One-way analysis of variance within the groups, with one more view's sum of squares: all its
    answers alike, the rarer ones of all groups, against the mean of all.
    """
    every = [answer for group in groups for view in group for answer in view]
    replicates = len(groups[0][0])
    share = sum(every) / len(every)
    between, within, freedom, views = replicates * max(share, 1 - share) ** 2, 0.0, 0, 0
    for group in groups:
        mean = sum(sum(view) for view in group) / (replicates * len(group))
        freedom += len(group) - 1
        views += len(group)
        for view in group:
            own = sum(view) / replicates
            between += replicates * (own - mean) ** 2
            within += sum((answer - own) ** 2 for answer in view)
    mean_between, mean_within = between / freedom, within / (views * (replicates - 1))
    rho = (mean_between - mean_within) / (mean_between + (replicates - 1) * mean_within)
    return min(max(rho, 0.0), 1.0)


@pytest.mark.parametrize("replicates", [2, 3, 7])
@pytest.mark.parametrize("concentration", [0.2, 2.0, 1e9])
def test_intervals_are_those_of_an_analysis_of_variance_by_hand(replicates, concentration):
    rng = np.random.default_rng(replicates)
    chance = rng.beta(concentration * 0.8, concentration * 0.2, (4, 31))
    chance[:, 20:] = chance[:, 20:] / 2  # bins that differ
    correct = rng.random((replicates, 4, 31)) < chance
    answered = rng.random((4, 31)) < 0.8
    found = replicated_accuracy(correct, ASPECTS, answered=answered)
    views = np.moveaxis(correct, 0, -1).astype(float)
    bins = [
        [views[i, j].tolist() for i in range(4) for j in range(start, stop) if answered[i, j]]
        for start, stop in ((0, 10), (10, 20), (20, 31))
    ]
    whole = [[view for group in bins for view in group]]
    rho = [alike_by_hand(bins)] * 3 + [alike_by_hand(whole)]
    if concentration < 10:
        assert 0.0 < rho[0] < 1.0 and abs(rho[0] - rho[3]) > 1e-3
    for k, group in enumerate(bins + whole):
        n = len(group) * replicates
        worth = n / (1 + (replicates - 1) * rho[k])
        low, high = wilson_interval(np.mean(group) * worth, worth)
        assert found.n[k] == n
        assert found.fraction[k] == pytest.approx(np.mean(group), abs=1e-12)
        assert found.ci_low[k] == pytest.approx(low, abs=1e-12)
        assert found.ci_high[k] == pytest.approx(high, abs=1e-12)


def test_a_wrong_answer_makes_nothing_much_surer():
    """All right are worth as many answers as views; one of 496 wrong tells little more."""
    right = np.ones((4, 4, 31), bool)
    every = replicated_accuracy(right, ASPECTS)
    np.testing.assert_allclose(every.ci_low, wilson_interval(*[[40, 40, 44, 124]] * 2)[0])
    right[0, 0, 0] = False
    one = replicated_accuracy(right, ASPECTS)
    # Where it was, the end is the same to a thousandth; elsewhere a fifth more views' worth.
    assert one.ci_low[0] == pytest.approx(every.ci_low[0], abs=1e-3)
    assert one.ci_low[3] == pytest.approx(every.ci_low[3], abs=1e-3)
    more = wilson_interval(np.array([40, 44]) * 1.2, np.array([40, 44]) * 1.2)[0]
    assert np.all((every.ci_low[1:3] < one.ci_low[1:3]) & (one.ci_low[1:3] < more))


@pytest.mark.parametrize("truth", [0.5, 0.7, 0.95])
@pytest.mark.parametrize("concentration", [0.3, 1.0, 5.0, 1e9])
def test_intervals_cover_the_truth(truth, concentration):
    """Views differ (beta), replicates scatter about them: 4,000 experiments, by bin and overall.

    At least 95 % within 4 standard errors of 0.34 %. The imaginary view makes more of it where
    answers are few or alike; near the ends Wilson's interval itself covers 97 % of as few.
    """
    rng = np.random.default_rng(1)
    shape = (4000, 1, 4, 31)
    chance = rng.beta(concentration * truth, concentration * (1 - truth), shape)
    found = replicated_accuracy(rng.random((4000, 4, 4, 31)) < chance, ASPECTS)
    covered = ((found.ci_low <= truth) & (found.ci_high >= truth)).mean(axis=0)
    assert np.all(covered > 0.95 - 4 * np.sqrt(0.95 * 0.05 / 4000))
    assert np.all(covered < (0.965 if truth < 0.9 else 0.99))
    # Taken as independent, they would not.
    n = 4 * 124
    low, high = wilson_interval(np.rint(found.fraction[:, -1] * n), n)
    independent = ((low <= truth) & (high >= truth)).mean()
    assert independent < covered[-1]
    if concentration < 5:
        assert independent < 0.85


def test_no_answers_say_nothing():
    found = replicated_accuracy(np.zeros((3, 4, 31), bool), ASPECTS, answered=False)
    assert np.isnan(found.fraction).all()
    np.testing.assert_array_equal(found.n, 0)
    np.testing.assert_array_equal(found.ci_low, 0.0)
    np.testing.assert_array_equal(found.ci_high, 1.0)


def test_what_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="boolean"):
        replicated_accuracy(np.zeros((2, 4, 31)), ASPECTS)
    with pytest.raises(ValueError, match="replicate, ship, aspect"):
        replicated_accuracy(np.zeros((4, 31), bool), ASPECTS)
    some = np.ones((2, 4, 31), bool)
    some[0, 0, 0] = False
    with pytest.raises(ValueError, match="every replicate"):
        replicated_accuracy(np.zeros((2, 4, 31), bool), ASPECTS, answered=some)

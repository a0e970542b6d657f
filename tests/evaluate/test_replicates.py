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


@pytest.mark.parametrize("concentration", [0.3, 1.0, 5.0])
def test_intervals_cover_the_truth(concentration):
    """Views differ (beta), replicates scatter about them: 1,000 experiments.

    Coverage of 95 % within 4 standard errors of 0.7 %, and 1 % for the estimated correlation.
    """
    rng = np.random.default_rng(1)
    chance = rng.beta(concentration * 0.7, concentration * 0.3, (1000, 1, 4, 31))
    found = replicated_accuracy(rng.random((1000, 4, 4, 31)) < chance, ASPECTS)
    covered = ((found.ci_low <= 0.7) & (found.ci_high >= 0.7))[:, -1].mean()
    assert abs(covered - 0.95) < 4 * np.sqrt(0.95 * 0.05 / 1000) + 0.01
    # Taken as independent, they would not.
    n = 4 * 124
    low, high = wilson_interval(np.rint(found.fraction[:, -1] * n), n)
    assert ((low <= 0.7) & (high >= 0.7)).mean() < covered


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

"""Intervals of replicated answers follow an analysis of variance, and cover the truth."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from ncti import evaluate

ASPECTS = np.arange(0.0, 91.0, 3.0)


@given(arrays(bool, (4, 31)), arrays(bool, (4, 31)))
def test_single_replicate_equals_accuracy_by_aspect(correct, answered):
    single = evaluate.replicated_accuracy(correct[None], ASPECTS, answered=answered)
    plain = evaluate.accuracy_by_aspect(correct, ASPECTS, answered=answered)
    assert single.labels == plain.labels
    for name in ("fraction", "ci_low", "ci_high", "n"):
        np.testing.assert_allclose(
            getattr(single, name), getattr(plain, name), rtol=1e-12, atol=1e-15
        )


@given(arrays(bool, (4, 31)), st.integers(2, 6))
def test_identical_replicates_count_as_one(correct, replicates):
    """Identical replicates count as one answer per view."""
    repeated = evaluate.replicated_accuracy(np.repeat(correct[None], replicates, axis=0), ASPECTS)
    plain = evaluate.accuracy_by_aspect(correct, ASPECTS)
    np.testing.assert_allclose(repeated.ci_low, plain.ci_low, atol=1e-9)
    np.testing.assert_allclose(repeated.ci_high, plain.ci_high, atol=1e-9)
    np.testing.assert_array_equal(repeated.n, replicates * plain.n)


def worth_by_hand(groups):
    """Return the effective number of independent answers of each group of views, and variances.

    Groups are {view: {draw: right}}, with tuples as draws. This is a two-way (or wider) analysis
    of variance within groups, plus the sum of squares of one imaginary view, whose answers are all
    the rarer ones. The design effect and Student's quantile follow.
    """
    all_answers = [right for group in groups for view in group.values() for right in view.values()]
    kinds = len(next(iter(next(iter(groups[0].values())))))
    views = sum(map(len, groups))
    share = np.mean(all_answers)
    rarer = len(all_answers) / views * max(share, 1 - share) ** 2
    factors = [lambda view, draw: view, *(lambda view, draw, k=k: draw[k] for k in range(kinds))]
    squares, free = np.zeros(1 + kinds), np.zeros(1 + kinds)
    spread, sizes = np.zeros(1 + kinds), []
    total, answers = 0.0, 0
    for group in groups:
        flat = [(v, d, right) for v, view in group.items() for d, right in view.items()]
        mean = np.mean([right for *_, right in flat])
        total += sum((right - mean) ** 2 for *_, right in flat)
        answers += len(flat) - 1
        sizes.append([])
        for k, level_of in enumerate(factors):
            levels = {}
            for v, d, right in flat:
                levels.setdefault(level_of(v, d), []).append(right)
            squares[k] += sum(
                len(level) * (np.mean(level) - mean) ** 2 for level in levels.values()
            )
            free[k] += len(levels) - 1
            sizes[-1].append(sum(len(level) ** 2 for level in levels.values()) / len(flat))
            spread[k] += len(flat) - sizes[-1][-1]
    error = max(total - squares.sum(), 0) / (answers - free.sum())
    squares[0] += rarer
    variance = np.maximum(squares / free - error, 0) / (spread / free)
    worth = []
    for group, size in zip(groups, sizes, strict=True):
        parts = np.array(size) * variance
        n = sum(map(len, group.values()))
        uncertain = (parts[1:] ** 2 / free[1:]).sum()
        freedom = max((error + parts.sum()) ** 2 / uncertain, 1) if uncertain else np.inf
        wider = stats.t.ppf(0.975, freedom) / stats.norm.ppf(0.975)
        count = n * (error + variance.sum()) / (error + parts.sum()) / wider**2
        worth.append(max(count, 1))
    return worth, variance


@pytest.mark.parametrize("draws", [(2,), (3,), (7,), (3, 4)])
@pytest.mark.parametrize("concentration", [0.2, 2.0, 1e9])
@pytest.mark.parametrize("effect", [0.0, 0.2])
def test_intervals_match_analysis_of_variance_by_hand(draws, concentration, effect):
    """Cases have missing views and a draw that failed as a whole."""
    rng = np.random.default_rng(draws[0])
    chance = rng.beta(concentration * 0.7, concentration * 0.3, (4, 31))
    chance[:, 20:] = chance[:, 20:] / 2  # bins that differ
    moved = effect * rng.standard_normal((*draws, 1, 1))
    correct = rng.random((*draws, 4, 31)) < chance + moved
    answered = np.broadcast_to(rng.random((4, 31)) < 0.8, correct.shape).copy()
    if draws[0] > 2:
        answered[(1,) * len(draws)] = False  # a training that failed
    score = evaluate.replicated_accuracy(correct, ASPECTS, draws=len(draws), answered=answered)
    bins = [
        {
            (i, j): {
                d: float(correct[(*d, i, j)]) for d in np.ndindex(*draws) if answered[(*d, i, j)]
            }
            for i in range(4)
            for j in range(start, stop)
            if answered[0, ..., i, j].any()
        }
        for start, stop in ((0, 10), (10, 20), (20, 31))
    ]
    pooled = {view: answers for group in bins for view, answers in group.items()}
    worth, variance = worth_by_hand(bins)
    overall, _ = worth_by_hand([pooled])
    assert concentration > 10 or variance[0] > 0
    for k, (group, count) in enumerate(zip([*bins, pooled], worth + overall, strict=True)):
        answers = [right for view in group.values() for right in view.values()]
        low, high = evaluate.wilson_interval(np.mean(answers) * count, count)
        assert score.n[k] == len(answers)
        assert score.fraction[k] == pytest.approx(np.mean(answers), abs=1e-12)
        assert score.ci_low[k] == pytest.approx(low, abs=1e-9)
        assert score.ci_high[k] == pytest.approx(high, abs=1e-9)


@pytest.mark.parametrize("truth", [0.7, 0.95])
@pytest.mark.parametrize("concentration", [0.3, 5.0, 1e9])
def test_intervals_cover_the_truth(truth, concentration):
    """Test 4,000 experiments with beta-distributed views, by bin and overall.

    Coverage is at least 95 % within 4 standard errors of 0.34 %. The imaginary view raises it for
    few or equal answers, and so do variances clipped at 0; near the ends Wilson's interval itself
    covers 97 % for as few answers.
    """
    rng = np.random.default_rng(1)
    shape = (4000, 1, 4, 31)
    chance = rng.beta(concentration * truth, concentration * (1 - truth), shape)
    score = evaluate.replicated_accuracy(rng.random((4000, 4, 4, 31)) < chance, ASPECTS)
    covered = ((score.ci_low <= truth) & (score.ci_high >= truth)).mean(axis=0)
    assert np.all(covered > 0.95 - 4 * np.sqrt(0.95 * 0.05 / 4000))
    assert np.all(covered < (0.985 if truth < 0.9 else 0.995))
    # Intervals that assume independent answers cover less.
    n = 4 * 124
    low, high = evaluate.wilson_interval(np.rint(score.fraction[:, -1] * n), n)
    independent = ((low <= truth) & (high >= truth)).mean()
    assert independent < covered[-1]
    if concentration < 5:
        assert independent < 0.85


def test_no_answers_give_nan_and_full_interval():
    score = evaluate.replicated_accuracy(np.zeros((3, 4, 31), bool), ASPECTS, answered=False)
    assert np.isnan(score.fraction).all()
    np.testing.assert_array_equal(score.n, 0)
    np.testing.assert_array_equal(score.ci_low, 0.0)
    np.testing.assert_array_equal(score.ci_high, 1.0)


@given(arrays(bool, (3, 4, 31)), arrays(bool, (3, 4, 31)))
def test_paired_differences_are_antisymmetric_and_bounded(first, second):
    forward = evaluate.paired_difference(first, second, ASPECTS)
    backward = evaluate.paired_difference(second, first, ASPECTS)
    np.testing.assert_allclose(forward.fraction, -backward.fraction)
    np.testing.assert_allclose(forward.ci_low, -backward.ci_high, atol=1e-12)
    assert (forward.ci_low <= forward.fraction).all() and (
        forward.fraction <= forward.ci_high
    ).all()
    assert (forward.ci_low + 1e-12 >= -1).all() and (forward.ci_high <= 1 + 1e-12).all()
    same = evaluate.paired_difference(first, first, ASPECTS)
    assert (same.fraction == 0).all() and (same.ci_low < 0).all() and (same.ci_high > 0).all()


@pytest.mark.parametrize("confidence", [0.95, 0.999])
@pytest.mark.parametrize(("draws", "alike"), [(1, 0.0), (1, 0.9), (4, 0.7)])
def test_paired_difference_intervals_have_nominal_coverage(draws, alike, confidence):
    """Test 2,000 experiments of 40 views with partly equal draws at level 1e-4.

    The second classifier is right in a fifth of the draws in which the first one is wrong.
    """
    rng = np.random.default_rng(11)
    view = rng.beta(2.0, 1.0, (2000, 1, 2, 20))
    draw = rng.random((2000, draws, 2, 20))
    second = np.where(rng.random(draw.shape) < alike, draw, rng.random(draw.shape))
    difference = evaluate.paired_difference(
        draw < view, second < view + 0.2 * (1 - view), np.full(20, 45.0), confidence=confidence
    )
    truth = 0.2 / 3
    covered = int(((difference.ci_low <= truth) & (truth <= difference.ci_high))[:, -1].sum())
    assert stats.binom.cdf(covered, 2000, confidence) > 1e-4, covered


def test_intervals_of_classifiers_that_agree_are_narrower():
    rng = np.random.default_rng(12)
    chance, other_chance = rng.beta(0.5, 0.5, (2, 200, 1, 2, 20))
    first, same, other = (rng.random((200, 1, 2, 20)) < c for c in (chance, chance, other_chance))
    widths = []
    for second in (same, other):
        difference = evaluate.paired_difference(first, second, np.full(20, 45.0))
        widths.append((difference.ci_high - difference.ci_low).mean())
    assert widths[0] < 0.9 * widths[1]


@settings(deadline=None, max_examples=40)
@given(
    shape=st.sampled_from([(), (2,), (3, 2)]),
    draws=st.sampled_from([(), (3,), (2, 4)]),
    at_once=st.integers(1, 2000),
    seed=st.integers(0, 2**32 - 1),
)
def test_chunked_cells_equal_a_single_pass(shape, draws, at_once, seed):
    rng = np.random.default_rng(seed)
    correct = rng.random((*shape, *draws, 3, 13)) < rng.random()
    answered = rng.random((*draws, 3, 13)) < 0.9
    given_to = {"aspects": np.arange(13) * 9.0, "draws": len(draws), "answered": answered}
    together = evaluate.replicated_accuracy(correct, **given_to)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evaluate.replicates, "AT_ONCE", at_once)
        parts = evaluate.replicated_accuracy(correct, **given_to)
    assert together.fraction.shape == (*shape, len(together.labels))
    for name in ("fraction", "ci_low", "ci_high", "n"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(together, name), err_msg=name)

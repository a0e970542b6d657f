"""Wilson intervals agree with scipy, aspect bins with the article's tables."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from ncti.evaluate import accuracy_by_aspect, aspect_bins, wilson_interval

GRID = np.arange(0.0, 91.0, 3.0)


@given(
    trials=st.integers(1, 10_000), fraction=st.floats(0.0, 1.0), confidence=st.floats(0.01, 0.999)
)
def test_wilson_interval_matches_scipy(trials, fraction, confidence):
    successes = round(fraction * trials)
    theirs = binomtest(successes, trials).proportion_ci(confidence, method="wilson")
    low, high = wilson_interval(successes, trials, confidence=confidence)
    np.testing.assert_allclose([low, high], [theirs.low, theirs.high], rtol=0, atol=1e-12)
    assert 0.0 <= low <= successes / trials <= high <= 1.0
    assert wilson_interval(8, 10) == wilson_interval(8, 10, confidence=0.95)


def test_aspect_bins_mirror_across_the_beam():
    labels, index = aspect_bins(np.arange(0.0, 361.0, 3.0))
    assert labels[:6] == ("0-27", "30-57", "60-90", "93-120", "123-150", "153-180")
    assert labels[6:] == ("183-210", "213-240", "243-270", "273-300", "303-330", "333-360")
    np.testing.assert_array_equal(np.bincount(index), [10, 10, 11] + 9 * [10])


@given(st.lists(st.floats(0.0, 360.0), min_size=1, max_size=20, unique=True), st.data())
def test_an_aspects_bin_does_not_depend_on_the_others(aspects, data):
    chosen = data.draw(st.lists(st.sampled_from(aspects), min_size=1, unique=True))
    labels, index = aspect_bins(aspects)
    assert len({*labels}) == len(labels)
    _, index_of_chosen = aspect_bins(chosen)
    numbers = index[[aspects.index(aspect) for aspect in chosen]]
    np.testing.assert_array_equal(index_of_chosen, np.unique(numbers, return_inverse=True)[1])
    order = np.argsort(aspects)
    assert np.all(np.diff(index[order]) >= 0)


def test_bin_labels_stay_unique_when_aspects_round_alike():
    assert aspect_bins([29.96, 30.02])[0] == ("29.96", "30.02")
    assert aspect_bins([0.0, 29.96, 30.04, 60.0])[0] == ("0-30", "30", "60")


def test_aspect_bins_tolerate_rounding_at_edges():
    just_below, just_above = np.nextafter(30.0, 0.0), np.nextafter(90.0, 91.0)
    np.testing.assert_array_equal(aspect_bins([0.0, just_below, just_above])[1], [0, 1, 2])


def test_unanswered_views_are_not_counted():
    rng = np.random.default_rng(0)
    correct, answered = rng.random((2, 3, 4, 31)) < 0.6
    answered[1, :, :10] = False
    answered[2] = False
    score = accuracy_by_aspect(correct, GRID, answered=answered)
    right = [np.mean(row[there]) for row, there in zip(correct[:2], answered, strict=False)]
    np.testing.assert_allclose(score.fraction[:, -1], [*right, np.nan])
    np.testing.assert_array_equal(score.n[:, -1], answered.sum(axis=(-2, -1)))
    assert np.isnan(score.fraction[1, 0])
    assert (score.n[1, 0], score.ci_low[1, 0], score.ci_high[1, 0]) == (0, 0.0, 1.0)
    # The values in place of missing answers do not matter.
    np.testing.assert_array_equal(
        accuracy_by_aspect(correct | ~answered, GRID, answered=answered).fraction, score.fraction
    )

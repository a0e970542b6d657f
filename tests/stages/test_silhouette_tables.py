"""Tables of silhouettes named by the Adaptive Clustering Network, against numbers by hand."""

import warnings

import numpy as np
import pytest
import xarray as xr
from infrared_channel import choose

from ncti.evaluate import replicated_accuracy
from sweeps.stages.acn import tabulate_silhouettes

NAMED, SEEN = ["duncan", "texas"], [0.0, 15.0, 45.0]  # pooled as 0-15 and 45

# Right answers by ship (down) and aspect (across) at two phases and two orders.
RIGHT = [
    [[[1, 1, 1], [1, 1, 1]], [[1, 0, 1], [1, 0, 0]]],
    [[[0, 0, 0], [0, 0, 1]], [[1, 1, 0], [1, 1, 0]]],
]
# The same by bin: 4/4, 2/4, 0/4, 4/4 and 2/2, 1/2, 1/2, 0/2 and 6/6, 3/6, 1/6, 4/6.
MEAN, SPREAD, N = [5 / 8, 1 / 2, 7 / 12], [0.414578, 0.353553, 0.300463], [16, 8, 24]


@pytest.fixture(autouse=True)
def no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        yield


def interval(right):
    """Ends of the intervals of (phase, order, ship, aspect) answers, as of two kinds of draws."""
    found = replicated_accuracy(
        np.equal(right, 1), SEEN, draws=2, answered=np.greater_equal(right, 0)
    )
    return found.ci_low, found.ci_high


def classified(right, formed=((2, 3), (4, 3))):
    """Answers as a store has them: one test, whose training is as right; -1 is no answer."""
    right = np.asarray(right, dtype="i1")
    there = right >= 0
    # Categories 0 to formed - 1, in turn.
    category = np.arange(6).reshape(2, 3) % np.asarray(formed)[:, :, None, None]
    trainings = ("phase", "order", "vigilance", "ship", "aspect")
    tests = ("phase", "order", "vigilance", "range", "super_resolution", "frame_count")
    return xr.Dataset(
        {
            "training_category": (trainings, np.where(there, category, -1)[:, :, None]),
            "training_correct": (trainings, right[:, :, None]),
            "training_confused": (trainings, np.where(there, 0, -1)[:, :, None]),
            "correct": ((*tests, "ship", "aspect"), right[:, :, None, None, None, None]),
            "passes": (trainings[:3], np.where(there.any((2, 3)), 5, 0)[:, :, None]),
        },
        {
            "ship": NAMED,
            "aspect": SEEN,
            "phase": [0, 1],
            "order": [0, 1],
            "vigilance": [0.87],
            "range": [50.0],
            "super_resolution": ["shifted"],
            "frame_count": [16],
            "learning_rate": 0.1,
        },
    )


def tabulated(right, **given):
    choices = choose(grid__ship=NAMED, grid__aspect=SEEN, classifier__name="acn", **given)
    return tabulate_silhouettes(classified(right), choices)


def without(phase=None, aspect=None):
    """Those answers without a phase or an aspect."""
    right = np.array(RIGHT, dtype="i1")
    if phase is not None:
        right[phase] = -1
    if aspect is not None:
        right[..., aspect] = -1
    return right


def accuracy(tables, prefix):
    """Mean, spread, both ends of the interval and number, by bin, of the one cell."""
    names = ("accuracy", "spread", "ci_low", "ci_high", "n")
    return [tables[prefix + name].values.reshape(-1) for name in names]


@pytest.mark.parametrize("prefix", ["", "training_"])
def test_mean_spread_interval_and_number(prefix):
    tables = tabulated(RIGHT)
    assert tables.aspect_bin.values.tolist() == ["0-15", "45", "overall"]
    mean, spread, low, high, n = accuracy(tables, prefix)
    np.testing.assert_allclose(mean, MEAN, rtol=1e-12)
    np.testing.assert_allclose(spread, SPREAD, atol=1e-6)
    assert n.tolist() == N
    np.testing.assert_array_equal((low, high), interval(RIGHT))


@pytest.mark.parametrize("prefix", ["", "training_"])
@pytest.mark.parametrize(
    ("failed", "means", "spreads"),
    [(0, [1 / 2, 1 / 4, 5 / 12], [1 / 2, 1 / 4, 1 / 4]), (1, [3 / 4] * 3, [1 / 4] * 3)],
)
def test_a_phase_that_failed_is_left_out(prefix, failed, means, spreads):
    mean, spread, low, high, n = accuracy(tabulated(without(phase=failed)), prefix)
    np.testing.assert_allclose(mean, means, rtol=1e-12)
    np.testing.assert_allclose(spread, spreads, rtol=1e-12)
    assert n.tolist() == [8, 4, 12]  # of the other phase
    np.testing.assert_array_equal((low, high), interval(without(phase=failed)))


@pytest.mark.parametrize("prefix", ["", "training_"])
def test_a_bin_without_answers_is_unknown_and_the_others_stand(prefix):
    mean, spread, low, high, n = accuracy(tabulated(without(aspect=2)), prefix)
    np.testing.assert_allclose(mean, [MEAN[0], np.nan, MEAN[0]], rtol=1e-12)
    np.testing.assert_allclose(spread, [SPREAD[0], np.nan, SPREAD[0]], atol=1e-6)
    assert n.tolist() == [16, 0, 16]
    assert (low[1], high[1]) == (0, 1)  # nothing is known
    np.testing.assert_array_equal((low, high), interval(without(aspect=2)))


def test_nothing_answered_at_all():
    tables = tabulated(np.full((2, 2, 2, 3), -1))
    mean, spread, low, high, n = accuracy(tables, "")
    assert np.isnan(mean).all() and np.isnan(spread).all()
    assert n.tolist() == [0, 0, 0]
    assert (low == 0).all() and (high == 1).all()
    assert not tables.category_count.any() and not tables.settled.any()


def test_categories_are_those_of_the_trainings_there_are():
    tables = tabulated(without(phase=0))
    np.testing.assert_array_equal(tables.category_count[..., 0], [[0, 0], [4, 3]])
    np.testing.assert_array_equal(tables.view_count[..., 0], [[0, 0], [6, 6]])
    np.testing.assert_array_equal(tables.settled[..., 0], [[0, 0], [1, 1]])


def test_unknown_ships_are_not_in_the_tables():
    mean, _, _, _, n = accuracy(tabulated(RIGHT, classifier__unknown="texas"), "")
    assert n.tolist() == [8, 4, 12]
    # Of duncan alone: 2/2, 1/2, 0/2, 2/2 and 1, 1, 0, 0.
    np.testing.assert_allclose(mean[:2], [5 / 8, 1 / 2])

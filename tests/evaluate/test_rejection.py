"""The table of rejections of ships absent from training agrees with counts by hand."""

import numpy as np
import pytest
import xarray as xr
from memory import peak_memory
from sklearn.metrics import roc_auc_score

from ncti.evaluate import rejection, replicated_accuracy, tabulate_rejection, wilson_interval


def tabulate(classified, learned, vigilances):
    """Return the rejection table of learned (ship, aspect) views, and of those between."""
    aspects = xr.DataArray(learned.any(axis=0), dims="aspect")
    known = xr.DataArray(learned.any(axis=1), dims="ship")
    kinds = {"learned": aspects, "between": ~aspects}
    return tabulate_rejection(classified, known, kinds, vigilances)


def test_fractions_are_counted_by_hand():
    """Test two known ships at two learned aspects and one between, an unknown one, two draws."""
    learned = np.array([[1, 0, 1], [1, 0, 1], [0, 0, 0]], bool)
    similarity = np.array(
        [
            [[0.9, 0.8, 0.7], [0.6, 0.5, 0.4], [0.65, 0.55, 0.3]],
            [[0.9, 0.2, 0.7], [0.6, 0.5, 0.9], [0.95, 0.1, 0.3]],
        ]
    )
    correct = np.array(
        [
            [[1, 1, 0], [1, 0, 1], [0, 0, 0]],
            [[1, 1, 1], [0, 0, 1], [0, 0, 0]],
        ]
    )
    correct[:, 1, 2] = -1  # a view that failed
    dims = ("replicate", "ship", "aspect")
    classified = xr.Dataset({"similarity": (dims, similarity), "correct": (dims, correct)})
    table = tabulate(classified, learned, (0.0, 0.6, 1.0))
    row = table.sel(aspects="learned")
    # Learned aspects of known ships: six answers, as one view failed; four of unknown ones.
    assert row.n_known == 6
    assert row.n_unknown == 4
    np.testing.assert_allclose(row.correct_known, [4 / 6, 4 / 6, 0])
    np.testing.assert_allclose(row.rejected_known, [0, 0, 1])
    np.testing.assert_allclose(row.rejected_unknown, [0, 2 / 4, 1])
    row = table.sel(aspects="between")
    assert (row.n_known, row.n_unknown) == (4, 2)
    np.testing.assert_allclose(row.correct_known, [2 / 4, 1 / 4, 0])
    np.testing.assert_allclose(row.rejected_known, [0, 3 / 4, 1])
    np.testing.assert_allclose(row.rejected_unknown, [0, 1, 1])


def test_operating_characteristic_matches_counts_by_hand():
    """Test eight answers each to known and unknown ships, with ties between and among them."""
    learned = np.array([[True] * 4] * 2 + [[False] * 4] * 2)
    similarity = np.array(
        [
            *([0.9, 0.8, 0.7, 0.4], [0.95, 0.6, 0.6, 0.2]),
            *([0.1, 0.3, 0.5, 0.6], [0.6, 0.7, 0.8, 0.85]),
        ]
    )
    correct = np.array([[1, 1, 0, 1], [1, 1, 1, 1], *[[0] * 4] * 2])
    dims = ("ship", "aspect")
    classified = xr.Dataset({"similarity": (dims, similarity), "correct": (dims, correct)})
    table = tabulate(classified, learned, (0.5,)).sel(aspects="learned")
    # Sorted unknown: .1 .3 .5 .6 .6 .7 .8 .85; of eight 0, 4, 7 (of 6.4), 8 (of 7.2 and 7.6).
    np.testing.assert_array_equal(table.min_rejected, [0, 0.5, 0.8, 0.9, 0.95])
    np.testing.assert_allclose(table.rejected_up_to, [np.nan, 0.6, 0.8, 0.85, 0.85])
    # Right answers above: all 7; .9 .8 .95; .9 .95; the same two.
    np.testing.assert_allclose(table.correct_where_rejected, np.array([7, 3, 2, 2, 2]) / 8)
    low, high = wilson_interval([7, 3, 2, 2, 2], 8)
    np.testing.assert_allclose(table.correct_where_rejected_ci_low, low)
    np.testing.assert_allclose(table.correct_where_rejected_ci_high, high)
    pairs = sum(
        (known > unknown) + 0.5 * (known == unknown)
        for known in similarity[:2][correct[:2] == 1]
        for unknown in similarity[2:].ravel()
    )
    assert table.oscr == pytest.approx(pairs / 64)
    assert table.auroc == pytest.approx(roc_auc_score(np.repeat([1, 0], 8), similarity.ravel()))
    nothing = tabulate(classified, learned, (0.5,)).sel(aspects="between")
    assert np.isnan(nothing.oscr)
    assert np.isnan(nothing.auroc)
    assert np.isnan(nothing.correct_where_rejected).all()


FIGURES = ("rejected_unknown", "rejected_known", "correct_known")
LEARNED = np.array([[True] * 20] * 3 + [[False] * 20] * 2)


def answers_of(*draws, seed=0):
    """Return random answers to five ships at 20 aspects, the last two ships unknown."""
    rng = np.random.default_rng(seed)
    dims = (*draws, "ship", "aspect")
    shape = (*(3 for _ in draws), 5, 20)
    right = rng.integers(0, 2, shape) * LEARNED.any(axis=1)[:, None]
    return xr.Dataset({"similarity": (dims, rng.random(shape)), "correct": (dims, right)})


@pytest.mark.parametrize("draws", [("replicate",), ("phase", "order"), ("replicate", "order")])
def test_accepting_all_answers_equals_replicated_accuracy(draws):
    """If all answers are accepted, fractions equal `replicated_accuracy`, with a failed draw."""
    answers = answers_of(*draws)
    failed = (0,) * len(draws)
    answers.correct[failed] = -1
    answers.similarity[failed] = np.nan
    table = tabulate(answers, LEARNED, (0.0, 0.5)).sel(aspects="learned")
    number = answers.correct[..., 0, 0].size - 1
    assert (table.n_known, table.n_unknown) == (number * 60, number * 40)
    known = answers.correct.isel(ship=slice(3)).values
    accuracy = replicated_accuracy(known == 1, np.zeros(20), draws=len(draws), answered=known >= 0)
    accepted = table.sel(test_vigilance=0)
    np.testing.assert_allclose(accepted.correct_known, accuracy.fraction[-1])
    np.testing.assert_allclose(accepted.correct_known_ci_low, accuracy.ci_low[-1])
    np.testing.assert_allclose(accepted.correct_known_ci_high, accuracy.ci_high[-1])
    for name in FIGURES:
        assert (table[f"{name}_ci_low"] <= table[name]).all()


def many(aspects):
    """Return answers about five known ships and an unknown one, with half the aspects learned."""
    rng = np.random.default_rng(aspects)
    dims, shape = ("ship", "aspect"), (6, aspects)
    classified = xr.Dataset(
        {
            "similarity": (dims, rng.random(shape, dtype=np.float32)),
            "correct": (dims, rng.integers(-1, 2, shape, dtype=np.int8)),
        }
    )
    learned = (np.arange(6)[:, None] < 5) & (np.arange(aspects) % 2 == 0)
    return classified, learned


def test_chunked_levels_equal_a_single_pass(monkeypatch):
    together = tabulate(*many(20), np.linspace(0, 1, 11))
    monkeypatch.setattr(rejection, "AT_ONCE", 500)
    xr.testing.assert_identical(tabulate(*many(20), np.linspace(0, 1, 11)), together)


def test_rejection_memory_does_not_grow_with_levels(monkeypatch):
    monkeypatch.setattr(rejection, "AT_ONCE", 2**17)

    def peak(levels):
        classified, learned = many(2_000)
        return peak_memory(lambda: tabulate(classified, learned, np.linspace(0, 1, levels)))

    peak(2)  # imports
    assert peak(100) < 1.5 * peak(25)  # of 12,000 answers, more than are taken at one time

"""Tables of the benchmark have the right figures for answers that are known."""

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from docs._tables import splits
from studies.benchmark.summary import tabulate_differences, tabulate_rows

SHIPS = ["duncan", "texas"]
SEEDS, ROWS = 10, 60
DIMS = ("split", "seed", "row")
COORDS = {"split": ["aspect-random", "unknown-near"], "seed": np.arange(SEEDS)}


@pytest.fixture(scope="module")
def tests():
    """Return two splits: the second has 20 rows of an unknown ship, which the first lacks."""
    rng = np.random.default_rng(3)
    shape = 2, SEEDS, ROWS
    true = rng.integers(0, 2, shape)
    true[0, :, 40:], true[1, :, 40:] = -2, -1
    view = np.broadcast_to(np.arange(ROWS) // 2, shape)
    data = {"true_ship": true, "true_aspect": rng.uniform(0, 180, shape), "view": view}
    return xr.Dataset({name: (DIMS, values) for name, values in data.items()}, COORDS)


def answered(tests, right, seed):
    """Return answers that are right with some probability, which they state."""
    rng = np.random.default_rng(seed)
    true = np.maximum(tests.true_ship.values, 0)
    named = np.where(rng.random(true.shape) < right, true, 1 - true)
    likely = np.where(named[..., None] == np.arange(2), right, 1 - right)
    unknown = tests.true_ship.values == -1
    data = {"predicted": (DIMS, named), "probability": ((*DIMS, "ship"), likely)}
    data["similarity"] = (DIMS, np.where(unknown, 0.0, 1.0) + 0.0 * named)
    return xr.Dataset(data, COORDS | {"ship": SHIPS})


def test_figures_are_means_over_seeds_with_students_intervals(tests):
    answers = answered(tests, 0.7, 1)
    table = tabulate_rows(answers, tests).sel(split="aspect-random")
    right = (answers.predicted == tests.true_ship).values[0, :, :40].mean(axis=1)
    low, high = stats.t.interval(0.95, SEEDS - 1, right.mean(), stats.sem(right))
    figures = (table.accuracy, table.accuracy_low, table.accuracy_high)
    np.testing.assert_allclose([float(one) for one in figures], [right.mean(), low, high])
    assert table.accuracy_n == 40 * SEEDS
    np.testing.assert_allclose(table.confusion.sum("ship_named"), 1.0)
    # Shares scatter about the stated 0.7; log loss has a closed form.
    assert table.ece == pytest.approx(abs(right - 0.7).mean(), abs=1e-9)
    loss = -(right * np.log(0.7) + (1 - right) * np.log(0.3)).mean()
    assert table.log_loss == pytest.approx(loss)
    assert np.isnan(table.auroc)


def test_unknown_ships_count_for_rejection_but_not_for_accuracy(tests):
    answers = answered(tests, 0.7, 1)
    table = tabulate_rows(answers, tests).sel(split="unknown-near")
    assert table.accuracy_n == 40 * SEEDS
    assert table.auroc == 1.0
    # All known ships are accepted, so that all right answers are kept.
    assert table.kept == pytest.approx(float(table.accuracy))


def test_differences_are_paired(tests):
    worse, better = answered(tests, 0.6, 1), answered(tests, 0.8, 2)
    table = tabulate_differences(better, worse, tests)
    right = [
        (one.predicted == tests.true_ship).values[..., :40].mean(-1) for one in (worse, better)
    ]
    np.testing.assert_allclose(table.difference, (right[1] - right[0]).mean(axis=1))
    assert (table.p_value < 1e-4).all() and (table.difference_low > 0).all()
    same = tabulate_differences(better, better, tests)
    assert (same.difference == 0).all() and (same.p_value == 1).all()


def test_tables_have_every_classifier_and_the_ranking_of_held_out_seeds(tests):
    shares = dict(zip(splits.TITLES, np.linspace(0.95, 0.6, len(splits.TITLES)), strict=True))
    groups = {splits.TESTS.path: tests} | {
        f"benchmark/{name}": answered(tests, share, 5) for name, share in shares.items()
    }
    made = splits.tables_of(groups, 3)
    assert [row["what"] for row in made["splits"].rows] == [*splits.TITLES.values()]
    assert len(made["differences"].rows) == len(splits.TITLES) - 1
    ranking = made["ranking"].rows[0]
    # They share a stream of errors, so that every seed ranks them as their shares do.
    assert ranking["order"] == ", ".join(splits.TITLES.values())
    assert (ranking["tau"], ranking["swaps"]) == ("1.00", "none")


def test_kendalls_tau_counts_the_pairs_that_swap():
    tau, swaps = splits.kendall(np.array([4.0, 3.0, 2.0, 1.0]), np.array([3.0, 4.0, 2.0, 1.0]))
    assert swaps == [(0, 1)] and tau == pytest.approx(1 - 2 / 6)

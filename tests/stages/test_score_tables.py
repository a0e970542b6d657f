"""Views learned, and tables of percent correct, are as counted by hand."""

import numpy as np
import pytest
import xarray as xr
from range_channel import choose

from ncti.evaluate import replicated_accuracy, wilson_interval
from sweeps.stages import classifier
from sweeps.stages.classifier import AspectSelection, tabulate_answers, training_views

GRID = {"grid__ship": ["duncan", "horne", "texas"], "grid__aspect": [0, 15, 45]}


def test_training_excludes_unknown_ships_and_other_aspects():
    choices = choose(**GRID, classifier__unknown="horne", classifier__training_aspect=[45, 0])
    expected = [[1, 0, 1], [0, 0, 0], [1, 0, 1]]
    np.testing.assert_array_equal(classifier.training_view_mask(choices), expected)
    views = training_views(("a", "b"), (0.0, 1.5), ("b",), AspectSelection(None, None, ()))
    np.testing.assert_array_equal(views, [[1, 1], [0, 0]])


def answers(**arrays):
    """Return answers about three ships at three aspects."""
    dims = {2: ("ship", "aspect"), 3: ("replicate", "ship", "aspect")}
    return xr.Dataset(
        {name: (dims[np.ndim(values)], values) for name, values in arrays.items()},
        {"ship": ["duncan", "horne", "texas"], "aspect": [0.0, 15.0, 45.0]},
    )


def test_fractions_are_counted_by_hand():
    """The second ship is unknown, and a view of the third is lost."""
    correct = np.array([[1, 0, 1], [0, 0, 0], [1, -1, 0]])
    trained = np.array([[1, 1, 0], [-1, -1, -1], [1, 1, 1]])
    choices = choose(**GRID, classifier__unknown="horne")
    table = tabulate_answers(answers(correct=correct, training_correct=trained), choices)
    assert list(table.aspect_bin.values) == ["0-15", "45", "overall"]
    assert table.aspect_bin.attrs["aspect_low"] == [0, 45]
    np.testing.assert_array_equal(table.n, [3, 2, 5])
    np.testing.assert_allclose(table.accuracy, [2 / 3, 1 / 2, 3 / 5])
    low, high = wilson_interval([2, 1, 3], [3, 2, 5])
    np.testing.assert_allclose(table.ci_low, low)
    np.testing.assert_allclose(table.ci_high, high)
    np.testing.assert_array_equal(table.training_n, [4, 2, 6])
    np.testing.assert_allclose(table.training_accuracy, [1, 1 / 2, 5 / 6])
    assert "ship_accuracy" not in table and "category_count" not in table
    assert table.attrs == {"receiver": "full_profile"}
    for name, array in table.data_vars.items():
        assert array.attrs["units"] == "1" and array.attrs["long_name"], name


@pytest.mark.parametrize("prefix", ["", "training_"])
@pytest.mark.parametrize(
    ("lost", "mean", "spread"),
    [
        (None, [5 / 8, 1 / 2, 7 / 12], [0.414578, 0.353553, 0.300463]),
        (0, [1 / 2, 1 / 4, 5 / 12], [1 / 2, 1 / 4, 1 / 4]),
        (1, [3 / 4] * 3, [1 / 4] * 3),
    ],
)
def test_draws_are_summarised_by_mean_and_spread(prefix, lost, mean, spread):
    """Right are 4/4, 2/4, 0/4, 4/4 and 2/2, 1/2, 1/2, 0/2, at two phases in two orders."""
    right = np.array(
        [
            [[[1, 1, 1], [1, 1, 1]], [[1, 0, 1], [1, 0, 0]]],
            [[[0, 0, 0], [0, 0, 1]], [[1, 1, 0], [1, 1, 0]]],
        ]
    )
    if lost is not None:
        right[lost] = -1
    dims, ships = ("phase", "order", "ship", "aspect"), ["duncan", "texas"]
    classified = xr.Dataset(
        {f"{prefix}correct": (dims, right)}, {"ship": ships, "aspect": [0.0, 15.0, 45.0]}
    )
    choices = choose(grid__ship=ships, grid__aspect=[0, 15, 45])
    table = tabulate_answers(classified, choices, "silhouettes")
    np.testing.assert_allclose(table[f"{prefix}accuracy"], mean, rtol=1e-12)
    np.testing.assert_allclose(table[f"{prefix}spread"], spread, atol=1e-6)
    np.testing.assert_array_equal(
        table[f"{prefix}n"], np.array([16, 8, 24]) // (2 - (lost is None))
    )
    expected = replicated_accuracy(right == 1, [0.0, 15.0, 45.0], draws=2, answered=right >= 0)
    for name, values in (("ci_low", expected.ci_low), ("ci_high", expected.ci_high)):
        np.testing.assert_array_equal(table[prefix + name], values)


def test_categories_are_counted():
    category = np.array([[0, 1, 1], [-1, -1, -1], [2, 2, 0]])
    classified = answers(correct=np.ones((3, 3), int), training_category=category)
    for passes, settled in ((4, 1), (-4, 0)):
        choices = choose(**GRID, classifier__unknown="horne")
        table = tabulate_answers(classified.assign(passes=passes), choices)
        assert (table.category_count, table.view_count, table.settled) == (3, 6, settled)

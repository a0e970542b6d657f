"""Category formation on hand-made examples."""

from __future__ import annotations

import numpy as np
import pytest

from ncti.evaluate import category_formation


def test_a_category_is_confused_where_another_ship_shares_it():
    formation = category_formation(
        labels=[0, 0, 2, 1, 2, 2],
        ships=["horne", "horne", "horne", "duncan", "duncan", "duncan"],
        aspects=[0, 45, 90, 0, 45, 90],
    )
    np.testing.assert_array_equal(formation.ships, ["duncan", "horne"])
    np.testing.assert_array_equal(formation.aspects, [0.0, 45.0, 90.0])
    np.testing.assert_array_equal(formation.category, [[1, 2, 2], [0, 0, 2]])
    np.testing.assert_array_equal(formation.confused, [[False, True, True], [False, False, True]])


def test_the_order_of_the_views_does_not_matter():
    rng = np.random.default_rng(0)
    ships, aspects = (axis.ravel() for axis in np.meshgrid(np.arange(4), GRID, indexing="ij"))
    labels = rng.integers(0, 60, ships.shape)
    order = rng.permutation(len(labels))
    plain = category_formation(labels, ships, aspects)
    shuffled = category_formation(labels[order], ships[order], aspects[order])
    np.testing.assert_array_equal(shuffled.category, plain.category)
    np.testing.assert_array_equal(shuffled.confused, plain.confused)
    for (ship, aspect), confused in np.ndenumerate(plain.confused):
        others = np.delete(plain.category, ship, axis=0)
        assert confused == (plain.category[ship, aspect] in others)


GRID = np.arange(0.0, 91.0, 3.0)


def test_views_that_are_missing_or_have_no_category_are_marked():
    formation = category_formation([-1, 4, -7], [0, 0, 1], [0.0, 3.0, 0.0])
    np.testing.assert_array_equal(formation.category, [[-1, 4], [-1, -1]])
    assert not formation.confused.any()


def test_views_that_make_no_grid_are_refused():
    with pytest.raises(ValueError, match="one length"):
        category_formation([0], [0, 1], [0.0, 0.0])
    with pytest.raises(ValueError, match="integers"):
        category_formation([0.5], [0], [0.0])
    with pytest.raises(ValueError, match="duncan 2 times at 3 deg"):
        category_formation([0, 1], ["duncan", "duncan"], [3.0, 3.0])

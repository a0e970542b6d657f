"""Category formation counts confusions correctly in small examples."""

from __future__ import annotations

import numpy as np

from ncti.evaluate import category_formation


def test_category_shared_by_two_ships_is_confused():
    formation = category_formation(
        labels=[0, 0, 2, 1, 2, 2],
        ships=["horne", "horne", "horne", "duncan", "duncan", "duncan"],
        aspects=[0, 45, 90, 0, 45, 90],
    )
    np.testing.assert_array_equal(formation.ships, ["duncan", "horne"])
    np.testing.assert_array_equal(formation.aspects, [0.0, 45.0, 90.0])
    np.testing.assert_array_equal(formation.category, [[1, 2, 2], [0, 0, 2]])
    np.testing.assert_array_equal(formation.confused, [[False, True, True], [False, False, True]])


def test_views_that_are_missing_or_have_no_category_are_marked():
    formation = category_formation([-1, 4, -7], [0, 0, 1], [0.0, 3.0, 0.0])
    np.testing.assert_array_equal(formation.category, [[-1, 4], [-1, -1]])
    assert not formation.confused.any()

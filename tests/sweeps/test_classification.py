"""The Adaptive Clustering Network in one cell, on a handful of vectors, by hand."""

import numpy as np
import pytest

from sweeps.classification import NONE, classify
from sweeps.classifier_schema import ClassifierConfig


def unit(degrees):
    return np.stack([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))], axis=-1)


def classified(training, tests, there, orders, **settings):
    answers = classify(
        unit(np.array(training, dtype=float)),
        unit(np.array(tests, dtype=float)),
        np.array(there, dtype=bool),
        orders=[np.array(order) for order in orders],
        vigilances=(settings.pop("vigilance", 0.95),),
        classifier=ClassifierConfig(**settings),
    )
    return {name: values[:, 0, 0] for name, values in answers.items()}


def test_categories_are_named_by_who_is_presented_first():
    """Four views in two directions, a ship each in both: the order alone decides."""
    answers = classified(
        training=[0, 90, 1, 91],
        tests=[0, 90, 1, 91],
        there=[[1, 1], [1, 1]],
        orders=([0, 1, 2, 3], [2, 1, 3, 0], [3, 2, 1, 0]),
        label_rule="first",
    )
    # Ship of the first presented near 0 deg (views 0 and 2), near 90 deg (views 1 and 3).
    for order, (east, north) in enumerate(((0, 0), (1, 0), (1, 1))):
        found = answers["predicted"][order, 0]
        np.testing.assert_array_equal(found, [[east, north], [east, north]])
        correct = [[east == 0, north == 0], [east == 1, north == 1]]
        np.testing.assert_array_equal(answers["correct"][order, 0, 0], correct)
        np.testing.assert_array_equal(answers["training_correct"][order, 0], correct)


def test_what_was_never_learned_has_no_category_to_fall_into():
    """A view between learned ones and a ship that nobody taught: named, but right by no rule."""
    answers = classified(
        training=[0, 45, 90, 2, 30, 60],
        tests=[90, 45, 90, 2, 30, 60],
        there=[[1, 1, 1], [1, 1, 1]],
        orders=([0, 2],),
        score_rule=["ship", "category"],
    )
    assert NONE == -1
    np.testing.assert_array_equal(answers["correct"][0, 0, 0], [[1, 1, 1], [0, 0, 0]])
    np.testing.assert_array_equal(answers["correct"][0, 0, 1], [[0, -1, 1], [-1, -1, -1]])
    np.testing.assert_array_equal(answers["category"][0], [[1, 0, 1], [0, 0, 1]])


@pytest.mark.parametrize("unknown", [0, 1])
def test_unknown_ships_move_no_category_of_known_ones(unknown):
    """Whatever they look like, and wherever they stand among the ships."""
    known = 1 - unknown
    training = np.array([[0.0, 90.0], [0.0, 90.0]])
    rows = [2 * known, 2 * known + 1]

    def answers(angle):
        tests = np.array([[3.0, 80.0], [3.0, 80.0]])
        tests[unknown] = angle, angle + 1
        return classified(
            training.ravel(),
            np.stack([tests.ravel(), tests.ravel() + 5]),
            [[1, 1], [1, 1]],
            orders=(rows,),
            learn_in_test=True,
            learning_rate=0.5,
        )

    first, second = answers(40.0), answers(-20.0)
    for name in ("category", "similarity", "predicted", "correct"):
        np.testing.assert_array_equal(
            first[name][..., known, :], second[name][..., known, :], err_msg=name
        )
    # They meet categories that known ones have moved half the way: from 0 to 1.5 deg, then 4 deg.
    of_known = np.cos(np.radians([3.0, 10.0]))
    np.testing.assert_allclose(first["similarity"][0, 0, known], of_known, atol=1e-3)
    moved = np.cos(np.radians(40.0 - 1.5))
    assert first["similarity"][0, 0, unknown, 0] == pytest.approx(moved, abs=1e-6)

"""Nearest neighbour by correlation handles ties, zero vectors and excluded templates."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.utils.estimator_checks import parametrize_with_checks

from ncti.classify import CorrelationNeighbour


@parametrize_with_checks([CorrelationNeighbour()])
def test_it_is_a_scikit_learn_classifier(estimator, check):
    check(estimator)


def test_ties_go_to_the_first_template():
    """Repeats take all places in a blocked product, as rounding may differ by place."""
    rng = np.random.default_rng(6)
    X = np.tile(rng.standard_normal((5, 250)), (11, 1)) * rng.uniform(0.1, 9.0, (55, 1))
    tests = rng.standard_normal((200, 250))
    template, _ = CorrelationNeighbour().fit(X, np.arange(55) % 5).match(tests)
    assert template.max() < 5
    template, _ = CorrelationNeighbour().fit(np.eye(2), ["north", "east"]).match([[1.0, 1.0]])
    assert template == [0]


def test_zero_vectors_match_nothing():
    X = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, -1.0]])
    neighbour = CorrelationNeighbour().fit(X, ["void", "east", "south"])
    template, similarity = neighbour.match([[0.0, 0.0], [-1.0, 1e-9], [-1.0, 1.0]])
    # The zero template has the largest cosine, 0, and yet does not match.
    np.testing.assert_array_equal(template, [-1, 2, 1])
    np.testing.assert_allclose(similarity, [0, -1e-9, -np.sqrt(0.5)], rtol=1e-12)
    assert neighbour.predict([[0.0, 0.0]]) == ["void"]
    with pytest.raises(ValueError, match="only zero vectors"):
        CorrelationNeighbour().fit(np.zeros((2, 3)), [0, 1])


@pytest.mark.parametrize("shape", [(9, 30), (30,), (1, 9)])
def test_exclude_of_wrong_shape_is_refused(shape):
    """`test_blocks` compares the answers with those of all cosines."""
    rng = np.random.default_rng(7)
    neighbour = CorrelationNeighbour().fit(rng.standard_normal((9, 20)), np.arange(9))
    with pytest.raises(ValueError, match=r"^exclude has shape .* \(9,\) or \(30, 9\)"):
        neighbour.match(rng.standard_normal((30, 20)), exclude=np.zeros(shape, bool))

"""The Adaptive Clustering Network follows its plain rule and the consequences of the rule."""

from __future__ import annotations

import numpy as np
import pytest
from plain_network import plain_network
from sklearn.utils.estimator_checks import parametrize_with_checks

from ncti.classify import AdaptiveClusteringNetwork


@parametrize_with_checks([AdaptiveClusteringNetwork()])
def test_it_is_a_scikit_learn_classifier(estimator, check):
    check(estimator)


def on_a_circle(*degrees):
    angle = np.radians(degrees)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def fit(X, y=None, **parameters) -> AdaptiveClusteringNetwork:
    return AdaptiveClusteringNetwork(**parameters).fit(X, np.zeros(len(X)) if y is None else y)


@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
@pytest.mark.parametrize("seed", range(20))
def test_categories_match_plain_rule_for_any_vector_norm(seed):
    rng = np.random.default_rng(seed)
    X = rng.random((60, 5)) * 10.0 ** rng.uniform(-3.0, 3.0, (60, 1))
    X /= X.max()
    vigilance, learning_rate = rng.choice([0.5, 0.9, 0.97]), rng.choice([0.05, 0.3, 1.0])
    traces, assigned, n_passes, converged = plain_network(X, vigilance, learning_rate, 30)
    network = fit(X, vigilance=vigilance, learning_rate=learning_rate, max_passes=30)
    live, renumbered = np.unique(assigned, return_inverse=True)
    assert (network.n_passes_, network.converged_) == (n_passes, converged)
    np.testing.assert_array_equal(network.labels_, renumbered)
    # A few hundred updates, each good to a few units in the last place.
    np.testing.assert_allclose(network.categories_, traces[live], rtol=0, atol=1e-12)


def test_oldest_category_wins_ties():
    network = fit(np.eye(2), y=["north", "east"])
    assert network.predict([[1.0, 1.0]]) == ["north"]


def test_category_label_is_the_first_most_frequent_ship():
    X = on_a_circle(0, 1, 2, 90, 91)
    network = fit(X, y=["texas", "duncan", "texas", "roberts", "horne"], vigilance=0.9)
    np.testing.assert_array_equal(network.category_labels_, ["texas", "horne"])


def test_categories_without_vectors_are_dropped():
    # The first two found a category half-way between them; the others found neighbours on
    # both sides and draw them closer, so that on the second pass each of the first two leaves.
    X = on_a_circle(20, 39.8, 9.7, 19.5, 50.1, 40.4)
    vigilance = np.cos(np.radians(20))
    traces, assigned, *_ = plain_network(X, vigilance, 0.5)
    assert len(traces) == 3
    assert set(assigned) == {1, 2}
    network = fit(X, vigilance=vigilance, learning_rate=0.5)
    np.testing.assert_array_equal(network.labels_, [0, 1, 0, 0, 1, 1])
    assert network.n_categories_ == len(network.categories_) == 2
    np.testing.assert_allclose(network.categories_, traces[1:], rtol=1e-14)
    # The lost category's vector lies at 29.9 deg, where it would have answered.
    category, _ = network.match(on_a_circle(29.0))
    assert category == [0]


def test_opposite_vectors_that_cancel_leave_no_nan():
    X = np.array([[1.0, 2.0], [-1.0, -2.0], [2.0, -1.0]])
    network = fit(X, vigilance=-1.0, learning_rate=0.5)
    assert np.isfinite(network.categories_).all()


@pytest.mark.parametrize("learning", [False, True])
def test_zero_vectors_are_ignored(learning):
    network = fit(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), y=["west", "north", "east"])
    np.testing.assert_array_equal(network.labels_, [-1, 0, 1])
    category, similarity = network.match(np.zeros((2, 2)), learning=learning)
    assert category.tolist() == [-1, -1] and similarity.tolist() == [0.0, 0.0]
    assert network.predict(np.zeros((1, 2))) == ["north"]


def test_invalid_training_data_or_parameters_are_refused():
    with pytest.raises(ValueError, match="only zero vectors"):
        fit(np.zeros((3, 2)))
    with pytest.raises(ValueError, match="NaN"):
        fit([[1.0, np.nan]])
    with pytest.raises(ValueError, match="vigilance"):
        fit(np.eye(2), vigilance=1.01)
    with pytest.raises(ValueError, match="learning_rate"):
        fit(np.eye(2), learning_rate=0.0)


# The test phase --------------------------------------------------------------------------------


def test_match_maximises_the_cosine():
    X = np.random.default_rng(6).random((60, 20))
    network = fit(X, y=np.arange(60) % 4)
    noisy = X + np.random.default_rng(0).normal(0.0, 0.1, X.shape)
    norms = np.linalg.norm(noisy, axis=1)[:, None] * np.linalg.norm(network.categories_, axis=1)
    cosines = noisy @ network.categories_.T / norms
    category, similarity = network.match(noisy)
    np.testing.assert_array_equal(category, cosines.argmax(axis=1))
    np.testing.assert_allclose(similarity, cosines.max(axis=1), rtol=1e-12)
    np.testing.assert_array_equal(network.predict(noisy), network.category_labels_[category])


def test_match_with_learning_follows_plain_rule_then_resets():
    X = np.random.default_rng(8).random((60, 20))
    network = fit(X, learning_rate=0.3)
    before = network.categories_.copy()
    noisy = X + np.random.default_rng(1).normal(0.0, 0.3, X.shape)

    traces, expected = list(before), []
    for x in noisy:
        rho = [x @ w / np.linalg.norm(x) / np.linalg.norm(w) for w in traces]
        k = int(np.argmax(rho))
        traces[k] = traces[k] + (x - traces[k]) * 0.3
        expected.append(k)

    for _ in range(2):
        category, _ = network.match(noisy, learning=True)
        np.testing.assert_array_equal(category, expected)
    np.testing.assert_array_equal(network.categories_, before)
    assert np.any(category != network.match(noisy)[0]), "learning changes some answers here"

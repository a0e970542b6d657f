"""The Adaptive Clustering Network follows its plain rule and the consequences of the rule."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from numpy.typing import NDArray
from plain_network import plain_network
from sklearn.exceptions import ConvergenceWarning
from sklearn.utils.estimator_checks import parametrize_with_checks

from ncti.classify import AdaptiveClusteringNetwork


@parametrize_with_checks([AdaptiveClusteringNetwork()])
def test_it_is_a_scikit_learn_classifier(estimator, check):
    check(estimator)


def on_a_circle(*degrees: float) -> NDArray[np.float64]:
    angle = np.radians(degrees)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def fit(X, y=None, **parameters) -> AdaptiveClusteringNetwork:
    return AdaptiveClusteringNetwork(**parameters).fit(X, np.zeros(len(X)) if y is None else y)


def profiles(rng: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return 124 synthetic profiles: scatterers of four ships at 31 aspects, 250 bins."""
    down_range = np.arange(250) - 125.0
    place, height = rng.uniform(-70.0, 70.0, (4, 12)), rng.uniform(0.2, 1.0, (4, 12))
    aspect = np.radians(np.arange(0, 91, 3))
    centre = place[:, None, :] * np.cos(aspect)[:, None]
    lobes = np.exp(-0.5 * ((down_range - centre[..., None]) / 6.0) ** 2)
    profile = np.einsum("sk,sakr->sar", height, lobes)
    profile /= profile.max(axis=-1, keepdims=True)
    return profile.reshape(124, 250), np.repeat(np.arange(4), 31)


def assert_agrees_with_plain_network(X, vigilance, learning_rate, max_passes):
    traces, assigned, n_passes, converged = plain_network(X, vigilance, learning_rate, max_passes)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        network = fit(X, vigilance=vigilance, learning_rate=learning_rate, max_passes=max_passes)
    live, renumbered = np.unique(assigned, return_inverse=True)
    assert (network.n_passes_, network.converged_) == (n_passes, converged)
    np.testing.assert_array_equal(network.labels_, renumbered)
    # A few hundred updates, each good to a few units in the last place.
    np.testing.assert_allclose(network.categories_, traces[live], rtol=0, atol=1e-12)


@pytest.mark.parametrize("learning_rate", [0.1, 0.5])
@pytest.mark.parametrize("vigilance", [0.8, 0.95, 0.99])
def test_profiles_form_the_categories_of_the_plain_rule(vigilance, learning_rate):
    X, _ = profiles(np.random.default_rng(7))
    assert_agrees_with_plain_network(X, vigilance, learning_rate, 100)


@pytest.mark.parametrize("seed", range(20))
def test_vectors_of_any_length_form_the_categories_of_the_plain_rule(seed):
    rng = np.random.default_rng(seed)
    X = rng.random((60, 5)) * 10.0 ** rng.uniform(-3.0, 3.0, (60, 1))
    assert_agrees_with_plain_network(
        X / X.max(), rng.choice([0.5, 0.9, 0.97]), rng.choice([0.05, 0.3, 1.0]), 30
    )


def test_a_vector_must_exceed_the_vigilance():
    assert fit(np.eye(2), vigilance=0.0).n_categories_ == 2
    assert fit(np.eye(2), vigilance=-1e-300).n_categories_ == 1


def test_of_equal_matches_the_oldest_wins():
    network = fit(np.eye(2), y=["north", "east"])
    assert network.predict([[1.0, 1.0]]) == ["north"]


def test_the_most_frequent_ship_names_the_category_and_the_first_wins_a_tie():
    X = on_a_circle(0, 1, 2, 90, 91)
    network = fit(X, y=["texas", "duncan", "texas", "roberts", "horne"], vigilance=0.9)
    np.testing.assert_array_equal(network.category_labels_, ["texas", "horne"])


def test_a_category_that_lost_its_vectors_does_not_answer():
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


def test_zero_vectors_take_no_part():
    X, y = profiles(np.random.default_rng(5))
    holes = np.insert(X, [0, 50, 124], 0.0, axis=0)
    clean, holed = AdaptiveClusteringNetwork(), AdaptiveClusteringNetwork()
    clean.fit(X, y)
    holed.fit(holes, np.insert(y, [0, 50, 124], 0))
    # The order of a sum of products depends on the number of rows, and rounds as often.
    rounding = len(holes) * np.finfo(float).eps
    np.testing.assert_allclose(holed.categories_, clean.categories_, rtol=rounding)
    np.testing.assert_array_equal(holed.labels_[holes.any(axis=1)], clean.labels_)
    np.testing.assert_array_equal(holed.labels_[~holes.any(axis=1)], -1)
    for learning in (False, True):
        category, similarity = holed.match(np.zeros((2, 250)), learning=learning)
        np.testing.assert_array_equal(category, -1)
        np.testing.assert_array_equal(similarity, 0.0)
    assert np.all(np.isin(holed.predict(np.zeros((2, 250))), y))


def test_what_cannot_be_learnt_is_refused():
    with pytest.raises(ValueError, match="only zero vectors"):
        fit(np.zeros((3, 2)))
    with pytest.raises(ValueError, match="NaN"):
        fit([[1.0, np.nan]])
    with pytest.raises(ValueError, match="vigilance"):
        fit(np.eye(2), vigilance=1.01)
    with pytest.raises(ValueError, match="learning_rate"):
        fit(np.eye(2), learning_rate=0.0)


# The test phase --------------------------------------------------------------------------------


def test_matching_is_the_largest_cosine():
    X, y = profiles(np.random.default_rng(6))
    network = AdaptiveClusteringNetwork().fit(X, y)
    noisy = X + np.random.default_rng(0).normal(0.0, 0.1, X.shape)
    norms = np.linalg.norm(noisy, axis=1)[:, None] * np.linalg.norm(network.categories_, axis=1)
    cosines = noisy @ network.categories_.T / norms
    category, similarity = network.match(noisy)
    np.testing.assert_array_equal(category, cosines.argmax(axis=1))
    np.testing.assert_allclose(similarity, cosines.max(axis=1), rtol=1e-12)
    np.testing.assert_array_equal(network.predict(noisy), network.category_labels_[category])


def test_learning_in_the_test_phase_follows_the_plain_rule_and_forgets_it():
    X, y = profiles(np.random.default_rng(8))
    network = AdaptiveClusteringNetwork(learning_rate=0.3).fit(X, y)
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

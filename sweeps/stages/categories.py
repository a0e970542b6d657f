"""Categories of the Adaptive Clustering Network: how they form, get names, and answer tests.

Vectors may be of any sensor. Views are those of a grid of ships and aspects, those of the first
ship first; vectors of views that are not there are zero.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.classify.vigilance_sweep import Clustering, Similarities, cluster
from ncti.evaluate import category_formation
from sweeps.stages.classifier import NONE

Arrays = dict[str, NDArray[Any]]
Floats = NDArray[np.float64]
Places = NDArray[np.intp]


def form_categories(
    similarities: Similarities,
    taught: NDArray[np.bool_],
    order: Places,
    *,
    vigilance: float,
    learning_rate: float,
    max_passes: int,
) -> Arrays:
    """Train with the views that are taught.

    Parameters
    ----------
    similarities : Similarities
        Of the vectors of all views, those of the first ship first, zero where a view is not there.
    taught : (ship, aspect) bool ndarray
        Views that are there and learned.
    order : (view,) intp ndarray
        Order of presentation of all views; those not taught are left out.
    vigilance, learning_rate, max_passes
        As for `ncti.classify.cluster`.

    Returns
    -------
    dict of str to ndarray
        training_category, training_confused : (ship, aspect), negative where not taught;
        passes : (), negative where the categories did not settle;
        weights : (view, view) float64, a row a category, zero below the last of them
    """
    ship, aspect = np.indices(taught.shape).reshape(2, -1)
    known = taught.reshape(-1)
    found = cluster(
        similarities,
        vigilance=vigilance,
        learning_rate=learning_rate,
        max_passes=max_passes,
        order=order[known[order]],
    )
    formed = category_formation(found.labels[known], ship[known], aspect[known])
    at = np.searchsorted(formed.ships, ship[known]), np.searchsorted(formed.aspects, aspect[known])
    confused = np.full(known.shape, NONE)
    confused[known] = formed.confused[at]
    weights = np.zeros((known.size, known.size))
    weights[: len(found.weights)] = found.weights
    return {
        "training_category": found.labels.reshape(taught.shape),
        "training_confused": confused.reshape(taught.shape),
        "passes": np.array(found.passes if found.converged else -found.passes),
        "weights": weights,
    }


def clustering_of(formed: Mapping[str, NDArray[Any]]) -> Clustering:
    """Return the clustering that `form_categories` made into arrays."""
    labels = formed["training_category"].reshape(-1).astype(np.intp)
    passes = int(formed["passes"])
    return Clustering(labels, formed["weights"][: labels.max() + 1], abs(passes), passes > 0)


def name_categories(
    formed: Mapping[str, NDArray[Any]], order: Places, rule: str
) -> tuple[NDArray[np.int16], NDArray[np.int8]]:
    """Give every category a ship.

    Parameters
    ----------
    formed : mapping of str to ndarray
        As `form_categories` returns it.
    order : (view,) intp ndarray
        Order of presentation.
    rule : str
        `majority`, the ship of most members; `first`, that of the member presented first.

    Returns
    -------
    names : (view,) int16 ndarray
        Ship of each category; -1 beyond the last of them.
    training_correct : (ship, aspect) int8 ndarray
        1 where a view's category has its ship's name, -1 where it is not taught.
    """
    categories = formed["training_category"]
    ship = np.indices(categories.shape)[0]
    found = clustering_of(formed)
    rules = {
        "majority": lambda: found.names(ship.reshape(-1)),
        "first": lambda: found.first_names(ship.reshape(-1), order),
    }
    named = rules[rule]()
    names = np.full(categories.size, NONE, dtype=np.int16)
    names[: len(named)] = named
    right = (ships_named(names, categories) == ship).astype(np.int8)
    return names, np.where(formed["training_confused"] >= 0, right, NONE).astype(np.int8)


def answer_tests(
    category: NDArray[np.integer],
    there: NDArray[np.bool_],
    formed: Mapping[str, NDArray[Any]],
    names: NDArray[np.integer],
    score_rules: Sequence[str],
) -> tuple[NDArray[np.int16], NDArray[np.int8]]:
    """Turn the categories that tests fall into into ships, and judge these.

    Parameters
    ----------
    category : (ship, aspect) integer ndarray
        Category of each test; -1 where it matches none.
    there : (ship, aspect) bool ndarray
        Tests that are there.
    formed : mapping of str to ndarray
        As `form_categories` returns it.
    names : (view,) integer ndarray
        Ship of each category.
    score_rules : sequence of str
        `ship`: the ship must be right; `category`: the category must be that of the same view,
        and nothing is asked where the view is not taught.

    Returns
    -------
    predicted : (ship, aspect) int16 ndarray
        Ship named; -1 for none.
    correct : (score_rule, ship, aspect) int8 ndarray
        1 where it is right, 0 where not, -1 where nothing is asked.
    """
    ship = np.indices(there.shape)[0]
    named = ships_named(names, category)
    taught = formed["training_confused"] >= 0
    rules = {
        "ship": (named == ship, there),
        "category": (category == formed["training_category"], there & taught),
    }
    correct = [
        np.where(asked, same & (category != NONE), NONE)
        for same, asked in (rules[rule] for rule in score_rules)
    ]
    return np.where(there, named, NONE).astype(np.int16), np.array(correct, dtype=np.int8)


def ships_named(names: NDArray[np.integer], category: NDArray[np.integer]) -> NDArray[np.integer]:
    """Return the ship of each category; none for a vector that matches nothing."""
    return np.where(category >= 0, names[np.maximum(category, 0)], NONE)


def match_learning(
    training: Floats,
    tests: Floats,
    taught: NDArray[np.bool_],
    order: Places,
    *,
    vigilance: float,
    learning_rate: float,
    max_passes: int,
) -> tuple[Places, Floats]:
    """Match tests that move categories, too.

    Parameters
    ----------
    training, tests : (view, feature) float64 ndarray
        Vectors of all views, zero where one is not there.
    taught : (ship, aspect) bool ndarray
        Views that are learned.
    order, vigilance, learning_rate, max_passes
        As for `form_categories`.

    Returns
    -------
    category : (view,) intp ndarray
        Category of each test; -1 where it matches none.
    similarity : (view,) float64 ndarray
        Cosine to it.

    Notes
    -----
    Tests of ships that are learned come first, in the order of the grid: what is unknown then moves
    no category that they are held against.
    """
    # Imported where it is used: scikit-learn takes a second.
    from sklearn.exceptions import ConvergenceWarning

    from ncti.classify.adaptive_clustering import AdaptiveClusteringNetwork

    presented = order[taught.reshape(-1)[order]]
    network = AdaptiveClusteringNetwork(
        vigilance=vigilance, learning_rate=learning_rate, max_passes=max_passes
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # `passes` and the table tell
        network.fit(training[presented], np.indices(taught.shape)[0].reshape(-1)[presented])
    unknown = np.repeat(~taught.any(axis=1), taught.shape[1])
    turn = np.argsort(unknown, kind="stable")
    category, similarity = np.empty(len(tests), dtype=np.intp), np.empty(len(tests))
    category[turn], similarity[turn] = network.match(tests[turn], learning=True)
    return category, similarity

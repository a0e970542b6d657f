"""Categories of the Adaptive Clustering Network: formation, labels and test answers.

Vectors may be of any sensor. Views are those of a grid of ships and aspects, those of the first
ship first; vectors of missing views are zero.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.classify.vigilance_sweep import Clustering, Similarities, cluster
from ncti.evaluate import category_formation
from sweeps.engine.seeds import cell_rng
from sweeps.engine.settings import Settings, count, draws, number, switch, word
from sweeps.stages.classifier import NONE, Arrays, Floats, Ships, Views, state

if TYPE_CHECKING:
    from ncti.classify.adaptive_clustering import AdaptiveClusteringNetwork

IMPORTS = ("ncti.classify.adaptive_clustering",)  # by its stages, when they are called; takes long
Places = NDArray[np.intp]


class Network(Settings, key="classifier"):
    """The Adaptive Clustering Network."""

    learning_rate = number(0.1, 1e-6, 1, label="learning rate in training", noted=True)
    max_passes = count(
        200, 1, 1_000_000, label="largest number of presentations of the training set"
    )
    learn_in_test = switch(
        False,
        label="learning during the test",
        help="test vectors move categories, as in the source; unknown ships are presented last",
        noted=True,
    )
    orders = draws(
        1,
        label="order of presentation of the profiles; 0 is the order of the grid",
        dimension="order",
        noted=True,
    )
    label_rule = word(
        "majority",
        ("majority", "first"),
        label="rule that labels a category with a ship: majority, or first of its members",
        noted=True,
    )
    score_rule = word(
        "ship",
        ("ship", "category"),
        label="rule that scores an answer: the right ship, or the right category",
        help="views absent from training are scored by ship",
        noted=True,
    )


@dataclass(frozen=True)
class Lessons:
    """Training views and their similarities, shared by all trainings on them.

    (view, feature) vectors, zero for missing views, with their similarities; the (ship,
    aspect) mask of existing views; and the function from profiles or maps to vectors.
    """

    vectors: Floats
    similarities: Similarities
    there: Views
    see: Callable[[NDArray[Any]], NDArray[Any]]

    @classmethod
    def of(cls, seen: NDArray[Any], there: Views, see: Callable[..., NDArray[Any]]) -> Lessons:
        """Return the lessons of (ship, aspect, ...) profiles or maps."""
        vectors = see(seen).astype(np.float64)
        return cls(vectors, Similarities.of(vectors), there, see)


def presentation_order(views: int, order: int, seed: int) -> Places:
    """Return an order of presentation of all views: the grid's own, or of a number from 1 on."""
    if order == 0:
        return np.arange(views)
    return cell_rng(seed, stage="presentation_order", order=order).permutation(views)


def form_categories(
    lessons: Lessons,
    training_views: Views,
    presentation: tuple[int, int],
    vigilance: float,
    learning_rate: float,
    max_passes: int,
) -> Arrays:
    """Train with the existing training views, in the order of presentation of a number and seed.

    Returns
    -------
    dict of str to ndarray
        training_category, training_confused : (ship, aspect), negative outside training;
        passes : (), negative where the categories did not settle;
        weights : (view, view) float64, a row a category, zero below the last of them;
        turn : (view,), the order of all views; taught_by : the last three arguments
    """
    known = (training_views & lessons.there).reshape(-1)
    ship, aspect = np.indices(training_views.shape).reshape(2, -1)
    turn = presentation_order(known.size, *presentation)
    found = cluster(
        lessons.similarities,
        vigilance=vigilance,
        learning_rate=learning_rate,
        max_passes=max_passes,
        order=turn[known[turn]],
    )
    formed = category_formation(found.labels[known], ship[known], aspect[known])
    at = np.searchsorted(formed.ships, ship[known]), np.searchsorted(formed.aspects, aspect[known])
    confused = np.full(known.shape, NONE)
    confused[known] = formed.confused[at]
    weights = np.zeros((known.size, known.size))
    weights[: len(found.weights)] = found.weights
    return {
        "training_category": found.labels.reshape(training_views.shape),
        "training_confused": confused.reshape(training_views.shape),
        "passes": np.array(found.passes if found.converged else -found.passes),
        "weights": weights,
        "turn": turn,
        "taught_by": np.array([vigilance, learning_rate, max_passes]),
    }


def clustering_of(training: Arrays) -> Clustering:
    """Return the clustering from the arrays of `form_categories`."""
    labels = training["training_category"].reshape(-1).astype(np.intp)
    passes = int(training["passes"])
    return Clustering(labels, training["weights"][: labels.max() + 1], abs(passes), passes > 0)


def name_categories(training: Arrays, label_rule: str) -> Arrays:
    """Label every category with the ship of most members, or of the first one presented.

    (view,) `names`, -1 beyond the last category; (ship, aspect) `training_correct`, 1 where a
    view's category has its ship's name, -1 outside training.
    """
    categories = training["training_category"]
    ship = np.indices(categories.shape)[0]
    found = clustering_of(training)
    if label_rule == "majority":
        named = found.names(ship.reshape(-1))
    else:
        named = found.first_names(ship.reshape(-1), training["turn"])
    names = np.full(categories.size, NONE)
    names[: len(named)] = named
    right = ships_named(names, categories) == ship
    correct = np.where(training["training_confused"] >= 0, right, NONE)
    return {"training_correct": correct, "names": names}


def ships_named(names: Ships, category: Ships) -> Ships:
    """Return the ship of each category; `NONE` for a vector without a category."""
    return np.where(category >= 0, names[np.maximum(category, 0)], NONE)


def answer_tests(
    lessons: Lessons,
    training: Arrays,
    names: Arrays,
    tests: NDArray[Any],
    there: Views,
    score_rule: tuple[str, ...],
    learn_in_test: bool,
) -> Arrays:
    """Return the answers of several trainings to (frame_count, ship, aspect, ...) tests.

    These, as of `form_categories` and `name_categories`, have leading axes (...) and (...,
    label_rule). By the rule `ship` the ship must be right; by `category` the category must be that
    of the same view, and views outside training are not asked for.

    Returns
    -------
    dict of str to ndarray
        category, similarity (cosine to it), predicted, correct, cell :
        (..., frame_count, label_rule, score_rule, ship, aspect)
    """
    lead, rules = training["passes"].shape, names["names"].shape[training["passes"].ndim]
    whole = (*lead, len(tests), rules, len(score_rule), *there.shape)
    answers = {name: np.full(whole, NONE) for name in ("category", "predicted", "correct")}
    answers["similarity"] = np.full(whole, np.nan)
    ship = np.indices(there.shape)[0]
    networks = {}
    if learn_in_test:
        for at in np.ndindex(lead):
            formed = {name: values[at] for name, values in training.items()}
            networks[at] = network_of(lessons.vectors, formed)
    for f, seen in enumerate(tests):
        vectors = lessons.see(seen).astype(np.float64)
        similarities = lessons.similarities.to(vectors)
        for at in np.ndindex(lead):
            formed = {name: values[at] for name, values in training.items()}
            if learn_in_test:
                category, cosine = match_learning(networks[at], vectors, formed)
            else:
                category, cosine = clustering_of(formed).match(similarities)
            category = np.where(there, category.reshape(there.shape), NONE)
            answers["category"][*at, f] = category
            answers["similarity"][*at, f] = np.where(there, cosine.reshape(there.shape), np.nan)
            same = (category == formed["training_category"]) & (category != NONE)
            of_taught = there & (formed["training_confused"] >= 0)
            for k, of_category in enumerate(names["names"][at]):
                named = ships_named(of_category, category)
                right = {
                    "ship": np.where(there, named == ship, NONE),
                    "category": np.where(of_taught, same, NONE),
                }
                answers["predicted"][*at, f, k] = named
                answers["correct"][*at, f, k] = [right[rule] for rule in score_rule]
    return answers | {"cell": state(answers["correct"], there)}


def network_of(vectors: Floats, formed: Arrays) -> AdaptiveClusteringNetwork:
    """Return the network that formed the categories of (view, feature) vectors."""
    # Imported here because scikit-learn takes a second.
    from sklearn.exceptions import ConvergenceWarning

    from ncti.classify.adaptive_clustering import AdaptiveClusteringNetwork

    training_views, turn = formed["training_confused"] >= 0, formed["turn"]
    presented = turn[training_views.reshape(-1)[turn]]
    vigilance, learning_rate, passes = formed["taught_by"].tolist()
    network = AdaptiveClusteringNetwork(
        vigilance=vigilance, learning_rate=learning_rate, max_passes=int(passes)
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # `passes` and the table tell
        network.fit(vectors[presented], np.indices(training_views.shape)[0].reshape(-1)[presented])
    return network


def match_learning(
    network: AdaptiveClusteringNetwork, tests: Floats, formed: Arrays
) -> tuple[Places, Floats]:
    """Return (view,) categories and cosines of (view, feature) tests that move categories.

    They are presented in the order of the training, known ships first, so that unknown ones move
    no category before these are compared with it.
    """
    training_views, turn = formed["training_confused"] >= 0, formed["turn"]
    unknown = np.repeat(~training_views.any(axis=1), training_views.shape[1])
    category, similarity = np.empty(len(tests), dtype=np.intp), np.empty(len(tests))
    order = turn[np.argsort(unknown[turn], kind="stable")]
    category[order], similarity[order] = network.match(tests[order], learning=True)
    return category, similarity

"""Training and testing the classifier on what a sensor saw in one cell."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.exceptions import ConvergenceWarning

from ncti.classify import AdaptiveClusteringNetwork, Similarities, cluster
from ncti.evaluate import category_formation
from ncti.features import profile_vector
from sweeps.schema import ClassifierConfig

Arrays = dict[str, NDArray[Any]]
NONE = -1  # of a category, a ship, or an answer: the view is not there


def classify_profiles(
    expected: NDArray[np.float32],
    averaged: NDArray[np.float32],
    there: NDArray[np.bool_],
    *,
    learned: NDArray[np.bool_],
    vigilances: tuple[float, ...],
    classifier: ClassifierConfig,
) -> Arrays:
    """Train on expected profiles, test on averaged ones, at every learning rate and vigilance.

    Parameters
    ----------
    expected : (ship, aspect, bin) float32 ndarray
        Training profiles.
    averaged : (replicate, frame_count, ship, aspect, bin) float32 ndarray
        Test profiles of the same views.
    there : (ship, aspect) bool ndarray
        Views that are done; the others are left out.
    learned : (ship, aspect) bool ndarray
        Those that are trained with; the others are only named.
    vigilances : tuple of float
        Vigilances in training.
    classifier : ClassifierConfig
        The rest of the classifier.

    Returns
    -------
    dict of str to ndarray
        training_category, training_confused : (learning_rate, vigilance, ship, aspect)
        training_correct : (learning_rate, vigilance, label_rule, ship, aspect)
        category, similarity : (learning_rate, vigilance, replicate, frame_count, ship, aspect)
        predicted : the same with label_rule after vigilance; correct : with (label_rule,
        score_rule)
        passes : (learning_rate, vigilance), negative where the categories did not settle
    """
    answers = classify(
        profile_vector(expected[there]),
        profile_vector(averaged[:, :, there]),
        there,
        orders=[np.flatnonzero(learned[there])],
        vigilances=vigilances,
        classifier=classifier,
    )
    return {name: values[0] for name, values in answers.items()}


def classify_silhouettes(
    template: NDArray[np.floating],
    silhouette: NDArray[np.floating],
    there: NDArray[np.bool_],
    *,
    learned: NDArray[np.bool_],
    orders: list[NDArray[np.intp]],
    vigilances: tuple[float, ...],
    classifier: ClassifierConfig,
) -> Arrays:
    """Train on noiseless silhouettes, test on those cut out of images, in several orders.

    Parameters
    ----------
    template : (ship, aspect, angle, radius) ndarray
        Training maps.
    silhouette : (ship, aspect, range, super_resolution, frame_count, angle, radius) ndarray
        Test maps of the same views.
    there : (ship, aspect) bool ndarray
        Views that are done; the others are left out.
    orders : list of (ship * aspect,) intp ndarray
        Orders of presentation in training.
    learned, vigilances, classifier
        As for `classify_profiles`.

    Returns
    -------
    dict of str to ndarray
        As of `classify_profiles`, with an axis `order` in front, and with the axes (range,
        super_resolution, frame_count) in place of (replicate, frame_count).

    Notes
    -----
    The map of an empty silhouette is zero everywhere. It matches no category, so it names no
    ship, which counts as wrong.
    """
    features = template.shape[-2] * template.shape[-1]
    training = template[there].reshape(-1, features)
    seen = np.moveaxis(silhouette[there], 0, 3)
    tests = seen.reshape(*seen.shape[:-2], features)
    place = np.full(there.size, NONE)
    place[np.flatnonzero(there)] = np.arange(len(training))
    place[~learned.reshape(-1)] = NONE
    return classify(
        training,
        tests,
        there,
        orders=[place[order][place[order] != NONE] for order in orders],
        vigilances=vigilances,
        classifier=classifier,
    )


def classify(
    training: NDArray[np.floating],
    tests: NDArray[np.floating],
    there: NDArray[np.bool_],
    *,
    orders: list[NDArray[np.intp]],
    vigilances: tuple[float, ...],
    classifier: ClassifierConfig,
) -> Arrays:
    """Train and test with vectors, whatever sensor they come from.

    Parameters
    ----------
    training : (view, feature) ndarray
        Training vectors of the views that are there.
    tests : (..., view, feature) ndarray
        Test vectors of the same views.
    there : (ship, aspect) bool ndarray
        Which views they are.
    orders : list of (view,) intp ndarray
        In which orders they are presented in training.
    vigilances, classifier
        As for `classify_profiles`.

    Returns
    -------
    dict of str to ndarray
        As of `classify_profiles`, with an axis `order` in front, and with the leading axes of
        `tests` in place of (replicate, frame_count).

    Notes
    -----
    Where tests go on learning, those of ships that are learned come first, in the order of
    `there`, then those of unknown ones.
    """
    ship, aspect = np.nonzero(there)
    axes = classifier.expand()
    trainings = (len(orders), len(axes.learning_rate), len(vigilances))
    batches = tests.shape[:-2]
    labels, scores = (len(axes.label_rule),), (len(axes.score_rule),)
    views = there.shape
    result: Arrays = {
        "training_category": np.full((*trainings, *views), NONE, dtype=np.int32),
        "training_correct": np.full((*trainings, *labels, *views), NONE, dtype=np.int8),
        "training_confused": np.full((*trainings, *views), NONE, dtype=np.int8),
        "category": np.full((*trainings, *batches, *views), NONE, dtype=np.int32),
        "similarity": np.full((*trainings, *batches, *views), np.nan, dtype=np.float32),
        "predicted": np.full((*trainings, *labels, *batches, *views), NONE, dtype=np.int16),
        "correct": np.full((*trainings, *labels, *scores, *batches, *views), NONE, dtype=np.int8),
        "passes": np.zeros(trainings, dtype=np.int32),
    }
    # What vigilances, learning rates and orders share is computed once.
    similarities = Similarities.of(training, tests.reshape(-1, tests.shape[-1]))
    for place in np.ndindex(trainings):
        order, vigilance = orders[place[0]], vigilances[place[2]]
        settings: dict[str, Any] = {
            "learning_rate": axes.learning_rate[place[1]],
            "max_passes": classifier.max_passes,
        }
        found = cluster(similarities, vigilance=vigilance, order=order, **settings)
        learned = np.zeros(len(ship), dtype=bool)
        learned[order] = True
        formed = category_formation(found.labels[learned], ship[learned], aspect[learned])
        at = (
            np.searchsorted(formed.ships, ship[learned]),
            np.searchsorted(formed.aspects, aspect[learned]),
        )
        matched, cosine = found.match(similarities)
        category, similarity = matched.reshape(*batches, -1), cosine.reshape(*batches, -1)
        if classifier.learn_in_test:
            network = AdaptiveClusteringNetwork(vigilance=vigilance, **settings)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ConvergenceWarning)  # `passes` and the table tell
                network.fit(training[order], ship[order])
            # Ships that are learned first: what is unknown moves no category they are held against.
            turn = np.argsort(~np.isin(ship, ship[learned]), kind="stable")
            for test in np.ndindex(batches):
                found_in_turn = network.match(tests[test][turn], learning=True)
                category[test][turn], similarity[test][turn] = found_in_turn
        known = there.copy()
        known[there] = learned
        result["passes"][place] = found.passes if found.converged else -found.passes
        result["training_category"][place][there] = found.labels
        result["training_confused"][place][known] = formed.confused[at]
        result["category"][place][..., there] = category
        result["similarity"][place][..., there] = similarity
        for i, rule in enumerate(axes.label_rule):
            names = found.names(ship) if rule == "majority" else found.first_names(ship, order)
            right = _named(names, found.labels) == ship
            named = _named(names, category)
            result["training_correct"][place][i, known] = right[learned]
            result["predicted"][place][i][..., there] = named
            for j, score in enumerate(axes.score_rule):
                same = named == ship if score == "ship" else category == found.labels
                # A view that was not learned has no category of its own to fall into.
                asked = learned if score == "category" else True
                answer = np.where(asked, same & (category != NONE), NONE)
                result["correct"][place][i, j][..., there] = answer
    return result


def _named(names: NDArray[np.intp], category: ArrayLike) -> NDArray[np.intp]:
    """Ship of each category; none for a vector that matches nothing."""
    number = np.asarray(category)
    return np.where(number >= 0, names[np.maximum(number, 0)], NONE)

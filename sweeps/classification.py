"""Training and testing the classifier on what a sensor saw in one cell."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.exceptions import ConvergenceWarning

from ncti.classify import AdaptiveClusteringNetwork
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
    vigilances: tuple[float, ...],
    classifier: ClassifierConfig,
) -> Arrays:
    """Train on expected profiles, test on averaged ones, at every learning rate and vigilance.

    Parameters
    ----------
    expected : (ship, aspect, bin) float32 ndarray
        Training profiles.
    averaged : (frame_count, ship, aspect, bin) float32 ndarray
        Test profiles of the same views.
    there : (ship, aspect) bool ndarray
        Views that are done; the others are left out.
    vigilances : tuple of float
        Vigilances in training.
    classifier : ClassifierConfig
        The rest of the classifier.

    Returns
    -------
    dict of str to ndarray
        training_category, training_correct, training_confused :
        (learning_rate, vigilance, ship, aspect)
        category, predicted, correct : (learning_rate, vigilance, frame_count, ship, aspect)
        passes : (learning_rate, vigilance), negative where the categories did not settle
    """
    return classify(
        profile_vector(expected[there]),
        profile_vector(averaged[:, there]),
        there,
        order=np.arange(np.count_nonzero(there)),
        vigilances=vigilances,
        classifier=classifier,
    )


def classify_silhouettes(
    template: NDArray[np.floating],
    silhouette: NDArray[np.floating],
    there: NDArray[np.bool_],
    *,
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
    vigilances, classifier
        As for `classify_profiles`.

    Returns
    -------
    dict of str to ndarray
        As of `classify_profiles`, with an axis `order` in front, and with the axes (range,
        super_resolution, frame_count) in place of frame_count.

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
    answers = [
        classify(
            training,
            tests,
            there,
            order=place[order][place[order] != NONE],
            vigilances=vigilances,
            classifier=classifier,
        )
        for order in orders
    ]
    return {name: np.stack([answer[name] for answer in answers]) for name in answers[0]}


def classify(
    training: NDArray[np.floating],
    tests: NDArray[np.floating],
    there: NDArray[np.bool_],
    *,
    order: NDArray[np.intp],
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
    order : (view,) intp ndarray
        In which order they are presented in training.
    vigilances, classifier
        As for `classify_profiles`.

    Returns
    -------
    dict of str to ndarray
        As of `classify_profiles`, with the leading axes of `tests` in place of frame_count.
    """
    ship, aspect = np.nonzero(there)
    trainings = (len(classifier.learning_rates()), len(vigilances))
    trained = (*trainings, *there.shape)
    tested = (*trainings, *tests.shape[:-2], *there.shape)
    result: Arrays = {
        "training_category": np.full(trained, NONE, dtype=np.int32),
        "training_correct": np.full(trained, NONE, dtype=np.int8),
        "training_confused": np.full(trained, NONE, dtype=np.int8),
        "category": np.full(tested, NONE, dtype=np.int32),
        "predicted": np.full(tested, NONE, dtype=np.int16),
        "correct": np.full(tested, NONE, dtype=np.int8),
        "passes": np.zeros(trainings, dtype=np.int32),
    }
    for i, j in np.ndindex(trainings):
        network = AdaptiveClusteringNetwork(
            vigilance=vigilances[j],
            learning_rate=classifier.learning_rates()[i],
            max_passes=classifier.max_passes,
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # `passes` and the table tell
            network.fit(training[order], ship[order])
        labels = np.empty_like(network.labels_)
        labels[order] = network.labels_
        formed = category_formation(labels, ship, aspect)
        views = np.searchsorted(formed.ships, ship), np.searchsorted(formed.aspects, aspect)
        result["passes"][i, j] = network.n_passes_ if network.converged_ else -network.n_passes_
        result["training_category"][i, j, there] = labels
        result["training_correct"][i, j, there] = _names(network, labels) == ship
        result["training_confused"][i, j, there] = formed.confused[views]
        for test in np.ndindex(tests.shape[:-2]):
            category, _ = network.match(tests[test], learning=classifier.learn_in_test)
            named = _names(network, category)
            result["category"][i, j, *test, there] = category
            result["predicted"][i, j, *test, there] = named
            result["correct"][i, j, *test, there] = named == ship
    return result


def _names(network: AdaptiveClusteringNetwork, category: ArrayLike) -> NDArray[np.intp]:
    """Ship of each category; none for a vector that matches nothing."""
    number = np.asarray(category)
    return np.where(number >= 0, network.category_labels_[np.maximum(number, 0)], NONE)

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
    vigilances : tuple of float
        Vigilances in training.
    classifier : ClassifierConfig
        The rest of the classifier.

    Returns
    -------
    dict of str to ndarray
        training_category, training_correct, training_confused :
        (learning_rate, vigilance, ship, aspect)
        category, predicted, correct :
        (learning_rate, vigilance, replicate, frame_count, ship, aspect)
        passes : (learning_rate, vigilance), negative where the categories did not settle
    """
    answers = classify(
        profile_vector(expected[there]),
        profile_vector(averaged[:, :, there]),
        there,
        orders=[np.arange(np.count_nonzero(there))],
        vigilances=vigilances,
        classifier=classifier,
    )
    return {name: values[0] for name, values in answers.items()}


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
    """
    ship, aspect = np.nonzero(there)
    rates = classifier.learning_rates()
    trainings = (len(orders), len(rates), len(vigilances))
    batches = tests.shape[:-2]
    trained = (*trainings, *there.shape)
    tested = (*trainings, *batches, *there.shape)
    result: Arrays = {
        "training_category": np.full(trained, NONE, dtype=np.int32),
        "training_correct": np.full(trained, NONE, dtype=np.int8),
        "training_confused": np.full(trained, NONE, dtype=np.int8),
        "category": np.full(tested, NONE, dtype=np.int32),
        "predicted": np.full(tested, NONE, dtype=np.int16),
        "correct": np.full(tested, NONE, dtype=np.int8),
        "passes": np.zeros(trainings, dtype=np.int32),
    }
    # What vigilances, learning rates and orders share is computed once.
    similarities = Similarities.of(training, tests.reshape(-1, tests.shape[-1]))
    for place in np.ndindex(trainings):
        order, rate, vigilance = orders[place[0]], rates[place[1]], vigilances[place[2]]
        settings: dict[str, Any] = {"learning_rate": rate, "max_passes": classifier.max_passes}
        found = cluster(similarities, vigilance=vigilance, order=order, **settings)
        names = found.names(ship)
        formed = category_formation(found.labels, ship, aspect)
        views = np.searchsorted(formed.ships, ship), np.searchsorted(formed.aspects, aspect)
        result["passes"][place] = found.passes if found.converged else -found.passes
        result["training_category"][place][there] = found.labels
        result["training_correct"][place][there] = _named(names, found.labels) == ship
        result["training_confused"][place][there] = formed.confused[views]
        if classifier.learn_in_test:
            network = AdaptiveClusteringNetwork(vigilance=vigilance, **settings)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ConvergenceWarning)  # `passes` and the table tell
                network.fit(training[order], ship[order])
            category = np.array(
                [network.match(tests[test], learning=True)[0] for test in np.ndindex(batches)]
            ).reshape(*batches, -1)
            named = _named(network.category_labels_, category)
        else:
            category = found.match(similarities)[0].reshape(*batches, -1)
            named = _named(names, category)
        result["category"][place][..., there] = category
        result["predicted"][place][..., there] = named
        result["correct"][place][..., there] = named == ship
    return result


def _named(names: NDArray[np.intp], category: ArrayLike) -> NDArray[np.intp]:
    """Ship of each category; none for a vector that matches nothing."""
    number = np.asarray(category)
    return np.where(number >= 0, names[np.maximum(number, 0)], NONE)

"""Naming measured profiles by who learned synthetic ones, in one cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncti.features import profile_vector
from sweeps.classification import NONE, Arrays, classify
from sweeps.classifier_schema import ACN, MNN, ClassifierConfig
from sweeps.flight_variables import KINDS
from sweeps.naming import Profiles, name_by_correlation, name_by_network


def name_measured(
    signatures: NDArray[np.float32],
    there: NDArray[np.bool_],
    *,
    aspects: tuple[float, ...],
    learned: NDArray[np.bool_],
    names: tuple[str, ...],
    vigilances: tuple[float, ...],
    classifier: ClassifierConfig,
    random_state: int,
) -> Arrays:
    """Train on the learned signatures, test on those of every kind, with each classifier.

    Parameters
    ----------
    signatures : (ship, aspect, flight, kind, bin) float32 ndarray
        Of each ship at each aspect by each flight, those learned the same for all flights; NaN
        where a ship is not flown past.
    there : (ship, aspect) bool ndarray
        Views that are done; the others are left out.
    aspects : (aspect,) tuple of float
        Aspects [deg].
    learned : (ship, aspect) bool ndarray
        Views that are learned; the others are only named.
    names : tuple of str
        The classifiers.
    vigilances : tuple of float
        In training, of the Adaptive Clustering Network; the others answer the same at each.
    classifier : ClassifierConfig
        Their settings, one of each.
    random_state : int
        Seed of the multilayered network's first weights.

    Returns
    -------
    dict of str to ndarray
        predicted, correct, ship_correct : (classifier, vigilance, flight, kind, ship, aspect); -1
        where a view is not done, or not measured.

    Notes
    -----
    Article, 'Conclusions': measured profiles of ships that synthetic ones were learned of. A
    signature that shows nothing names no ship, which counts as wrong.
    """
    seen = np.moveaxis(signatures[there], 0, 2)  # (flight, kind, view, bin)
    known = seen[0, KINDS.index("learned")]
    absent = np.asarray(np.isnan(seen).any(axis=-1))
    seen = np.where(absent[..., None], known, seen)
    profiles = Profiles(known, seen, there, np.array(aspects), tuple(range(len(KINDS))), learned)
    flights = seen.shape[:2]
    shape = (len(names), len(vigilances), *flights, *there.shape)
    predicted = np.empty(shape, dtype=np.int16)
    correct = np.empty(shape, dtype=np.int8)
    for k, name in enumerate(names):
        if name == ACN:
            found = classify(
                profile_vector(known),
                profile_vector(seen),
                there,
                orders=[np.flatnonzero(learned[there])],
                vigilances=vigilances,
                classifier=classifier,
            )
            # Of one order, learning rate, label rule and score rule.
            predicted[k] = found["predicted"][0, 0, :, 0]
            correct[k] = found["correct"][0, 0, :, 0, 0]
            continue
        if name == MNN:
            found = name_by_network(profiles, classifier=classifier, random_state=random_state)
        else:
            found = name_by_correlation(profiles, classifier=classifier)
        alone = (*flights, *there.shape)  # every setting has one value
        predicted[k], correct[k] = (found[one].reshape(alone) for one in ("predicted", "correct"))
    gone = profiles.spread(absent, True, np.bool_)
    ship = np.arange(len(there))[:, None]
    return {
        "predicted": np.where(gone, NONE, predicted).astype(np.int16),
        "correct": np.where(gone, NONE, correct).astype(np.int8),
        "ship_correct": np.where(gone, NONE, predicted == ship).astype(np.int8),
    }

"""Classifiers of range profiles besides the Adaptive Clustering Network, in one cell."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.exceptions import ConvergenceWarning

from ncti.classify import CorrelationNeighbour, GainAnnealedNetwork, GaussianTemplates
from ncti.classify.baselines import NO_TEMPLATE
from ncti.evaluate import aspect_bins
from ncti.features import profile_vector
from sweeps.classification import NONE, Arrays
from sweeps.classifier_schema import NOISY, ClassifierConfig


@dataclass(frozen=True)
class Profiles:
    """The range profiles of one cell, of the views that are there.

    Attributes
    ----------
    expected : (view, bin) float32 ndarray
        Noiseless profiles, noise floor included.
    averaged : (replicate, frame_count, view, bin) float32 ndarray
        Averages of frames.
    there : (ship, aspect) bool ndarray
        Which views they are.
    aspects : (aspect,) float64 ndarray
        Aspects [deg].
    frame_count : tuple of int
        Frames averaged.
    learned : (ship, aspect) bool ndarray, optional
        Views that are learned, the others being only named; all when not given.
    """

    expected: NDArray[np.float32]
    averaged: NDArray[np.float32]
    there: NDArray[np.bool_]
    aspects: NDArray[np.float64]
    frame_count: tuple[int, ...]
    learned: NDArray[np.bool_] | None = None

    @property
    def taught(self) -> NDArray[np.bool_]:
        """(view,): whether each view is learned."""
        every: NDArray[np.bool_] = self.there if self.learned is None else self.learned
        return every[self.there]

    @property
    def floor(self) -> NDArray[np.float32]:
        """(view, 1): noise within each expected profile, the ship's own IFOVs' among it.

        It is what the window's edge holds, which the configuration keeps free of ship: what the
        target's gain leaves alone.
        """
        return self.expected[:, :1]

    @property
    def ship(self) -> NDArray[np.intp]:
        """(view,): ship of each view."""
        return np.nonzero(self.there)[0]

    @property
    def aspect(self) -> NDArray[np.intp]:
        """(view,): place of each view on the aspect axis."""
        return np.nonzero(self.there)[1]

    def spread(self, values: NDArray[Any], fill: float, dtype: Any) -> NDArray[Any]:
        """(..., view) values as (..., ship, aspect), filled where a view is not there."""
        whole = np.full((*values.shape[:-1], *self.there.shape), fill, dtype=dtype)
        whole[..., self.there] = values
        return whole


def name_by_network(
    profiles: Profiles, *, classifier: ClassifierConfig, random_state: int
) -> Arrays:
    """Train the multilayered network on expected profiles and test it, in every setting.

    Parameters
    ----------
    profiles : Profiles
        Of one cell.
    classifier : ClassifierConfig
        Its settings.
    random_state : int
        Seed of the first weights, the same in every setting: what differs between settings is
        then their own doing, and no setting depends on which others there are.

    Returns
    -------
    dict of str to ndarray
        The variables of the store's group, from the axes of the settings on.

    Notes
    -----
    Article, 'Modified Neural Network': an output for every ship and aspect group. An answer is
    right when both are.
    """
    axes = classifier.expand()
    labels, group = aspect_bins(profiles.aspects)
    truth = profiles.ship * len(labels) + group[profiles.aspect]
    settings: list[tuple[Any, ...]]
    settings = [axes.epochs, axes.grow_every, axes.mnn_learning_rate]
    settings += [axes.tolerance, axes.inputs, axes.annealing]
    shape = tuple(map(len, settings))
    batches = profiles.averaged.shape[:2]
    found: dict[str, list[Any]] = {
        "named": [],
        "trained": [],
        "epochs": [],
        "nodes": [],
        "loss": [],
    }
    for place in np.ndindex(shape):
        epochs, grow_every, rate, tolerance, inputs, annealing = (
            values[k] for values, k in zip(settings, place, strict=True)
        )
        network = GainAnnealedNetwork(
            epochs=epochs,
            grow_every=grow_every,
            learning_rate=rate,
            annealing=annealing,
            max_hidden=classifier.mnn.max_hidden,
            tolerance=tolerance,
            scaling="common" if inputs == "standardised" else "none",
            random_state=random_state,
        )
        seen = (lambda given: given) if inputs == "raw" else profile_vector
        training, tests = seen(profiles.expected), seen(profiles.averaged)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # `loss` tells
            network.fit(training[profiles.taught], truth[profiles.taught])
        found["trained"].append(network.predict(training))
        found["named"].append(network.predict(tests.reshape(-1, tests.shape[-1])))
        found["epochs"].append(network.n_iter_)
        found["nodes"].append(network.n_hidden_)
        found["loss"].append(network.loss_curve_[-1])
    named = np.array(found["named"]).reshape(*shape, *batches, -1)
    trained = np.array(found["trained"]).reshape(*shape, -1)
    ship, right = named // len(labels), named == truth
    return {
        "predicted": profiles.spread(ship, NONE, np.int16),
        "predicted_bin": profiles.spread(named % len(labels), NONE, np.int16),
        "correct": profiles.spread(right, NONE, np.int8),
        "ship_correct": profiles.spread(ship == profiles.ship, NONE, np.int8),
        "training_correct": profiles.spread(
            np.where(profiles.taught, trained == truth, NONE), NONE, np.int8
        ),
        "presentations": np.array(found["epochs"], dtype=np.int32).reshape(shape),
        "hidden": np.array(found["nodes"], dtype=np.int16).reshape(shape),
        "loss": np.array(found["loss"], dtype=np.float32).reshape(shape),
    }


def name_by_correlation(profiles: Profiles, *, classifier: ClassifierConfig) -> Arrays:
    """Name the ship of the most similar profile that is learned.

    Parameters
    ----------
    profiles, classifier
        As for `name_by_network`.

    Returns
    -------
    dict of str to ndarray
        The variables of the store's group, from the axes of the settings on.

    Notes
    -----
    Similarity is the cosine of profile vectors. Of noisy profiles those of all other replicates
    of the same number of frames are learned. Where the true aspect is left out, profiles of all
    ships at it are. A profile that nowhere rises above its floor has no direction: it names no
    ship, which counts as wrong, and what is learned of it answers for none.
    """
    axes = classifier.expand()
    _require_another_aspect(profiles, axes.left_out)
    expected, tests = profile_vector(profiles.expected), profile_vector(profiles.averaged)
    ship, aspect, bins = profiles.ship, profiles.aspect, expected.shape[-1]
    replicates = len(tests)
    similarity = np.empty((len(axes.training), len(axes.left_out), *tests.shape[:3]))
    named = np.empty(similarity.shape, dtype=np.intp)
    for i, training in enumerate(axes.training):
        # What is learned, and the tests that it answers.
        lessons: list[tuple[NDArray[np.float64], Any]] = [(expected[None], ...)]
        if training == NOISY:
            lessons = [
                (tests[[k for k in range(replicates) if k != r], n], (r, n))
                for r, n in np.ndindex(tests.shape[:2])
            ]
        for learned, place in lessons:
            known = np.tile(ship, len(learned))
            neighbour = CorrelationNeighbour().fit(learned.reshape(-1, bins), known)
            shown = tests[place]
            vectors = shown.reshape(-1, bins)
            untaught = np.tile(~profiles.taught, len(learned))
            of_test = np.tile(aspect, len(vectors) // len(aspect))
            same = of_test[:, None] == np.tile(aspect, len(learned))
            for j, left_out in enumerate(axes.left_out):
                best, cosine = neighbour.match(vectors, exclude=untaught | (same & left_out))
                answer = np.where(best == NO_TEMPLATE, NONE, known[best])
                named[i, j][place] = answer.reshape(shown.shape[:-1])
                similarity[i, j][place] = cosine.reshape(shown.shape[:-1])
    return {
        "predicted": profiles.spread(named, NONE, np.int16),
        "correct": profiles.spread(named == ship, NONE, np.int8),
        "similarity": profiles.spread(similarity, np.nan, np.float32),
    }


def name_by_likelihood(
    profiles: Profiles,
    covariance: NDArray[np.float32],
    *,
    classifier: ClassifierConfig,
) -> Arrays:
    """Name the ship that is most probable, given the exact mean and covariance of its profiles.

    Parameters
    ----------
    profiles, classifier
        As for `name_by_network`.
    covariance : (view, lag, bin) float32 ndarray
        Of one frame of each view.

    Returns
    -------
    dict of str to ndarray
        The variables of the store's group, from the axes of the settings on.

    Notes
    -----
    Every view is a template, of a gain as well known as `classifier.gain_sigma` says. Where the
    true aspect is left out, templates of all ships at it are.
    """
    axes = classifier.expand()
    _require_another_aspect(profiles, axes.left_out)
    ship, aspect = profiles.ship, profiles.aspect
    replicates, counts, views, bins = profiles.averaged.shape
    samples = profiles.averaged.reshape(-1, bins)
    frames = np.broadcast_to(np.array(profiles.frame_count)[:, None], (replicates, counts, views))
    same = np.tile(aspect, replicates * counts)[:, None] == aspect
    templates = GaussianTemplates(nugget=classifier.nugget)
    templates.fit(profiles.expected, covariance, ship, floor=profiles.floor)
    of_gains = templates.log_likelihood(samples, frames.reshape(-1), gain_sigma=axes.gain_sigma)
    every = [
        templates.posterior_of(logs, exclude=~profiles.taught | (same & left_out))
        for logs, left_out in product(of_gains, axes.left_out)
    ]
    shape = (len(axes.gain_sigma), len(axes.left_out), replicates, counts, views, -1)
    posteriors = np.reshape(every, shape)
    named = templates.classes_[posteriors.argmax(axis=-1)]
    # 0 for a ship that nobody taught.
    true = (posteriors * (templates.classes_ == ship[:, None])).sum(axis=-1)
    return {
        "predicted": profiles.spread(named, NONE, np.int16),
        "correct": profiles.spread(named == ship, NONE, np.int8),
        "probability": profiles.spread(true, np.nan, np.float32),
    }


def _require_another_aspect(profiles: Profiles, left_out: tuple[bool, ...]) -> None:
    if any(left_out) and len(np.unique(profiles.aspect[profiles.taught])) < 2:
        raise ValueError(
            "classifier.left_out has True, but must be false where fewer than two aspects are "
            "learned: nothing would be left"
        )

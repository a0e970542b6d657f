"""The Adaptive Clustering Network for many vigilances, learning rates and orders at once."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all
from ncti.classify.directions import NO_CATEGORY, SAME_DIRECTION, polar

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True)
class Similarities:
    """All that clusterings of the same vectors share.

    Attributes
    ----------
    directions : (sample, feature) float64 ndarray
        Unit directions of the training vectors; zero for a zero vector.
    lengths : (sample,) float64 ndarray
        Their lengths.
    training : (sample, sample) float64 ndarray
        Cosines between training vectors; 0 where one of them is zero.
    test : (test, sample) float64 ndarray
        Cosines between test and training vectors.
    answers : (test,) bool ndarray
        False where a test vector is zero.
    """

    directions: Floats
    lengths: Floats
    training: Floats
    test: Floats
    answers: NDArray[np.bool_]

    @classmethod
    def of(cls, training: ArrayLike, tests: ArrayLike | None = None) -> Similarities:
        """Similarities of (sample, feature) training and (test, feature) test vectors, if any.

        Raises
        ------
        ValueError
            If the training vectors are all zero, an element is not finite, or shapes do not match.
        """
        learned = require_all("training", training)
        if learned.ndim != 2 or not learned.size:
            raise ValueError(
                f"training has shape {learned.shape}, but must be (sample, feature) with a sample "
                "and a feature or more"
            )
        directions, lengths = polar(learned)
        if not lengths.any():
            raise ValueError("training has only zero vectors, but must have one with a direction")
        none = np.zeros((0, len(learned)))
        found = cls(directions, lengths, directions @ directions.T, none, np.zeros(0, dtype=bool))
        return found if tests is None else found.to(tests)

    def to(self, tests: ArrayLike) -> Similarities:
        """Similarities of the same training vectors to other (test, feature) test vectors.

        Raises
        ------
        ValueError
            If an element is not finite, or the shape does not match.
        """
        shown = require_all("tests", tests)
        if shown.ndim != 2 or shown.shape[1] != self.directions.shape[1]:
            raise ValueError(
                f"tests has shape {shown.shape}, but must be (test, {self.directions.shape[1]})"
            )
        seen, sizes = polar(shown)
        return replace(self, test=seen @ self.directions.T, answers=sizes > 0)


@dataclass(frozen=True)
class Clustering:
    """What `AdaptiveClusteringNetwork.fit` finds, categories as sums of training vectors.

    Attributes
    ----------
    labels : (sample,) intp ndarray
        Category of each training vector; -1 for a zero vector.
    weights : (category, sample) float64 ndarray
        The unit direction of a category is the sum of the training directions times these.
    passes : int
        Presentations of the whole set.
    converged : bool
        Whether no assignment changed in the last of them.
    """

    labels: Indices
    weights: Floats
    passes: int
    converged: bool

    def names(self, classes: Indices) -> Indices:
        """(category,) intp ndarray: the class, of (sample,) ones, seen most often in each."""
        there = self.labels != NO_CATEGORY
        votes = np.zeros((len(self.weights), int(classes.max()) + 1), dtype=np.intp)
        np.add.at(votes, (self.labels[there], classes[there]), 1)
        return votes.argmax(axis=1)

    def first_names(self, classes: Indices, order: Indices) -> Indices:
        """(category,) intp ndarray: the class of the member presented first.

        Of (sample,) classes, presented in the order given to `cluster`.
        """
        presented = order[self.labels[order] != NO_CATEGORY]
        _, first = np.unique(self.labels[presented], return_index=True)
        return classes[presented[first]]

    def match(self, similarities: Similarities) -> tuple[Indices, Floats]:
        """Best-matching category of each test vector and its cosine, as the network's `match`."""
        cosines = similarities.test @ self.weights.T
        category = cosines.argmax(axis=1)
        similarity = np.take_along_axis(cosines, category[:, None], axis=1)[:, 0]
        category[~similarities.answers] = NO_CATEGORY
        return category, np.clip(similarity, -1.0, 1.0)


def cluster(
    similarities: Similarities,
    *,
    vigilance: float,
    learning_rate: float = 0.1,
    max_passes: int = 200,
    order: Indices | None = None,
) -> Clustering:
    """Form the categories of `AdaptiveClusteringNetwork`, from cosines alone.

    Parameters
    ----------
    similarities : Similarities
        Of the vectors.
    vigilance : float
        As for the network, but in [0, 1].
    learning_rate : float, default=0.1
        As for the network.
    max_passes : int, default=200
        As for the network, whose default is 100.
    order : (sample,) intp ndarray, optional
        Samples in the order of presentation; as they come, when not given. Some may be left out,
        none may come twice.

    Returns
    -------
    Clustering

    Raises
    ------
    ValueError
        If a parameter is out of range, or the order is not of different samples, one of which has
        a direction.

    Notes
    -----
    A category W is a sum of the vectors that it has learned, so its cosines to all of them tell
    what the network does. W += (X - W) dt turns its unit direction w to

        ((1 - t) w + t x) / n,   n^2 = (1 - t)^2 + t^2 + 2 t (1 - t) w x,

    t the share of X in the new length, and with it its row of cosines by the same two numbers. A
    presentation so costs as many operations as there are samples, however many features they
    have, and what the samples' products cost is paid once for all vigilances, learning rates and
    orders. Equal to the network but for rounding.
    """
    require("vigilance", vigilance, minimum=0.0, maximum=1.0)
    require("learning_rate", learning_rate, positive=True, maximum=1.0)
    require("max_passes", max_passes, minimum=1, whole=True)
    count = len(similarities.lengths)
    turn = np.arange(count) if order is None else _places(order, count)
    turn = turn[similarities.lengths[turn] > 0]
    if not turn.size:
        raise ValueError("order holds no vector with a direction, but must hold at least one")
    # Categories' cosines to every sample, then their weights: one row learns as a whole.
    rows = np.zeros((32, 2 * count))
    own = np.hstack([similarities.training, np.eye(count)])
    lengths: list[float] = []
    presented = list(zip(turn.tolist(), similarities.lengths[turn].tolist(), strict=True))
    threshold = min(vigilance, SAME_DIRECTION)
    assigned: list[int] = []
    passes, converged = 0, False
    while not converged and passes < max_passes:
        previous, assigned = assigned, []
        for i, length in presented:
            cosines = rows[: len(lengths), i]
            k = int(cosines.argmax()) if lengths else NO_CATEGORY
            if lengths and cosines[k] > threshold:
                kept = (1.0 - learning_rate) * lengths[k]
                share = learning_rate * length / (kept + learning_rate * length)
                row = rows[k]
                norm = (1 - share) ** 2 + share**2 + 2 * share * (1 - share) * float(cosines[k])
                norm = max(norm, 0.0) ** 0.5
                scale = 1.0 / norm if norm > 0.0 else 1.0  # zero where opposites cancel
                row *= (1.0 - share) * scale
                row += (share * scale) * own[i]
                lengths[k] = (kept + learning_rate * length) * norm
            else:
                k = len(lengths)
                if k == len(rows):
                    rows = np.concatenate([rows, np.zeros_like(rows)])
                rows[k] = own[i]
                lengths.append(length)
            assigned.append(k)
        passes += 1
        converged = assigned == previous
    # A category that lost all its vectors has no name and must not answer.
    live, category = np.unique(assigned, return_inverse=True)
    labels = np.full(count, NO_CATEGORY)
    labels[turn] = category
    return Clustering(labels, rows[live, count:], passes, converged)


def _places(order: ArrayLike, count: int) -> Indices:
    """An order of presentation, refused unless it holds different ones of so many samples."""
    places = require_all("order", order, whole=True, minimum=0, below=count).astype(np.intp)
    if places.ndim != 1:
        raise ValueError(f"order has shape {places.shape}, but must be (sample,)")
    seen = np.bincount(places, minlength=count)
    if seen.max() > 1:
        raise ValueError(f"order has {seen.argmax()} more than once, but samples must differ")
    return places

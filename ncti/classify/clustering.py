"""Categories of the Adaptive Clustering Network, from cosines shared by vigilances and orders."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all, require_shape
from ncti.classify.blocks import ROWS
from ncti.classify.directions import MAX_PASSES, NO_CATEGORY, SAME_DIRECTION, unit_vectors

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]


BLOCK = 2 * ROWS
"""Vectors whose cosines to each other and to all categories are held at once."""


@dataclass(frozen=True)
class Similarities:
    """Directions of training vectors and of tests, which all clusterings of these vectors share.

    Attributes
    ----------
    directions : (sample, feature) float64 ndarray
        Unit directions of the training vectors; zero for a zero vector.
    lengths : (sample,) float64 ndarray
        Lengths of the training vectors.
    test : (test, coordinate) float64 ndarray
        Unit directions of test vectors; or, where features are no fewer than training vectors,
        their cosines to these.
    answers : (test,) bool ndarray
        False if a test vector is zero.

    See Also
    --------
    cluster : Categories from the cosines between the vectors.

    Examples
    --------
    >>> from ncti.classify import Similarities
    >>> similarities = Similarities.of([[3.0, 0.0], [0.0, 2.0]], tests=[[1.0, 1.0]])
    >>> similarities.lengths
    array([3., 2.])
    >>> similarities.test.round(2)
    array([[0.71, 0.71]])
    """

    directions: Floats
    lengths: Floats
    test: Floats
    answers: NDArray[np.bool_]

    @classmethod
    def of(cls, training: ArrayLike, tests: ArrayLike | None = None) -> Similarities:
        """Return the similarities of (sample, feature) training and (test, feature) test vectors.

        Raises
        ------
        ValueError
            If the training vectors are all zero, an element is not finite, or shapes do not match.
        """
        learned = require_all("training", training)
        if learned.ndim != 2 or not learned.size:
            raise ValueError(
                f"training has shape {learned.shape}, but must be (sample, feature) with at least "
                "one of each"
            )
        directions, lengths = unit_vectors(learned)
        if not lengths.any():
            raise ValueError("training has only zero vectors, but must have one with a direction")
        no_tests = np.zeros((0, min(learned.shape)))
        similarities = cls(directions, lengths, no_tests, np.zeros(0, dtype=bool))
        return similarities if tests is None else similarities.with_tests(tests)

    def with_tests(self, tests: ArrayLike) -> Similarities:
        """Return the similarities of the same training vectors to other (test, feature) vectors.

        Raises
        ------
        ValueError
            If an element is not finite, or the shape does not match.
        """
        vectors = require_all("tests", tests)
        if vectors.ndim != 2 or vectors.shape[1] != self.directions.shape[1]:
            raise ValueError(
                f"tests has shape {vectors.shape}, but must be (test, {self.directions.shape[1]})"
            )
        directions, sizes = unit_vectors(vectors)
        return replace(self, test=self.products(directions), answers=sizes > 0)

    @property
    def has_few_samples(self) -> bool:
        """Whether the training vectors are one block."""
        return len(self.lengths) <= BLOCK

    @property
    def has_few_features(self) -> bool:
        """Whether features are fewer than training vectors."""
        return self.directions.shape[1] < len(self.directions)

    @property
    def coordinates(self) -> Floats:
        """Coordinates (sample, coordinate) of the training directions; categories are sums of them.

        The coordinates are the features or, if features are no fewer than training vectors, the
        weights of the training directions.
        """
        return self.directions if self.has_few_features else np.eye(len(self.directions))

    def products(self, directions: Floats) -> Floats:
        """Return the matrix that maps coordinates of categories to their cosines with `directions`.

        `directions` are (..., feature), the result is (..., coordinate).
        """
        return directions if self.has_few_features else directions @ self.directions.T

    @cached_property
    def sample_cosines(self) -> Floats:
        """The (sample, sample) cosines, where samples are at most `BLOCK`."""
        return self.directions @ self.directions.T


@dataclass(frozen=True)
class Clustering:
    """Categories as weighted sums of training vectors, as returned by `cluster`.

    Attributes
    ----------
    labels : (sample,) intp ndarray
        Category of each training vector; -1 for a zero vector.
    weights : (category, coordinate) float64 ndarray
        Unit direction of each category in `Similarities.coordinates`: its features, or, where
        these are no fewer than training vectors, the weights of their directions.
    lengths : (category,) float64 ndarray
        Lengths of the categories.
    passes : int
        Presentations of the whole training set.
    converged : bool
        True if no assignment changed in the last of them.

    See Also
    --------
    cluster : The function that makes it.

    Examples
    --------
    >>> import numpy as np
    >>> from ncti.classify import Similarities, cluster
    >>> vectors = np.array([[1.0, 0.1], [0.2, 1.0], [1.0, 0.2], [0.1, 1.0]])
    >>> similarities = Similarities.of(vectors, tests=[[3.0, 1.0]])
    >>> clustering = cluster(similarities, vigilance=0.95)
    >>> clustering.majority_labels(np.array([7, 8, 7, 8]))
    array([7, 8])
    >>> category, cosine = clustering.match(similarities)
    >>> category, cosine.round(2)
    (array([0]), array([0.98]))
    """

    labels: Indices
    weights: Floats
    lengths: Floats
    passes: int
    converged: bool

    def majority_labels(self, classes: Indices) -> Indices:
        """Return the most frequent class in each category, (category,), from (sample,) classes."""
        numbers = require_all("classes", classes, whole=True, minimum=0, below=2**31).astype(
            np.intp
        )
        require_shape("classes", numbers, (len(self.labels),))
        matched = self.labels != NO_CATEGORY
        votes = np.zeros((len(self.weights), int(numbers.max()) + 1), dtype=np.intp)
        np.add.at(votes, (self.labels[matched], numbers[matched]), 1)
        return votes.argmax(axis=1)

    def first_labels(self, classes: Indices, order: Indices) -> Indices:
        """Return the class of the vector presented first in each category, (category,).

        Classes are (sample,) integers, and the order is that given to `cluster`.
        """
        presented = order[self.labels[order] != NO_CATEGORY]
        _, first = np.unique(self.labels[presented], return_index=True)
        return classes[presented[first]]

    def category_vectors(self, similarities: Similarities) -> Floats:
        """Return the (category, feature) categories W formed from these similarities."""
        directions = similarities.directions
        weights = self.weights if similarities.has_few_features else self.weights @ directions
        return weights * self.lengths[:, None]

    def match(self, similarities: Similarities) -> tuple[Indices, Floats]:
        """Return the best-matching category of each (test,) vector, and its cosine."""
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
    max_passes: int = MAX_PASSES,
    order: Indices | None = None,
) -> Clustering:
    """Return the categories of the Adaptive Clustering Network, from cosines alone.

    Parameters
    ----------
    similarities : Similarities
        Cosines between the vectors.
    vigilance : float
        Cosine that the best match must exceed for a vector to join its category, in [-1, 1].
    learning_rate : float, default=0.1
        Fraction of the way by which a category moves towards each vector that joins it, in (0, 1].
    max_passes : int, default=200
        Largest number of presentations of the training set.
    order : (sample,) intp ndarray, optional
        Samples in the order of presentation, by default as given. Samples may be left out, but
        none may come twice.

    Returns
    -------
    Clustering
        The categories.

    Raises
    ------
    ValueError
        If a parameter is out of range, samples of the order are not distinct, or none of them has a
        direction.

    See Also
    --------
    AdaptiveClusteringNetwork : Estimator of scikit-learn, with the reference.

    Notes
    -----
    A category W is a sum of the vectors that it has learned, so its cosines to all of them
    determine the training. W += (X - W) dt turns its unit direction w to

        ((1 - t) w + t x) / n,   n^2 = (1 - t)^2 + t^2 + 2 t (1 - t) w x,

    with t the share of X in the new length, and transforms its row of cosines by the same two
    numbers. Cosines to a block of samples are held at a time, and computed from the category when
    the block is presented; up to 384 samples are one block, whose products are computed once for
    all vigilances and orders.

    Examples
    --------
    A higher vigilance gives more categories here, as it does usually, not always:

    >>> import numpy as np
    >>> from ncti.classify import Similarities, cluster
    >>> angle = np.radians([0, 5, 40, 45, 90])
    >>> similarities = Similarities.of(np.column_stack([np.cos(angle), np.sin(angle)]))
    >>> for vigilance in (0.6, 0.99, 0.999):
    ...     print(vigilance, cluster(similarities, vigilance=vigilance).labels)
    0.6 [0 0 0 0 1]
    0.99 [0 0 1 1 2]
    0.999 [0 1 2 3 4]
    """
    require("vigilance", vigilance, minimum=-1.0, maximum=1.0)
    require("learning_rate", learning_rate, positive=True, maximum=1.0)
    require("max_passes", max_passes, minimum=1, whole=True)
    count = len(similarities.lengths)
    presented = _presentation_order(similarities, order)
    few = similarities.has_few_samples
    blocks = [np.arange(count)] if few else np.split(presented, range(BLOCK, len(presented), BLOCK))
    width = min(count, BLOCK)
    singles = _single_sample_rows(similarities, blocks, width)
    categories = _Categories(singles[0].shape[1], min(vigilance, SAME_DIRECTION), learning_rate)
    assigned: list[int] = []
    passes, converged = 0, False
    while not converged and passes < max_passes:
        previous, assigned = assigned, []
        for block, single in zip(blocks, singles, strict=True):
            if not few:
                directions = similarities.products(similarities.directions[block])
                rows = categories.rows[: len(categories.lengths)]
                rows[:, : len(block)] = rows[:, width:] @ directions.T
            positions = presented if few else np.arange(len(block))
            sizes = similarities.lengths[block[positions]]
            for i, length in zip(positions.tolist(), sizes.tolist(), strict=True):
                assigned.append(categories.learn(i, length, single[i]))
        passes += 1
        converged = assigned == previous
    # A category that lost all its vectors has no label and is dropped.
    live, category = np.unique(assigned, return_inverse=True)
    labels = np.full(count, NO_CATEGORY)
    labels[presented] = category
    weights, lengths = categories.rows[live, width:], np.array(categories.lengths)[live]
    return Clustering(labels, weights, lengths, passes, converged)


class _Categories:
    """Categories in training.

    A row of `rows` holds the cosines of a category to a block of samples, then its coordinates,
    which follow the same rule; rows from ``len(lengths)`` on are free.
    """

    def __init__(self, columns: int, threshold: float, learning_rate: float) -> None:
        self.rows = np.zeros((32, columns))
        self.lengths: list[float] = []
        self.threshold, self.learning_rate = threshold, learning_rate

    def learn(self, sample: int, length: float, single: Floats) -> int:
        """Return the category of a sample: its best match above the threshold, or a new one.

        `sample` is its column in `rows`, and `single` the row of a category of this sample alone.
        """
        if self.lengths:
            cosines = self.rows[: len(self.lengths), sample]
            k = int(cosines.argmax())
            if cosines[k] > self.threshold:
                self._move(k, float(cosines[k]), length, single)
                return k
        if len(self.lengths) == len(self.rows):
            self.rows = np.concatenate([self.rows, np.zeros_like(self.rows)])
        self.rows[len(self.lengths)] = single
        self.lengths.append(length)
        return len(self.lengths) - 1

    def _move(self, k: int, cosine: float, length: float, single: Floats) -> None:
        """Move category `k` towards a sample with this cosine and length."""
        retained = (1.0 - self.learning_rate) * self.lengths[k]
        share = self.learning_rate * length / (retained + self.learning_rate * length)
        norm = (1 - share) ** 2 + share**2 + 2 * share * (1 - share) * cosine
        norm = max(norm, 0.0) ** 0.5
        scale = 1.0 / norm if norm > 0.0 else 1.0  # zero if opposite vectors cancel
        row = self.rows[k]
        row *= (1.0 - share) * scale
        row += (share * scale) * single
        self.lengths[k] = (retained + self.learning_rate * length) * norm


def move_categories(
    directions: Floats, lengths: Floats, vectors: Floats, learning_rate: float
) -> tuple[Indices, Floats]:
    """Move categories towards vectors that match them best; return the matches and their cosines.

    `directions` (category, feature) and `lengths` (category,) of categories W are changed in place,
    by W += (X - W) dt for each vector X of `vectors` (test, feature) in turn. A zero vector matches
    no category: its match is -1, its cosine 0.
    """
    category = np.full(len(vectors), NO_CATEGORY)
    cosine = np.zeros(len(vectors))
    for i, (x, length) in enumerate(zip(*unit_vectors(vectors), strict=True)):
        if length == 0.0:
            continue
        cosines = directions @ x
        category[i] = k = cosines.argmax()
        cosine[i] = cosines[k]
        # W + (X - W) dt = (a + b) [w + b / (a + b) (x - w)]: squares neither overflow nor vanish.
        w, a, b = directions[k], (1.0 - learning_rate) * lengths[k], learning_rate * length
        w += (x - w) * (b / (a + b))
        norm = float(w @ w) ** 0.5
        if norm > 0.0:  # zero only if opposite vectors cancel exactly
            w /= norm
        lengths[k] = (a + b) * norm
    return category, np.clip(cosine, -1.0, 1.0)


def _presentation_order(similarities: Similarities, order: Indices | None) -> Indices:
    """Return the samples that have a direction in order of presentation."""
    count = len(similarities.lengths)
    samples = np.arange(count) if order is None else order
    presented = require_all("order", samples, whole=True, minimum=0, below=count).astype(np.intp)
    if presented.ndim != 1:
        raise ValueError(f"order has shape {presented.shape}, but must be (sample,)")
    counts = np.bincount(presented, minlength=count)
    if counts.max() > 1:
        raise ValueError(f"order has {counts.argmax()} more than once, but samples must differ")
    presented = presented[similarities.lengths[presented] > 0]
    if not presented.size:
        raise ValueError("order holds no vector with a direction, but must hold at least one")
    return presented


def _single_sample_rows(
    similarities: Similarities, blocks: list[Indices], width: int
) -> list[Floats]:
    """Return the rows of `_Categories` for categories of a single sample, block by block.

    Up to `BLOCK` samples form one block.
    """
    coordinates = similarities.coordinates
    singles = []
    for block in blocks:
        directions = similarities.directions[block]
        between = (
            similarities.sample_cosines
            if similarities.has_few_samples
            else directions @ directions.T
        )
        padding = np.zeros((len(block), width - len(block)))
        singles.append(np.hstack([between, padding, coordinates[block]]))
    return singles

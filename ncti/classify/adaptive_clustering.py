"""The Adaptive Clustering Network: categories that form by themselves, then take a ship's name."""

from __future__ import annotations

import warnings
from numbers import Integral, Real
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClassifierMixin, _fit_context
from sklearn.exceptions import ConvergenceWarning
from sklearn.utils._param_validation import Interval
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, validate_data

from ncti.classify.directions import NO_CATEGORY, SAME_DIRECTION, polar

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]


class AdaptiveClusteringNetwork(ClassifierMixin, BaseEstimator):
    """Cluster vectors by direction, name each category after the ship seen there most often.

    Parameters
    ----------
    vigilance : float, default=0.95
        Cosine that the best match must exceed for a vector to join its category; a vector
        that no category matches so well founds a new one. In [-1, 1]; at 1 only vectors of
        the same direction (cosine above 1 - 1e-12) share a category.
    learning_rate : float, default=0.1
        Fraction of the way a category moves towards each vector that joins it. In (0, 1].
    max_passes : int, default=100
        Presentations of the training set after which to stop, settled or not.

    Attributes
    ----------
    categories_ : (category, feature) float64 ndarray
        The long-term memory traces W of the categories that hold training vectors at the
        end, oldest first.
    category_labels_ : (category,) ndarray
        Label of most training vectors of the category; of equals, the first in `classes_`.
    labels_ : (sample,) intp ndarray
        Category of each training vector in the last pass; -1 for a zero vector.
    n_categories_ : int
        Number of categories. Those that lost all their vectors are dropped.
    n_passes_ : int
        Passes over the training set, the last one, which changed nothing, included.
    converged_ : bool
        Whether the last pass left every vector in its category.
    classes_ : (class,) ndarray
        The labels seen in training.

    Notes
    -----
    M. M. Menon's network as the Lincoln Laboratory laser-radar study used it. The first
    vector founds the first category. Each vector X then looks for its best match

        rho_max = max over k of X.W_k / (|X| |W_k|)

    and, if rho_max exceeds the vigilance, moves it by W_k += (X - W_k) dt; otherwise X
    founds a category, W = X. The training set is presented in the given order, again and
    again, until a whole pass changes no assignment. The labels play no part in that: they
    only name the categories afterwards.

    What follows from the rule, and what does not:

    - Categories depend on the order of the vectors. Of equally good matches the oldest wins.
    - W_k is a weighted mean of vectors that joined it, so it never grows beyond the longest
      of them. Longer vectors pull harder; normalise them if that is not meant.
    - When all pairs of vectors agree better than the vigilance (>= 0), there is one category.
      When no two distinct directions do, each has its own. In between, the number of
      categories usually rises with the vigilance, but not always.
    - A zero vector has no direction: its similarity is 0, it neither founds nor moves a
      category, and `match` answers -1.

    A category is kept as a unit direction w and a length s, W = s w, so that matching is one
    product and neither huge nor tiny vectors overflow or vanish in a square:
    W + (X - W) dt = (a + b) [w + f (x - w)] with a = (1 - dt) s, b = dt |X|, f = b/(a + b).
    """

    _parameter_constraints: ClassVar[dict] = {
        "vigilance": [Interval(Real, -1, 1, closed="both")],
        "learning_rate": [Interval(Real, 0, 1, closed="right")],
        "max_passes": [Interval(Integral, 1, None, closed="left")],
    }

    def __init__(
        self, *, vigilance: float = 0.95, learning_rate: float = 0.1, max_passes: int = 100
    ) -> None:
        self.vigilance = vigilance
        self.learning_rate = learning_rate
        self.max_passes = max_passes

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Form the categories from X, then name them by y.

        Parameters
        ----------
        X : (sample, feature) array_like
            Training vectors, in order of presentation; not all of them zero.
        y : (sample,) array_like
            Their labels.

        Returns
        -------
        AdaptiveClusteringNetwork
            Itself, fitted.

        Raises
        ------
        ValueError
            When X or y is malformed, holds NaN or infinity, or X has only zero vectors.

        Warns
        -----
        ConvergenceWarning
            When assignments still change after `max_passes` passes.
        """
        vectors, labels = validate_data(self, X, y, dtype=np.float64)
        check_classification_targets(labels)
        self.classes_, class_of_sample = np.unique(labels, return_inverse=True)

        directions, lengths = polar(vectors)
        if not lengths.any():
            raise ValueError("X has only zero vectors; at least one must have a direction.")
        memory = _Memory(vectors.shape[1], self.learning_rate)
        vigilance = min(self.vigilance, SAME_DIRECTION)
        assigned: Indices = np.full(len(vectors), NO_CATEGORY)
        self.n_passes_, self.converged_ = 0, False
        while not self.converged_ and self.n_passes_ < self.max_passes:
            previous, assigned = assigned, memory.train(directions, lengths, vigilance)
            self.n_passes_ += 1
            self.converged_ = np.array_equal(assigned, previous)
        if not self.converged_:
            warnings.warn(
                f"The categories still changed in pass {self.max_passes}: raise max_passes "
                "or lower learning_rate.",
                ConvergenceWarning,
                stacklevel=2,
            )

        # A category that lost all its vectors has no name and must not answer.
        matched = assigned != NO_CATEGORY
        live, category = np.unique(assigned[matched], return_inverse=True)
        self.labels_ = np.full(len(vectors), NO_CATEGORY)
        self.labels_[matched] = category
        self.categories_ = memory.traces()[live]
        self.n_categories_ = len(live)

        votes = np.zeros((self.n_categories_, len(self.classes_)), dtype=np.intp)
        np.add.at(votes, (category, class_of_sample[matched]), 1)
        self.category_labels_ = self.classes_[votes.argmax(axis=1)]
        return self

    def match(self, X: ArrayLike, *, learning: bool = False) -> tuple[Indices, Floats]:
        """Best-matching category of each vector, whatever the vigilance.

        Parameters
        ----------
        X : (sample, feature) array_like
            Vectors to classify.
        learning : bool, default=False
            Let each vector move a copy of its category before the next one is matched, at
            the training's learning rate; the answers then depend on the order of X. The
            fitted categories themselves never change.

        Returns
        -------
        category : (sample,) intp ndarray
            Row of `categories_`; -1 for a zero vector.
        similarity : (sample,) float64 ndarray
            Cosine to that category, in [-1, 1]; 0 for a zero vector. To reject what the
            training has not seen, compare it with a vigilance of your own.
        """
        check_is_fitted(self)
        vectors = validate_data(self, X, dtype=np.float64, reset=False)
        directions, lengths = polar(vectors)
        if learning:
            memory = _Memory.holding(self.categories_, self.learning_rate)
            category, similarity = memory.follow(directions, lengths)
        else:
            cosines = directions @ polar(self.categories_)[0].T
            category = cosines.argmax(axis=1)
            similarity = np.take_along_axis(cosines, category[:, None], axis=1)[:, 0]
        category[lengths == 0] = NO_CATEGORY
        return category, np.clip(similarity, -1.0, 1.0)

    def predict(self, X: ArrayLike) -> NDArray:
        """Label of the best-matching category of each vector.

        Parameters
        ----------
        X : (sample, feature) array_like
            Vectors to classify.

        Returns
        -------
        (sample,) ndarray
            Labels. A zero vector matches nothing and gets the oldest category's, for want
            of a better guess; `match` tells.
        """
        category, _ = self.match(X)
        return self.category_labels_[np.maximum(category, 0)]

    def predict_learning(self, X: ArrayLike) -> NDArray:
        """Label each vector while the categories go on learning, as the source tested.

        Parameters
        ----------
        X : (sample, feature) array_like
            Vectors to classify, in order of presentation.

        Returns
        -------
        (sample,) ndarray
            Labels; for zero vectors see `predict`.

        Notes
        -----
        The source tested at the training's learning rate with the vigilance near zero, so
        that every vector falls into an established category: no new one is founded here.
        The fitted categories stay as they are, so calling again gives the same answer.
        """
        category, _ = self.match(X, learning=True)
        return self.category_labels_[np.maximum(category, 0)]


class _Memory:
    """The growing set of categories, as unit directions and lengths in preallocated rows."""

    def __init__(self, n_features: int, learning_rate: float) -> None:
        self.learning_rate = learning_rate
        self.count = 0
        self.directions: Floats = np.empty((32, n_features))
        self.lengths: list[float] = []

    @classmethod
    def holding(cls, traces: Floats, learning_rate: float) -> _Memory:
        """A memory that starts with a copy of `traces`."""
        memory = cls(traces.shape[1], learning_rate)
        memory.directions, lengths = polar(traces)
        memory.lengths = lengths.tolist()
        memory.count = len(lengths)
        return memory

    def traces(self) -> Floats:
        """The categories W."""
        return self.directions[: self.count] * np.array(self.lengths)[:, None]

    def train(self, directions: Floats, lengths: Floats, vigilance: float) -> Indices:
        """Present all vectors once; returns the category each one joined or founded."""
        assigned = np.full(len(directions), NO_CATEGORY)
        for i, (x, length) in enumerate(zip(directions, lengths.tolist(), strict=True)):
            if length == 0.0:
                continue
            k, similarity = self._best_match(x)
            if similarity > vigilance:
                self._learn(k, x, length)
            else:
                k = self._found(x, length)
            assigned[i] = k
        return assigned

    def follow(self, directions: Floats, lengths: Floats) -> tuple[Indices, Floats]:
        """Present all vectors once without founding; returns best matches and their cosines."""
        assigned = np.full(len(directions), NO_CATEGORY)
        similarities = np.zeros(len(directions))
        for i, (x, length) in enumerate(zip(directions, lengths.tolist(), strict=True)):
            if length == 0.0:
                continue
            assigned[i], similarities[i] = k, _ = self._best_match(x)
            self._learn(k, x, length)
        return assigned, similarities

    def _best_match(self, x: Floats) -> tuple[int, float]:
        if self.count == 0:
            return NO_CATEGORY, -np.inf
        cosines = self.directions[: self.count] @ x
        k = int(cosines.argmax())
        return k, float(cosines[k])

    def _learn(self, k: int, x: Floats, length: float) -> None:
        """Move category k by W += (X - W) dt."""
        w = self.directions[k]
        a = (1.0 - self.learning_rate) * self.lengths[k]
        b = self.learning_rate * length
        w += (x - w) * (b / (a + b))
        norm = float(w @ w) ** 0.5
        if norm > 0.0:  # it is zero only where opposite vectors cancel exactly
            w /= norm
        self.lengths[k] = (a + b) * norm

    def _found(self, x: Floats, length: float) -> int:
        """Start a category at vector X = length x."""
        if self.count == len(self.directions):
            self.directions = np.concatenate([self.directions, np.empty_like(self.directions)])
        self.directions[self.count] = x
        self.lengths.append(length)
        self.count += 1
        return self.count - 1

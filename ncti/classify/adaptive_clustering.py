"""The Adaptive Clustering Network: unsupervised categories, labelled after training."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from numbers import Integral, Real
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.exceptions import ConvergenceWarning
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, validate_data

from ncti.classify.constraints import Interval, fit_context
from ncti.classify.directions import MAX_PASSES, NO_CATEGORY, SAME_DIRECTION, polar

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]


class AdaptiveClusteringNetwork(ClassifierMixin, BaseEstimator):
    """Cluster vectors by direction and label each category by the majority of its vectors.

    Parameters
    ----------
    vigilance : float, default=0.95
        Cosine that the best match must exceed for a vector to join its category; otherwise the
        vector founds a new one. In [-1, 1]; at 1 only vectors of the same direction (cosine above
        1 - 1e-12) share a category.
    learning_rate : float, default=0.1
        Fraction of the way by which a category moves towards each vector that joins it, in (0, 1].
    max_passes : int, default=200
        Largest number of presentations of the training set.

    Attributes
    ----------
    categories_ : (category, feature) float64 ndarray
        Long-term memory traces W of the categories that hold training vectors at the end, oldest
        first.
    category_labels_ : (category,) ndarray
        Most frequent label in the category; of equals, the first in `classes_`.
    labels_ : (sample,) intp ndarray
        Category of each training vector in the last pass; -1 for a zero vector.
    n_categories_ : int
        Number of categories; those that lost all their vectors are dropped.
    n_passes_ : int
        Passes over the training set, including the last one, which changed nothing.
    converged_ : bool
        True if the last pass left every vector in its category.
    classes_ : (class,) ndarray
        The labels seen in training.

    See Also
    --------
    cluster : The same network from cosines, which further vigilances and orders share.
    ncti.features.profile_vector : Profiles as vectors.
    ncti.evaluate.category_formation : Categories by ship and aspect.

    Notes
    -----
    The network of M. M. Menon as used in [1]_. The first vector founds the first category. Each
    vector X is then compared with all categories,

        rho_max = max over k of X.W_k / (|X| |W_k|),

    and, if rho_max exceeds the vigilance, moves the best match by W_k += (X - W_k) dt; otherwise X
    founds a category, W = X. The training set is presented repeatedly in the given order, until a
    whole pass changes no assignment. Labels have no influence on the categories; they only name
    them afterwards.

    Properties:

    - Categories depend on the order of the vectors. Of equally good matches the oldest wins.
    - W_k is a weighted mean of the vectors that joined it, so it never becomes longer than the
      longest of them. Longer vectors have more weight; normalise them to avoid this.
    - If all pairs of vectors have a cosine above the vigilance (>= 0), there is one category. If no
      two distinct directions do, each has its own. In between, the number of categories usually
      rises with the vigilance, but not always.
    - A zero vector has no direction: its similarity is 0, it neither founds nor moves a category,
      and `match` returns -1 for it.

    A category is stored as a unit direction w and a length s, W = s w, so that matching is one
    product and the squares of huge or tiny vectors neither overflow nor vanish:
    W + (X - W) dt = (a + b) [w + f (x - w)] with a = (1 - dt) s, b = dt |X|, f = b/(a + b).

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, section "Adaptive Clustering Network" and Figure 18.

    Examples
    --------
    Two directions form two categories, whichever ship comes first. A vigilance above the cosine
    within each pair, 0.995, gives every vector a category of its own:

    >>> import numpy as np
    >>> from ncti.classify import AdaptiveClusteringNetwork
    >>> X = np.array([[1.0, 0.1], [0.2, 1.0], [1.0, 0.2], [0.1, 1.0]])
    >>> y = ["duncan", "roberts", "duncan", "roberts"]
    >>> network = AdaptiveClusteringNetwork(vigilance=0.95).fit(X, y)
    >>> network.labels_
    array([0, 1, 0, 1])
    >>> network.predict([[3.0, 1.0], [1.0, 2.0]]).tolist()
    ['duncan', 'roberts']
    >>> AdaptiveClusteringNetwork(vigilance=0.999).fit(X, y).n_categories_
    4
    """

    _parameter_constraints: ClassVar[dict] = {
        "vigilance": [Interval(Real, -1, 1, closed="both")],
        "learning_rate": [Interval(Real, 0, 1, closed="right")],
        "max_passes": [Interval(Integral, 1, None, closed="left")],
    }

    def __init__(
        self, *, vigilance: float = 0.95, learning_rate: float = 0.1, max_passes: int = MAX_PASSES
    ) -> None:
        self.vigilance = vigilance
        self.learning_rate = learning_rate
        self.max_passes = max_passes

    @fit_context(prefer_skip_nested_validation=True)
    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Form the categories from X and label them by y.

        Parameters
        ----------
        X : (sample, feature) array_like
            Training vectors in order of presentation, not all of them zero.
        y : (sample,) array_like
            Labels of the vectors.

        Returns
        -------
        AdaptiveClusteringNetwork
            The fitted network itself.

        Raises
        ------
        ValueError
            If X or y is malformed, holds NaN or infinity, or X has only zero vectors.

        Warns
        -----
        ConvergenceWarning
            If assignments still change after `max_passes` passes.
        """
        vectors, labels = validate_data(self, X, y, dtype=np.float64)
        check_classification_targets(labels)
        self.classes_, class_of_sample = np.unique(labels, return_inverse=True)

        directions, lengths = polar(vectors)
        if not lengths.any():
            raise ValueError("X has only zero vectors, but must have one with a direction")

        # Present the training set until a whole pass changes no assignment.
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
                f"The categories still changed in pass {self.max_passes}: increase max_passes "
                "or reduce learning_rate.",
                ConvergenceWarning,
                stacklevel=2,
            )

        # A category that lost all its vectors has no label and is dropped.
        matched = assigned != NO_CATEGORY
        live, category = np.unique(assigned[matched], return_inverse=True)
        self.labels_ = np.full(len(vectors), NO_CATEGORY)
        self.labels_[matched] = category
        self.categories_ = memory.traces()[live]
        self.n_categories_ = len(live)

        # Label each category by majority.
        votes = np.zeros((self.n_categories_, len(self.classes_)), dtype=np.intp)
        np.add.at(votes, (category, class_of_sample[matched]), 1)
        self.category_labels_ = self.classes_[votes.argmax(axis=1)]
        return self

    def match(self, X: ArrayLike, *, learning: bool = False) -> tuple[Indices, Floats]:
        """Return the best-matching category of each vector, regardless of the vigilance.

        Parameters
        ----------
        X : (sample, feature) array_like
            Vectors to classify.
        learning : bool, default=False
            Let each vector move a copy of its category, at the learning rate of the training,
            before the next one is matched; the result then depends on the order of X. The article
            tested in this way. The fitted categories themselves never change.

        Returns
        -------
        category : (sample,) intp ndarray
            Row of `categories_`; -1 for a zero vector.
        similarity : (sample,) float64 ndarray
            Cosine to that category, in [-1, 1]; 0 for a zero vector. A threshold on it rejects
            vectors that resemble none of the training.
        """
        check_is_fitted(self)
        if learning:
            return self.follower()(X)
        vectors = validate_data(self, X, dtype=np.float64, reset=False)
        directions, lengths = polar(vectors)
        cosines = directions @ polar(self.categories_)[0].T
        category = cosines.argmax(axis=1)
        similarity = np.take_along_axis(cosines, category[:, None], axis=1)[:, 0]
        category[lengths == 0] = NO_CATEGORY
        return category, np.clip(similarity, -1.0, 1.0)

    def follower(self) -> Callable[[ArrayLike], tuple[Indices, Floats]]:
        """Return a function that matches vectors as `match` does while learning.

        It goes on where the call before has left the copy of the categories, so that vectors may
        be presented in several calls.
        """
        check_is_fitted(self)
        memory = _Memory.from_traces(self.categories_, self.learning_rate)

        def match(X: ArrayLike) -> tuple[Indices, Floats]:
            vectors = validate_data(self, X, dtype=np.float64, reset=False)
            category, similarity = memory.follow(*polar(vectors))
            return category, np.clip(similarity, -1.0, 1.0)

        return match

    def predict(self, X: ArrayLike) -> NDArray:
        """Return the label of the best-matching category of each vector.

        Parameters
        ----------
        X : (sample, feature) array_like
            Vectors to classify.

        Returns
        -------
        (sample,) ndarray
            Labels. A zero vector matches nothing and gets the label of the oldest category;
            `match` identifies such vectors.
        """
        category, _ = self.match(X)
        return self.category_labels_[np.maximum(category, 0)]


class _Memory:
    """Growing set of categories, stored as unit directions and lengths in preallocated rows."""

    def __init__(self, n_features: int, learning_rate: float) -> None:
        self.learning_rate = learning_rate
        self.count = 0
        self.directions: Floats = np.empty((32, n_features))
        self.lengths: list[float] = []

    @classmethod
    def from_traces(cls, traces: Floats, learning_rate: float) -> _Memory:
        """Return a memory that holds a copy of `traces`."""
        memory = cls(traces.shape[1], learning_rate)
        memory.directions, lengths = polar(traces)
        memory.lengths = lengths.tolist()
        memory.count = len(lengths)
        return memory

    def traces(self) -> Floats:
        """Return the (category, feature) categories W."""
        return self.directions[: self.count] * np.array(self.lengths)[:, None]

    def train(self, directions: Floats, lengths: Floats, vigilance: float) -> Indices:
        """Present all vectors once; return the category that each one joined or founded."""
        assigned = np.full(len(directions), NO_CATEGORY)
        for i, (x, length) in enumerate(zip(directions, lengths.tolist(), strict=True)):
            if length == 0.0:
                continue
            k, similarity = self._best_match(x)
            if similarity > vigilance:
                self._learn(k, x, length)
            else:
                k = self._add_category(x, length)
            assigned[i] = k
        return assigned

    def follow(self, directions: Floats, lengths: Floats) -> tuple[Indices, Floats]:
        """Present all vectors once without founding; return best matches and their cosines."""
        assigned = np.full(len(directions), NO_CATEGORY)
        similarities = np.zeros(len(directions))
        for i, (x, length) in enumerate(zip(directions, lengths.tolist(), strict=True)):
            if length == 0.0:
                continue
            assigned[i], similarities[i] = k, _ = self._best_match(x)
            self._learn(k, x, length)
        return assigned, similarities

    def _best_match(self, x: Floats) -> tuple[int, float]:
        """Return the category with the largest cosine to a unit direction, and that cosine."""
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
        if norm > 0.0:  # zero only if opposite vectors cancel exactly
            w /= norm
        self.lengths[k] = (a + b) * norm

    def _add_category(self, x: Floats, length: float) -> int:
        """Found a category at the vector X = length x, and return its number."""
        if self.count == len(self.directions):
            self.directions = np.concatenate([self.directions, np.empty_like(self.directions)])
        self.directions[self.count] = x
        self.lengths.append(length)
        self.count += 1
        return self.count - 1

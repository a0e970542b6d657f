"""The Adaptive Clustering Network: unsupervised categories, labelled after training."""

from __future__ import annotations

import warnings
from numbers import Integral, Real
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.exceptions import ConvergenceWarning
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, validate_data

from ncti.classify.clustering import Similarities, cluster, move_categories
from ncti.classify.constraints import Interval, fit_context
from ncti.classify.directions import MAX_PASSES, NO_CATEGORY, unit_vectors

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
    cluster : Trains categories from precomputed cosines, shared between vigilances and orders.
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

        if not vectors.any():
            raise ValueError("X has only zero vectors, but must have one with a direction")
        similarities = Similarities.of(vectors)
        clustering = cluster(
            similarities,
            vigilance=self.vigilance,
            learning_rate=self.learning_rate,
            max_passes=self.max_passes,
        )
        self.n_passes_, self.converged_ = clustering.passes, clustering.converged
        if not self.converged_:
            warnings.warn(
                f"The categories still changed in pass {self.max_passes}: increase max_passes "
                "or reduce learning_rate.",
                ConvergenceWarning,
                stacklevel=2,
            )

        self.labels_ = clustering.labels
        self.categories_ = clustering.category_vectors(similarities)
        self.n_categories_ = len(self.categories_)
        self.category_labels_ = self.classes_[clustering.majority_labels(class_of_sample)]
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
        vectors = validate_data(self, X, dtype=np.float64, reset=False)
        categories, sizes = unit_vectors(self.categories_)
        if learning:
            return move_categories(categories, sizes, vectors, self.learning_rate)
        directions, lengths = unit_vectors(vectors)
        cosines = directions @ categories.T
        category = cosines.argmax(axis=1)
        similarity = np.take_along_axis(cosines, category[:, None], axis=1)[:, 0]
        category[lengths == 0] = NO_CATEGORY
        return category, np.clip(similarity, -1.0, 1.0)

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

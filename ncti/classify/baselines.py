"""Baseline classifier: nearest neighbour by correlation."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, validate_data

from ncti.checks import require_flags, require_shape
from ncti.classify.blocks import row_blocks
from ncti.classify.directions import unit_vectors

NO_TEMPLATE = -1

# Cosines this close count as equal; inner products of some hundred elements round to less.
TIE_TOLERANCE = 1e-12

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]


class CorrelationNeighbour(ClassifierMixin, BaseEstimator):
    """Classify by the training vector with the largest cosine.

    Attributes
    ----------
    templates_ : (template, feature) float64 ndarray
        Unit directions of the training vectors; zero for a zero vector.
    labels_ : (template,) ndarray
        Labels of the training vectors.
    classes_ : (class,) ndarray
        The labels seen in training.

    See Also
    --------
    AdaptiveClusteringNetwork : Classifier with fewer templates, which it learns.
    GaussianTemplates : Optimal classifier for known noise.

    Notes
    -----
    The cosine is that of the vectors as given. For centred vectors it is the correlation
    coefficient of Pearson; the caller decides on centring. Trained on expected profiles this is
    the correlation receiver, the matched filter for profiles of unknown gain in white noise.
    Trained on noisy averages, it shows the benefit of examples that contain noise.

    Samples are compared in blocks, so that memory grows with samples and templates, not with their
    product. Of equally good matches, to 1e-12, the first wins. A zero vector has no direction: as a
    template it is never chosen, and as a sample it matches none (`match` returns -1).

    Examples
    --------
    A gain does not change the answer:

    >>> from ncti.classify import CorrelationNeighbour
    >>> neighbour = CorrelationNeighbour().fit([[1, 5, 1], [5, 1, 1]], ["duncan", "roberts"])
    >>> neighbour.predict([[1, 4, 2], [10, 40, 20]]).tolist()
    ['duncan', 'duncan']
    >>> template, cosine = neighbour.match([[1, 4, 2]])
    >>> template, cosine.round(3)
    (array([0]), array([0.966]))
    """

    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Store the directions of X and their labels.

        Parameters
        ----------
        X : (template, feature) array_like
            Training vectors, not all of them zero.
        y : (template,) array_like
            Labels of the vectors.

        Returns
        -------
        CorrelationNeighbour
            The fitted classifier itself.

        Raises
        ------
        ValueError
            If X or y is malformed, holds NaN or infinity, or X has only zero vectors.
        """
        vectors, self.labels_ = validate_data(self, X, y, dtype=np.float64)
        check_classification_targets(self.labels_)
        self.classes_ = np.unique(self.labels_)
        self.templates_, lengths = unit_vectors(vectors)
        if not lengths.any():
            raise ValueError("X has only zero vectors, but must have one with a direction")
        self._is_zero = lengths == 0.0
        return self

    def match(self, X: ArrayLike, *, exclude: ArrayLike = False) -> tuple[Indices, Floats]:
        """Return the template nearest to each vector.

        Parameters
        ----------
        X : (sample, feature) array_like
            Vectors to classify.
        exclude : (sample, template) or (template,) array_like of bool, default=False
            Templates to leave out for a sample, such as those of its own view.

        Returns
        -------
        template : (sample,) intp ndarray
            Row of `templates_`; -1 for a zero vector, and if no template is left.
        similarity : (sample,) float64 ndarray
            Cosine to that template, in [-1, 1]; 0 if there is none.

        Raises
        ------
        ValueError
            If X is malformed or holds NaN or infinity, or `exclude` has another shape.
        """
        check_is_fitted(self)
        vectors = validate_data(self, X, dtype=np.float64, reset=False)
        shape = len(vectors), len(self.templates_)
        excluded = require_flags("exclude", exclude)
        require_shape("exclude", excluded, (), shape[1:], shape)
        full = np.broadcast_to(excluded, shape)
        template, similarity = np.empty(shape[0], dtype=np.intp), np.empty(shape[0])
        for rows in row_blocks(shape[0]):
            # A single row of flags serves all samples.
            flags = full[rows] if excluded.ndim == 2 else full[:1]
            template[rows], similarity[rows] = self._nearest_templates(vectors[rows], flags)
        return template, similarity

    def predict(self, X: ArrayLike) -> NDArray:
        """Return the label of the template nearest to each vector.

        Parameters
        ----------
        X : (sample, feature) array_like
            Vectors to classify.

        Returns
        -------
        (sample,) ndarray
            Labels. A zero vector matches nothing and gets the label of the first template;
            `match` identifies such vectors.
        """
        template, _ = self.match(X)
        return self.labels_[np.maximum(template, 0)]

    def _nearest_templates(
        self, vectors: Floats, excluded: NDArray[np.bool_]
    ) -> tuple[Indices, Floats]:
        """Return `match` of a block of (sample, feature) vectors, whose cosines fit in memory.

        `excluded` (sample or 1, template) flags templates to leave out.
        """
        directions, lengths = unit_vectors(vectors)
        cosines = directions @ self.templates_.T
        hidden = excluded | self._is_zero
        if hidden.any():
            cosines[np.broadcast_to(hidden, cosines.shape)] = -np.inf
        highest = cosines.max(axis=1)
        answers = (lengths > 0) & (highest > -np.inf)
        # Only the best cosines are clipped: rounding exceeds 1 by less than `TIE_TOLERANCE`.
        template = (cosines >= np.clip(highest, -1.0, 1.0)[:, None] - TIE_TOLERANCE).argmax(axis=1)
        similarity = np.take_along_axis(cosines, template[:, None], axis=1)[:, 0]
        similarity = np.where(answers, np.clip(similarity, -1.0, 1.0), 0.0)
        return np.where(answers, template, NO_TEMPLATE), similarity

"""Plain classifiers to hold the others against."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, validate_data

from ncti.classify.directions import polar

NO_TEMPLATE = -1

# Cosines this close are equal: rounding of inner products of some hundred elements is less.
TIE = 1e-12

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]


class CorrelationNeighbour(ClassifierMixin, BaseEstimator):
    """Nearest neighbour by correlation: the label of the training vector with the largest cosine.

    Attributes
    ----------
    templates_ : (template, feature) float64 ndarray
        Unit directions of the training vectors; zero for a zero vector.
    labels_ : (template,) ndarray
        Their labels.
    classes_ : (class,) ndarray
        The labels seen in training.

    Notes
    -----
    The cosine is that of the vectors as given. Of centred vectors it is Pearson's correlation;
    centring is left to the caller. Trained on expected profiles it is the correlation
    receiver, the matched filter of profiles of unknown gain in white noise; trained on noisy
    averages it shows what examples with the noise in them are worth.

    Of equally good matches, to 1e-12, the first wins. A zero vector has no direction: as a
    template it never answers, and as a sample it matches none (`match` answers -1).
    """

    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Keep the directions of X and their labels.

        Parameters
        ----------
        X : (template, feature) array_like
            Training vectors, not all of them zero.
        y : (template,) array_like
            Their labels.

        Returns
        -------
        CorrelationNeighbour
            Itself, fitted.

        Raises
        ------
        ValueError
            When X or y is malformed, holds NaN or infinity, or X has only zero vectors.
        """
        vectors, self.labels_ = validate_data(self, X, y, dtype=np.float64)
        check_classification_targets(self.labels_)
        self.classes_ = np.unique(self.labels_)
        self.templates_, lengths = polar(vectors)
        if not lengths.any():
            raise ValueError("X has only zero vectors; at least one must have a direction.")
        return self

    def similarity(self, X: ArrayLike) -> Floats:
        """Cosine of each vector to each template.

        Parameters
        ----------
        X : (sample, feature) array_like
            Vectors to compare.

        Returns
        -------
        (sample, template) float64 ndarray
            In [-1, 1]; 0 where either is zero.
        """
        return self._cosines(X)[0]

    def match(self, X: ArrayLike, *, exclude: ArrayLike = False) -> tuple[Indices, Floats]:
        """Template nearest to each vector.

        Parameters
        ----------
        X : (sample, feature) array_like
            Vectors to classify.
        exclude : (sample, template) or (template,) array_like of bool, default=False
            Templates that do not answer for a sample, such as those of its own view.

        Returns
        -------
        template : (sample,) intp ndarray
            Row of `templates_`; -1 for a zero vector, and where no template may answer.
        similarity : (sample,) float64 ndarray
            Cosine to that template, in [-1, 1]; 0 where there is none.

        Raises
        ------
        ValueError
            When X is malformed or holds NaN or infinity, or `exclude` has another shape.
        """
        cosines, answers = self._cosines(X)
        left_out = np.asarray(exclude, dtype=bool)
        if left_out.shape not in ((), cosines.shape[1:], cosines.shape):
            raise ValueError(
                f"exclude has shape {left_out.shape}, but must be {cosines.shape} or "
                f"{cosines.shape[1:]}"
            )
        cosines[np.broadcast_to(left_out | ~self.templates_.any(axis=1), cosines.shape)] = -np.inf
        best = cosines.max(axis=1)
        template = (cosines >= best[:, None] - TIE).argmax(axis=1)
        similarity = np.take_along_axis(cosines, template[:, None], axis=1)[:, 0]
        answers &= best > -np.inf
        template[~answers], similarity[~answers] = NO_TEMPLATE, 0.0
        return template, similarity

    def predict(self, X: ArrayLike) -> NDArray:
        """Label of the template nearest to each vector.

        Parameters
        ----------
        X : (sample, feature) array_like
            Vectors to classify.

        Returns
        -------
        (sample,) ndarray
            Labels. A zero vector matches nothing and gets the first template's, for want of a
            better guess; `match` tells.
        """
        template, _ = self.match(X)
        return self.labels_[np.maximum(template, 0)]

    def _cosines(self, X: ArrayLike) -> tuple[Floats, NDArray[np.bool_]]:
        """Cosines (sample, template), and whether each sample has a direction."""
        check_is_fitted(self)
        directions, lengths = polar(validate_data(self, X, dtype=np.float64, reset=False))
        return np.clip(directions @ self.templates_.T, -1.0, 1.0), lengths > 0

"""Learning curves: accuracy over the number of training views, and of draws per view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all, require_generator, require_labels, require_shape
from ncti.evaluate.replicates import grouped_accuracy

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LearningCurve:
    """Accuracy over the number of training views and of draws.

    Attributes
    ----------
    views, draws : tuple of int
        Training views of a class, and rows of a view.
    fraction, ci_low, ci_high : (view, draw) float64 ndarray
        Share of right answers, and the ends of its 95 % interval.
    rows : (view, draw) intp ndarray
        Training rows.

    See Also
    --------
    learning_curve : Returns it.

    Examples
    --------
    >>> import numpy as np
    >>> from ncti.evaluate import LearningCurve
    >>> half = np.array([[0.5]])
    >>> LearningCurve((4,), (1,), half, half - 0.1, half + 0.1, np.array([[8]])).fraction.item()
    0.5
    """

    views: tuple[int, ...]
    draws: tuple[int, ...]
    fraction: Floats
    ci_low: Floats
    ci_high: Floats
    rows: NDArray[np.intp]


def learning_curve(
    classifier: Any,
    train: tuple[ArrayLike, ArrayLike, ArrayLike],
    test: tuple[ArrayLike, ArrayLike, ArrayLike],
    *,
    views: Sequence[int],
    draws: Sequence[int],
    rng: np.random.Generator,
) -> LearningCurve:
    """Return the accuracy of a classifier over the number of training views and of draws.

    Parameters
    ----------
    classifier : scikit-learn classifier
        A copy of it is fitted to each subset.
    train, test : tuple of (row, feature), (row,) and (row,) array_like
        Vectors, classes and views, as `ncti.to_numpy` returns them.
    views : sequence of int
        Training views of each class.
    draws : sequence of int
        Rows of each of them.
    rng : numpy.random.Generator
        Draws the order in which views are added; rows of a view are added in row order.

    Returns
    -------
    LearningCurve

    Raises
    ------
    ValueError
        If lengths differ, a class has fewer views, or a view fewer rows, than asked for.

    See Also
    --------
    score : Scores of one training.

    Notes
    -----
    Subsets are nested, so that a curve shows the gain from more data, and not the luck of another
    draw. The interval covers the sampling of tests, for the given training.

    Examples
    --------
    >>> import numpy as np
    >>> from ncti.classify import CorrelationNeighbour
    >>> from ncti.evaluate import learning_curve
    >>> X = np.repeat([[1.0, 0.1], [1.0, 0.4], [0.1, 1.0], [0.5, 1.0]], 2, axis=0)
    >>> y, view = np.repeat(["duncan", "texas"], 4), np.repeat(np.arange(4), 2)
    >>> sizes = {"views": [1, 2], "draws": [1, 2], "rng": np.random.default_rng(0)}
    >>> curve = learning_curve(CorrelationNeighbour(), (X, y, view), (X, y, view), **sizes)
    >>> curve.rows.tolist(), curve.fraction.min()
    ([[2, 4], [4, 8]], np.float64(1.0))
    """
    from sklearn.base import clone

    require_generator("rng", rng)
    parts = []
    for name, part in (("train", train), ("test", test)):
        if not isinstance(part, Sequence) or len(part) != 3:
            text = " ".join(repr(part).split())
            raise ValueError(f"{name} is {text:.60}, but must be vectors, classes and views")
        X, y, view = part
        arrays = require_all("X", X), require_labels("y", y), require_labels("groups", view)
        for array in arrays[1:]:
            require_shape(name, array, arrays[0].shape[:1])
        parts.append(arrays)
    (vectors, labels, groups), (test_vectors, truth, test_groups) = parts
    for name, counts in (("views", views), ("draws", draws)):
        checked = require_all(name, counts, whole=True, minimum=1)
        require_shape(name, checked, (checked.size,))
    _, class_index = np.unique(labels, return_inverse=True)
    distinct, first, view_index = np.unique(groups, return_index=True, return_inverse=True)
    if not np.array_equal(class_index, class_index[first][view_index]):
        raise ValueError("groups has a view of several classes, but a view must be of one")
    shuffled = rng.permutation(len(distinct))
    turn = np.empty(len(distinct), dtype=np.intp)
    turn[shuffled] = _occurrence_numbers(class_index[first][shuffled])
    rank = turn[view_index]
    order = _occurrence_numbers(view_index)
    class_sizes, view_sizes = np.bincount(class_index[first]), np.bincount(view_index)
    for name, values, sizes in (("views", views, class_sizes), ("draws", draws, view_sizes)):
        for value in values:
            require(f"each of {name}", value, maximum=sizes.min())
    fraction, low, high = np.empty((3, len(views), len(draws)))
    rows = np.empty(fraction.shape, dtype=np.intp)
    everywhere = np.zeros(len(truth))
    for place in np.ndindex(fraction.shape):
        inside = (rank < views[place[0]]) & (order < draws[place[1]])
        predicted = clone(classifier).fit(vectors[inside], labels[inside]).predict(test_vectors)
        accuracy = grouped_accuracy(predicted == truth, everywhere, test_groups)
        fraction[place], low[place], high[place] = (
            ends[-1] for ends in (accuracy.fraction, accuracy.ci_low, accuracy.ci_high)
        )
        rows[place] = inside.sum()
    return LearningCurve(tuple(views), tuple(draws), fraction, low, high, rows)


def _occurrence_numbers(kinds: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return for each element the number of equal elements before it."""
    import pandas as pd

    return pd.Series(kinds).groupby(kinds).cumcount().to_numpy(np.intp)

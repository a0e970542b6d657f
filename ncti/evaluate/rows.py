"""All scores of a classifier's answers, from arrays by row."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require_all, require_labels, require_shape
from ncti.evaluate.open_set import open_set_scores, rejection_thresholds
from ncti.evaluate.replicates import grouped_accuracy
from ncti.evaluate.scores import AspectAccuracy, axes_to_draw_in

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

BINS = 10  # of confidence, of equal width
REJECTED_SHARE = 0.9  # share of answers to unknown classes
ROUNDING = 1e-5  # of a row's sum of probabilities, which may be in single precision

Floats = NDArray[np.float64]
Integers = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Reliability:
    """Share of right answers by confidence.

    Attributes
    ----------
    confidence : (bin,) float64 ndarray
        Mean probability of the class named, over the answers in the bin; NaN without answers.
    fraction : (bin,) float64 ndarray
        Share of these answers that are right; NaN without any.
    n : (bin,) intp ndarray
        Number of answers.

    See Also
    --------
    score : Returns it.

    Examples
    --------
    >>> from ncti.evaluate import score
    >>> likely = [[0.9, 0.1], [0.9, 0.1], [0.8, 0.2]]
    >>> rows = {"classes": ["duncan", "texas"], "aspect": [0, 0, 0], "groups": [0, 1, 2]}
    >>> scores = score(["duncan", "texas", "duncan"], likely, **rows)
    >>> scores.reliability.n[7:9], scores.reliability.fraction[7:9]
    (array([1, 2]), array([1. , 0.5]))
    """

    confidence: Floats
    fraction: Floats
    n: Integers


@dataclass(frozen=True, eq=False)
class Scores:
    """Scores of a classifier's answers.

    Attributes
    ----------
    accuracy : AspectAccuracy
        Share of right answers to known classes by aspect bin, with 95 % intervals that account for
        several answers to the same view.
    classes : (class,) ndarray
        Known classes, sorted.
    confusion : (class, class) intp ndarray
        Number of answers by true class and class named.
    log_loss : float
        Mean negative logarithm of the probability of the true class [nat]; NaN without
        probabilities.
    ece : float
        Expected calibration error, the mean distance of confidence and share of right answers;
        NaN without probabilities.
    reliability : Reliability or None
        Its curve; None without probabilities.
    auroc, oscr : float
        As of `open_set_scores`; NaN without unknown classes.
    kept : float
        Share of answers to known classes that are right and accepted where 90 % of those to
        unknown classes are rejected; NaN without unknown classes.

    See Also
    --------
    score : Returns them.

    Examples
    --------
    >>> from ncti.evaluate import score
    >>> y, predicted = ["duncan", "texas", "texas"], ["duncan", "duncan", "texas"]
    >>> scores = score(y, predicted, aspect=[0, 40, 80], groups=[0, 1, 2])
    >>> scores.confusion.tolist(), scores.log_loss
    ([[1, 0], [1, 1]], nan)
    """

    accuracy: AspectAccuracy
    classes: NDArray
    confusion: Integers
    log_loss: float
    ece: float
    reliability: Reliability | None
    auroc: float
    oscr: float
    kept: float

    def to_pandas(self) -> pd.DataFrame:
        """Return the confusion: answers by true class, down, and class named, across."""
        import pandas as pd

        down, across = (pd.Index(self.classes, name=name) for name in ("true", "named"))
        return pd.DataFrame(self.confusion, down, across)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the confusion in percent of the answers to a class."""
        ax = axes_to_draw_in(ax)
        counts = self.confusion
        share = 100 * counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
        ax.imshow(share, vmin=0, vmax=100, cmap="Blues")
        for (row, column), value in np.ndenumerate(share):
            colour = "white" if value > 60 else "black"
            ax.text(column, row, f"{value:.0f}", ha="center", va="center", color=colour)
        ticks: NDArray[Any] = np.arange(len(self.classes))
        ax.set_xticks(ticks, self.classes, rotation=30)
        ax.set_yticks(ticks, self.classes)
        ax.set(xlabel="named", ylabel="true", title="answers [%]")
        return ax

    def _repr_html_(self) -> str:
        names = ("log_loss", "ece", "auroc", "oscr", "kept")
        known = {name: value for name in names if (value := getattr(self, name)) == value}
        summary = ", ".join(f"{name} {value:.2f}" for name, value in known.items())
        return f"{self.accuracy._repr_html_()}{self.to_pandas().to_html()}<p>{summary}</p>"


def score(
    y: ArrayLike,
    predicted: ArrayLike,
    *,
    aspect: ArrayLike,
    groups: ArrayLike,
    classes: ArrayLike | None = None,
    similarity: ArrayLike | None = None,
) -> Scores:
    """Return all scores of answers to rows, some of which may be of classes absent from training.

    Parameters
    ----------
    y : (row,) array_like
        True classes.
    predicted : (row,) or (row, class) array_like
        Classes named; or probabilities of the classes, as of `predict_proba`; or other values, as
        of `decision_function`, of which the largest names the class.
    aspect : (row,) array_like
        Aspects [deg], 0 to 360.
    groups : (row,) array_like
        View of each row, whose answers are correlated.
    classes : (class,) array_like, optional
        Classes learned, in the order of the columns of `predicted`. Rows of other classes are
        unknown. By default all classes of `y`.
    similarity : (row,) array_like, optional
        Score that separates known from unknown classes, larger for known ones. By default the
        largest value of `predicted`.

    Returns
    -------
    Scores

    Raises
    ------
    ValueError
        If the lengths differ, there is no row of a known class, a class named is not among the
        classes, columns have no classes, or there are unknown classes and no similarity.

    See Also
    --------
    compare : Two classifiers on the same rows.
    tabulate_scores : Scores of the answers of a sweep.

    Notes
    -----
    Rows of values that are nowhere negative and sum to 1 are taken as probabilities. The expected
    calibration error is that of [1]_ with ten bins of the confidence, the probability of the class
    named. Accuracies, confusion, log loss and calibration are of known classes alone.

    References
    ----------
    .. [1] C. Guo, G. Pleiss, Y. Sun and K. Q. Weinberger, "On calibration of modern neural
       networks", Proceedings of Machine Learning Research 70, 1321-1330 (2017).

    Examples
    --------
    Three known rows, the last of which is misnamed, and an unknown ship that looks like none:

    >>> from ncti.evaluate import score
    >>> y = ["duncan", "texas", "texas", "roberts"]
    >>> likely = [[0.9, 0.1], [0.2, 0.8], [0.7, 0.3], [0.5, 0.5]]
    >>> rows = {"aspect": [0, 40, 80, 10], "groups": [0, 1, 2, 3]}
    >>> scores = score(y, likely, classes=["duncan", "texas"], **rows)
    >>> scores.accuracy.fraction.round(2).tolist(), scores.accuracy.labels
    ([1.0, 1.0, 0.0, 0.67], ('0', '40', '80', 'overall'))
    >>> round(scores.log_loss, 3), scores.auroc, round(scores.kept, 3)
    (0.511, 1.0, 0.667)
    """
    truth = require_labels("y", y)
    if truth.ndim != 1 or not truth.size:
        raise ValueError(f"y has shape {truth.shape}, but must be a non-empty sequence")
    learned, chosen, values = _answers(truth, predicted, classes)
    if values is not None and similarity is None:
        similarity = values.max(axis=1)
    known = np.isin(truth, learned)
    if not known.any():
        names = ", ".join(map(str, learned))
        raise ValueError(f"y has {truth[0]!s}, but must have one of the classes {names}")
    views = require_labels("groups", groups)
    angles = require_all("aspect", aspect, minimum=0.0, maximum=360.0)
    for name, array in (("groups", views), ("aspect", angles)):
        require_shape(name, array, truth.shape)
    correct = chosen == truth
    loss, ece, curve = np.nan, np.nan, None
    if values is not None and _are_probabilities(values):
        loss, ece, curve = _calibration(values[known], truth[known], learned, correct[known])
    auroc = oscr = accepted = np.nan
    if not known.all():
        if similarity is None:
            raise ValueError("similarity is None, but must tell unknown classes from known ones")
        similarities = require_all("similarity", similarity)
        require_shape("similarity", similarities, truth.shape)
        areas = open_set_scores(similarities, correct, known)
        auroc, oscr = areas.auroc, areas.oscr
        [threshold] = rejection_thresholds(similarities[~known], [REJECTED_SHARE])
        accepted = float((correct & (similarities > threshold))[known].mean())
    from sklearn.metrics import confusion_matrix

    return Scores(
        accuracy=grouped_accuracy(correct[known], angles[known], views[known]),
        classes=learned,
        confusion=confusion_matrix(truth[known], chosen[known], labels=learned).astype(np.intp),
        log_loss=loss,
        ece=ece,
        reliability=curve,
        auroc=auroc,
        oscr=oscr,
        kept=accepted,
    )


def _answers(
    truth: NDArray, predicted: ArrayLike, classes: ArrayLike | None
) -> tuple[NDArray, NDArray, Floats | None]:
    """Return the sorted classes, the predicted ones (row,), and values (row, class) if any."""
    learned = np.unique(truth) if classes is None else require_labels("classes", classes)
    values = None
    if np.ndim(predicted) == 2:
        if classes is None:
            raise ValueError("classes is None, but must name the columns of predicted")
        values = require_all("predicted", predicted)
        require_shape("predicted", values, (truth.size, learned.size))
        # Columns in the order of the sorted classes, as in scikit-learn.
        order = np.argsort(learned)
        learned, values = learned[order], values[:, order]
        chosen = learned[values.argmax(axis=1)]
    else:
        learned, chosen = np.unique(learned), require_labels("predicted", predicted)
        require_shape("predicted", chosen, truth.shape)
    if not np.isin(chosen, learned).all():
        unlearned = chosen[~np.isin(chosen, learned)][0]
        raise ValueError(f"predicted has {unlearned!r}, but must be among the classes, {learned}")
    return learned, chosen, values


def _are_probabilities(values: Floats) -> bool:
    """Return whether (row, class) values are nonnegative and sum to 1."""
    return bool((values >= 0).all() and np.allclose(values.sum(axis=1), 1.0, rtol=0, atol=ROUNDING))


def _calibration(
    values: Floats, truth: NDArray, classes: NDArray, correct: NDArray[np.bool_]
) -> tuple[float, float, Reliability]:
    """Return log loss, calibration error and its curve of (row, class) probabilities."""
    from sklearn.metrics import log_loss

    likely = values / values.sum(axis=1, keepdims=True)
    loss = float(log_loss(truth, likely, labels=classes)) if classes.size > 1 else 0.0
    confidence = likely.max(axis=1)
    bin_index = np.clip(np.ceil(confidence * BINS).astype(int) - 1, 0, BINS - 1)
    n = np.bincount(bin_index, minlength=BINS)
    divisor = np.where(n > 0, n, np.nan)
    sums = (np.bincount(bin_index, weights=w, minlength=BINS) for w in (confidence, correct))
    mean, fraction = (total / divisor for total in sums)
    distance = np.abs(fraction - mean) * n
    curve = Reliability(mean, fraction, n.astype(np.intp))
    return loss, float(np.nansum(distance) / n.sum()), curve

"""One answer from several sensors: calibrated scores on the same templates, added."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all

STANDARD_ERROR = 0.5  # loss of log-likelihood one standard error from the maximum
HALVINGS = 30

Floats = NDArray[np.float64]


def label_posterior(
    scores: ArrayLike, labels: ArrayLike, *, sharpness: float = 1.0, exclude: ArrayLike = False
) -> tuple[NDArray, Floats]:
    """Probability of each label, from the scores of templates that carry them.

    Parameters
    ----------
    scores : (sample, template) array_like
        Logarithms of the density of a sample under each template, up to a number a sample; or
        what grows with them.
    labels : (template,) array_like
        What each template stands for.
    sharpness : float
        What a step of the score is worth, in natural logarithms of the density.
    exclude : (sample, template) or (template,) array_like of bool, default=False
        Templates that do not answer for a sample, such as the one it was drawn from.

    Returns
    -------
    classes : (class,) ndarray
        The labels, in order.
    posterior : (sample, class) float64 ndarray
        Rows sum to 1. Labels are equally likely beforehand, and so are the templates of a label
        that answer; a label without any has probability 0.

    Raises
    ------
    ValueError
        If shapes do not match, a score is not finite, the sharpness is no finite number from 0
        on, or all templates of a sample are left out.
    """
    values, names, left_out = _checked(scores, labels, exclude)
    require("sharpness", sharpness, minimum=0)
    # One row where all samples have the same templates.
    answers = ~np.broadcast_to(left_out, values.shape if left_out.ndim == 2 else (1, names.size))
    if not answers.any(axis=1).all():
        raise ValueError("exclude leaves out all templates of a sample, but must leave one")
    classes, label = np.unique(names, return_inverse=True)
    member = (label[:, None] == np.arange(len(classes))).astype(np.float64)
    # The best template of a sample weighs 1, so that nothing overflows and no sum is 0.
    best = values.max(axis=1, keepdims=True, initial=-np.inf, where=answers)
    weights = np.exp(sharpness * np.minimum(values - best, 0.0)) * answers
    by_class = (weights @ member) / np.maximum(answers @ member, 1.0)
    return classes, by_class / by_class.sum(axis=1, keepdims=True)


def fit_sharpness(scores: ArrayLike, labels: ArrayLike, truth: ArrayLike) -> float:
    """The sharpness that makes the most of the true labels of some samples.

    Parameters
    ----------
    scores, labels
        As for `label_posterior`; a sample or more.
    truth : (sample,) array_like
        True label of each sample.

    Returns
    -------
    float
        0 where all templates of every sample have one score or all have one label, else above 0,
        in the inverse of the scores' unit.

    Raises
    ------
    ValueError
        As `label_posterior`, if a true label is no template's, or there is not one a sample.

    Notes
    -----
    Temperature scaling (C. Guo, G. Pleiss, Y. Sun and K. Q. Weinberger 2017, On calibration of
    modern neural networks, ICML, arXiv:1706.04599): one number, fitted on samples that are not
    those to be named. It leaves the order of templates alone; it decides how much one sensor
    counts beside another.

    Where every true label has the best score, likelihood grows with the sharpness for ever. But
    n right answers in n do not say that the next one is: the labels are fitted with probability
    (n + 1)/(n + 2), the rest spread over the other labels, as J. Platt did (1999, Probabilistic
    outputs for support vector machines, in Advances in Large Margin Classifiers, MIT Press). That
    is worth one wrong answer in all, and errs towards a smaller sharpness: where nothing is
    wrong, the best label is about n times as likely as the rest. What is a log density already
    has the sharpness 1 and needs no fit.
    """
    spread, surprise = _surprise(scores, labels, truth)
    if surprise is None:
        return 0.0
    # Imported where it is used: scipy.optimize takes half a second.
    from scipy.optimize import minimize_scalar

    # Scores of any size: from next to nothing on the whole spread to certainty of its smallest
    # part. Coarse steps first: means over templates may make a hill before the valley.
    steps = np.log(np.geomspace(1e-4, 1e10, 31)) - math.log(spread)
    lowest = int(np.argmin([surprise(math.exp(step)) for step in steps]))
    bounds = (steps[max(lowest - 1, 0)], steps[min(lowest + 1, len(steps) - 1)])
    found = minimize_scalar(
        lambda logarithm: surprise(math.exp(logarithm)), bounds=bounds, method="bounded"
    )
    return math.exp(float(found.x))


def least_sharpness(
    scores: ArrayLike, labels: ArrayLike, truth: ArrayLike, *, independent: float | None = None
) -> float:
    """The smallest sharpness that the true labels of some samples do not speak against.

    Parameters
    ----------
    scores, labels, truth
        As for `fit_sharpness`.
    independent : float, optional
        How many of the samples are independent, such as the views that several were taken of;
        all by default.

    Returns
    -------
    float
        Lower end of the 68 % likelihood interval about `fit_sharpness`: 0 where scores might as
        well be noise.

    Raises
    ------
    ValueError
        As `fit_sharpness`.

    Notes
    -----
    What a sensor adds to another must not rest on luck: noise that is given weight costs right
    answers of the better sensor, while a little less weight costs a good sensor next to nothing.
    The interval is one standard error wide on either side: where the log-likelihood is within 1/2
    of its maximum (S. S. Wilks 1938, Annals of Mathematical Statistics 9, 60,
    doi:10.1214/aoms/1177732360).
    """
    _, surprise = _surprise(scores, labels, truth)
    if surprise is None:
        return 0.0
    best = fit_sharpness(scores, labels, truth)
    count = len(np.asarray(truth)) if independent is None else independent
    allowed = surprise(best) + STANDARD_ERROR / count
    if surprise(0.0) <= allowed:
        return 0.0
    low, high = 0.0, best
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if surprise(middle) <= allowed else (middle, high)
    return high


def doubted(scores: ArrayLike, labels: ArrayLike, *, doubt: float) -> Floats:
    """Log densities as of a sensor that says nothing with some probability.

    Parameters
    ----------
    scores : (sample, template) array_like
        Logarithms of the density of a sample under each template, up to a number a sample.
    labels : (template,) array_like
        What each template stands for.
    doubt : float
        That probability, from 0 to below 1; see `ncti.classify.fit_doubt`.

    Returns
    -------
    (sample, template) float64 ndarray
        log((1 - doubt) p + doubt u), p the density over its mean over all labels, and u = 1. The
        most probable label stays so; what it can outweigh is bounded.

    Raises
    ------
    ValueError
        If shapes do not match, a score is not finite or the doubt is out of range.
    """
    values, names, _ = _checked(scores, labels)
    require("doubt", doubt, minimum=0, below=1)
    best = values.max(axis=1, keepdims=True, initial=-np.inf)
    if doubt == 0:
        return np.asarray(values - best)
    _, label, count = np.unique(names, return_inverse=True, return_counts=True)
    weight = 1.0 / (count[label] * len(count))
    mean = np.log(np.exp(values - best) @ weight)[:, None]
    return np.logaddexp(math.log1p(-doubt) + values - best - mean, math.log(doubt))


def fuse(*scores: ArrayLike, sharpness: Sequence[float]) -> Floats:
    """Scores of several sensors as one.

    Parameters
    ----------
    *scores : (sample, template) array_like
        Scores of each sensor for the same samples and templates.
    sharpness : sequence of float
        What a step of each is worth: 1 of a log density, else see `fit_sharpness`.

    Returns
    -------
    (sample, template) float64 ndarray
        Their sum, each times its sharpness.

    Raises
    ------
    ValueError
        If shapes differ, there are not as many sharpnesses as scores, or one of them is no finite
        number from 0 on.

    Notes
    -----
    Noise is independent from sensor to sensor given what they look at, so that densities
    multiply. A template is a ship *at an aspect*, which both sensors see from the same
    direction: they must agree on the aspect, too, and so tell more together than two votes for
    a ship would.
    """
    values = [require_all("scores", one) for one in scores]
    sharp = require_all("sharpness", sharpness, minimum=0)
    shapes = {one.shape for one in values}
    if sharp.shape != (len(values),) or len(shapes) != 1 or values[0].ndim != 2:
        listed = ", ".join(str(one.shape) for one in values)
        raise ValueError(
            f"scores have shapes {listed} for sharpness of shape {sharp.shape}, but must be as "
            "many of one shape (sample, template)"
        )
    total = np.zeros(values[0].shape)
    for one, step in zip(values, sharp, strict=True):
        total += step * (one - one.max(axis=1, keepdims=True, initial=-np.inf))
    return total


def _checked(
    scores: ArrayLike, labels: ArrayLike, exclude: ArrayLike = False
) -> tuple[Floats, NDArray, NDArray[np.bool_]]:
    """Scores, labels and what is left out as arrays whose shapes fit."""
    values = require_all("scores", scores)
    names = np.asarray(labels)
    if values.ndim != 2 or names.shape != values.shape[1:]:
        raise ValueError(
            f"scores has shape {values.shape}, but must be (sample, template) with "
            f"{names.size} templates, one a label"
        )
    left_out = np.asarray(exclude, dtype=bool)
    if left_out.shape not in ((), names.shape, values.shape):
        raise ValueError(
            f"exclude has shape {left_out.shape}, but must be {values.shape} or {names.shape}"
        )
    return values, names, left_out


def _surprise(
    scores: ArrayLike, labels: ArrayLike, truth: ArrayLike
) -> tuple[float, Callable[[float], float] | None]:
    """Spread of scores, and the mean surprise at true labels as a function of sharpness.

    None for it where no sharpness matters.
    """
    values, names, _ = _checked(scores, labels)
    true = np.asarray(truth)
    if true.shape != values.shape[:1] or not true.size:
        raise ValueError(
            f"truth has shape {true.shape}, but must be one label a sample, ({len(values)},), of "
            "one sample or more"
        )
    unknown = np.setdiff1d(true, names)
    if unknown.size:
        raise ValueError(f"truth has {unknown[0]!r}, but must be among the labels")
    # Imported where it is used: scipy.special takes long.
    from scipy.special import logsumexp

    classes, label = np.unique(names, return_inverse=True)
    spread = float(np.ptp(values, axis=1).mean())
    if spread == 0.0 or len(classes) == 1:
        return spread, None
    share = (label[:, None] == np.arange(len(classes))) / np.bincount(label)
    # The best template of every label, and how far the others are below it: no sum is 0.
    best = np.stack([values[:, label == k].max(axis=1) for k in range(len(classes))], axis=1)
    behind = values - best[:, label]
    lead = best - best.max(axis=1, keepdims=True)
    wrong = 1.0 / (len(values) + 2)
    wanted = np.where(true[:, None] == classes, 1.0 - wrong, wrong / (len(classes) - 1))

    def surprise(sharpness: float) -> float:
        density = sharpness * lead + np.log(np.exp(sharpness * behind) @ share)
        return float((logsumexp(density, axis=1) - (wanted * density).sum(axis=1)).mean())

    return spread, surprise

"""One answer from several sensors: calibrated scores on the same templates, added."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar

from ncti.checks import require_all

SHARPEST = 1e6  # beyond it every difference in score is certainty

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
        If shapes do not match, a score is not finite, or all templates of a sample are left out.
    """
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
    """The sharpness at which the true labels of some samples are most probable.

    Parameters
    ----------
    scores, labels
        As for `label_posterior`.
    truth : (sample,) array_like
        True label of each sample.

    Returns
    -------
    float
        Between 0, where the scores tell nothing, and `SHARPEST`.

    Raises
    ------
    ValueError
        As `label_posterior`, or if a true label is no template's.

    Notes
    -----
    Temperature scaling (C. Guo, G. Pleiss, Y. Sun and K. Q. Weinberger 2017, On calibration of
    modern neural networks, ICML, arXiv:1706.04599): one number, fitted by maximum likelihood on
    samples that are not those to be named. It leaves the order of templates alone, so that a
    single sensor's best template stays the best; it decides how much one sensor counts beside
    another.
    """
    values = require_all("scores", scores)
    names, true = np.asarray(labels), np.asarray(truth)
    unknown = np.setdiff1d(true, names)
    if unknown.size:
        raise ValueError(f"truth has {unknown[0]!r}, but must be among the labels")

    def surprise(log_sharpness: float) -> float:
        classes, posterior = label_posterior(values, names, sharpness=math.exp(log_sharpness))
        right = np.take_along_axis(posterior, np.searchsorted(classes, true)[:, None], axis=1)
        return -float(np.log(np.maximum(right, 1e-300)).mean())

    spread = float(np.ptp(values, axis=1).mean())
    if spread == 0.0:
        return 0.0
    # Scores of any size: the search is over what their spread is worth, from nothing to certainty.
    low, high = math.log(1e-4 / spread), math.log(min(1e4 / spread, SHARPEST))
    # Coarse steps first: the surprise may have a plateau at either end.
    steps = np.linspace(low, max(high, low + 1.0), 33)
    best = int(np.argmin([surprise(step) for step in steps]))
    bounds = (steps[max(best - 1, 0)], steps[min(best + 1, len(steps) - 1)])
    found = minimize_scalar(surprise, bounds=bounds, method="bounded")
    return math.exp(float(found.x))


def fuse(*scores: ArrayLike, sharpness: tuple[float, ...]) -> Floats:
    """Scores of several sensors as one.

    Parameters
    ----------
    *scores : (sample, template) array_like
        Scores of each sensor for the same samples and templates.
    sharpness : tuple of float
        What a step of each is worth: see `fit_sharpness`.

    Returns
    -------
    (sample, template) float64 ndarray
        Their sum, each times its sharpness.

    Raises
    ------
    ValueError
        If shapes differ or there are not as many sharpnesses as scores.

    Notes
    -----
    Noise is independent from sensor to sensor given what they look at, so that densities
    multiply. A template is a ship *at an aspect*, which both sensors see from the same
    direction: they must agree on the aspect, too, and so tell more together than two votes for
    a ship would.
    """
    values = [require_all("scores", one) for one in scores]
    if len(values) != len(sharpness) or len({one.shape for one in values}) != 1:
        shapes = ", ".join(str(one.shape) for one in values)
        raise ValueError(
            f"scores have shapes {shapes} for {len(sharpness)} sharpnesses, but must be as many "
            "of one shape"
        )
    total = np.zeros(values[0].shape)
    for one, sharp in zip(values, sharpness, strict=True):
        total += sharp * (one - one.max(axis=1, keepdims=True))
    return total

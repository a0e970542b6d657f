"""Goodness of fit: the probability that a sample of a template lies farther from it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

MIN_TAIL = 1e-290  # probability below which an asymptotic series gives its logarithm

Floats = NDArray[np.float64]


def log_fit(scores: Floats, peak: ArrayLike, bins: int) -> Floats:
    """Return the log probability (..., template) that a sample of a template fits it worse.

    `scores` (..., template) and `peak` (template,) are `log_likelihood` and `peak` of
    `GaussianTemplates`. Twice their difference is the squared Mahalanobis distance, chi-squared
    with as many degrees of freedom as bins if the model of the template, unknown directions
    included, is true. Too large a template error makes probabilities too large, and keeps their
    order. Below 1e-290 the first terms of the asymptotic series replace the upper tail.
    """
    from scipy.special import gammaincc, gammaln

    half, shape = np.maximum(np.asarray(peak) - scores, 0.0), bins / 2
    tail = gammaincc(shape, half)
    far = np.maximum(half, shape)
    series = (shape - 1) * np.log(far) - far - gammaln(shape) - np.log1p(-(shape - 1) / far)
    with np.errstate(divide="ignore"):  # tails that underflow to 0
        result: Floats = np.where(tail > MIN_TAIL, np.log(tail), series)
    return result

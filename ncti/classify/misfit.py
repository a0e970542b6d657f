"""Goodness of fit: the probability that a sample of a template lies farther from it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all, require_shape

MIN_TAIL = 1e-290  # probability below which an asymptotic series gives its logarithm

Floats = NDArray[np.float64]


def log_fit(scores: ArrayLike, peak: ArrayLike, bins: int) -> Floats:
    """Return the log probability (..., template) of samples of a template that fit it worse.

    `scores` (..., template) and `peak` (template,) are `log_likelihood` and `peak` of
    `GaussianTemplates`. Twice their difference is the squared Mahalanobis distance, chi-squared
    with as many degrees of freedom as bins if the model of the template, unknown directions
    included, is true. Too large a template error makes probabilities too large, and keeps their
    order. Below 1e-290 the first terms of the asymptotic series replace the upper tail.
    """
    from scipy.special import gammaincc, gammaln

    values = require_all("scores", scores)
    peaks = require_all("peak", peak)
    require("bins", bins, minimum=1, whole=True)
    require_shape("peak", peaks, values.shape[-1:])
    half, shape = np.maximum(peaks - values, 0.0), bins / 2
    tail = gammaincc(shape, half)
    far = np.maximum(half, shape)
    series = (shape - 1) * np.log(far) - far - gammaln(shape) - np.log1p(-(shape - 1) / far)
    with np.errstate(divide="ignore"):  # tails that underflow to 0
        result: Floats = np.where(tail > MIN_TAIL, np.log(tail), series)
    return result

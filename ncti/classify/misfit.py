"""Goodness of fit: how probable it is that a sample of a template lies even farther from it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all, require_shape

SMALLEST = 1e-290  # probability from which on its logarithm is taken of an asymptotic series

Floats = NDArray[np.float64]


def log_fit(scores: ArrayLike, peak: ArrayLike, bins: int) -> Floats:
    """Return the log probability that a sample of a template fits it worse than the given one.

    Parameters
    ----------
    scores : (..., template) array_like
        Log densities of samples under templates; `GaussianTemplates.log_likelihood`.
    peak : (template,) array_like
        Greatest log density under each template; `GaussianTemplates.peak`.
    bins : int
        Number of bins of a sample.

    Returns
    -------
    (..., template) float64 ndarray
        Natural logarithm of the probability: 0 for a sample that is the mean of its template.

    Raises
    ------
    ValueError
        If shapes do not match, a value is not finite, or there are no bins.

    See Also
    --------
    GaussianTemplates : Classifier with these densities.
    label_posterior : Probability of labels, which says nothing of ships that are none of them.

    Notes
    -----
    Twice the difference of both log densities is the squared Mahalanobis distance, which is
    chi-squared with as many degrees of freedom as bins where the model of the template is true.
    Directions that are unknown beforehand belong to that model. Of a template error that is too
    large, the probabilities are too large, and their order is not changed. Below 1e-290 the upper
    tail is the first terms of its asymptotic series.

    Examples
    --------
    A distance of 250 is what 250 bins give, 350 is not:

    >>> import numpy as np
    >>> from ncti.classify.misfit import log_fit
    >>> np.exp(log_fit([[-125.0], [-175.0]], [0.0], 250)).ravel().round(4)
    array([0.4881, 0.    ])
    """
    # Imported where it is used: scipy.special takes a fifth of a second.
    from scipy.special import gammaincc, gammaln

    values = require_all("scores", scores)
    peaks = require_all("peak", peak)
    require("bins", bins, minimum=1, whole=True)
    require_shape("peak", peaks, values.shape[-1:])
    half, shape = np.maximum(peaks - values, 0.0), bins / 2
    tail = gammaincc(shape, half)
    far = np.maximum(half, shape)
    series = (shape - 1) * np.log(far) - far - gammaln(shape) - np.log1p(-(shape - 1) / far)
    with np.errstate(divide="ignore"):  # of tails that are smaller than any number
        result: Floats = np.where(tail > SMALLEST, np.log(tail), series)
    return result

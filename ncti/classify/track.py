"""Prior of the aspect from a track: probabilities of templates given a tracker's report."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all, require_labels, require_shape
from ncti.classify.between import CIRCLE, rows_by_label, steps

MIN_DEVIATION = 1e-3  # a smaller error of the track [deg] counts as this one

Floats = NDArray[np.float64]


def aspect_prior(
    aspect: ArrayLike, labels: ArrayLike, tracked: ArrayLike, *, sigma: float
) -> Floats:
    """Return the log prior probability of templates, given aspects that a track reports.

    Parameters
    ----------
    aspect : (template,) array_like
        Aspect of each template [deg]; distinct among templates of a label.
    labels : (template,) array_like
        Label of each template, such as a ship.
    tracked : (sample,) array_like
        Reported aspect of each sample [deg].
    sigma : float
        Standard deviation of the report [deg]. 0 leaves the nearest template of each label.

    Returns
    -------
    (sample, template) float64 ndarray
        Natural logarithm of the probability that a normal deviate about the report lies in the
        cell of the template, which reaches half-way to its neighbours, or in the cell shifted by a
        full turn. Not normalised, since the range of aspects may not reach the report;
        `label_posterior` normalises it for each label.

    Raises
    ------
    ValueError
        If shapes do not match, a value is out of range, or two templates of a label have the same
        aspect.

    See Also
    --------
    label_posterior : Takes this as `log_prior`.
    GaussianTemplates : Likelihood of templates.

    Examples
    --------
    Templates every 10 degrees; a report of 12 with a deviation of 2 degrees leaves the template at
    10, one with 20 degrees leaves all:

    >>> import numpy as np
    >>> from ncti.classify import aspect_prior
    >>> aspect, ship = [0, 10, 20, 30], ["duncan"] * 4
    >>> for sigma in (2.0, 20.0):
    ...     print(np.exp(aspect_prior(aspect, ship, [12.0], sigma=sigma)).round(2))
    [[0.   0.93 0.07 0.  ]]
    [[0.17 0.2  0.18 0.13]]
    """
    from scipy.special import log_ndtr

    angles = require_all("aspect", aspect)
    names = require_labels("labels", labels)
    reported = require_all("tracked", tracked)
    require("sigma", sigma, minimum=0.0, maximum=1e6)
    deviation = max(sigma, MIN_DEVIATION)
    require_shape("labels", names, (names.size,))
    require_shape("aspect", angles, names.shape)
    require_shape("tracked", reported, (reported.size,))
    before, after = np.full((2, len(angles)), CIRCLE)
    for name, rows in rows_by_label(names, angles):
        if len(rows) > 1:
            before[rows], after[rows], _ = steps(angles[rows] % CIRCLE, name)
    offset = (angles - reported[:, None] + CIRCLE / 2) % CIRCLE - CIRCLE / 2
    turns = np.array([0.0, -CIRCLE, CIRCLE])[:, None, None]
    low, high = (offset - before / 2 + turns) / deviation, (offset + after / 2 + turns) / deviation
    # Use the smaller of the two tails, so that nothing cancels far from the report.
    low, high = np.where(low > 0, -high, low), np.where(low > 0, -low, high)
    log_upper, log_lower = log_ndtr(high), log_ndtr(low)
    return np.logaddexp.reduce(log_upper + np.log(-np.expm1(log_lower - log_upper)))

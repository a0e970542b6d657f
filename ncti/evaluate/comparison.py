"""Comparison of two classifiers on the same rows, several of which may share a view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ncti.checks import (
    require,
    require_flags,
    require_generator,
    require_labels,
    require_shape,
)


@dataclass(frozen=True)
class Comparison:
    """Difference of two fractions of right answers, with interval and test.

    Attributes
    ----------
    difference : float
        Second fraction of right answers less the first, from -1 to 1.
    ci_low, ci_high : float
        Ends of its bootstrap interval.
    first_only, second_only : int
        Rows that only the first, or only the second, identifies.
    p_value : float
        Probability of so large a difference between classifiers that are equally good, by
        McNemar's test of views.

    See Also
    --------
    compare : Returns it.

    Examples
    --------
    >>> from ncti.evaluate import Comparison
    >>> Comparison(0.1, 0.02, 0.18, first_only=5, second_only=15, p_value=0.03).difference
    0.1
    """

    difference: float
    ci_low: float
    ci_high: float
    first_only: int
    second_only: int
    p_value: float


def compare(
    first: ArrayLike,
    second: ArrayLike,
    groups: ArrayLike,
    *,
    rng: np.random.Generator,
    confidence: float = 0.95,
    resamples: int = 2000,
) -> Comparison:
    """Return the difference of two fractions of correct answers to the same rows.

    Parameters
    ----------
    first, second : (row,) array_like of bool
        True where the answer of a classifier is right.
    groups : (row,) array_like
        View of each row, whose answers are correlated; of independent rows, their numbers.
    rng : numpy.random.Generator
        Draws the views of the bootstrap.
    confidence : float, default=0.95
        Probability that the interval covers the true difference, in (0, 1).
    resamples : int, default=2000
        Number of draws of the bootstrap.

    Returns
    -------
    Comparison

    Raises
    ------
    ValueError
        If the lengths differ, there are no rows, or a number is out of its range.

    See Also
    --------
    paired_difference : Intervals in closed form for a full grid of views and draws.

    Notes
    -----
    The interval is that of percentiles of the bootstrap, which draws whole views with replacement.
    With d_k the rows of view k that only the second identifies, less those that only the first
    does, McNemar's statistic of clustered pairs [1]_ is

        (sum_k d_k)^2 / sum_k d_k^2,

    chi-squared of one degree of freedom for many views. With one row a view it is McNemar's own.

    References
    ----------
    .. [1] Z. Yang, X. Sun and J. W. Hardin, "A note on the tests for clustered matched-pair binary
       data", Biometrical Journal 52, 638-652 (2010), doi:10.1002/bimj.201000035.

    Examples
    --------
    Of 40 views the second classifier identifies eight more, and none less:

    >>> import numpy as np
    >>> from ncti.evaluate import compare
    >>> view = np.arange(40)
    >>> more = compare(view < 30, view < 38, view, rng=np.random.default_rng(0))
    >>> more.difference, more.second_only, round(more.p_value, 4)
    (0.2, 8, 0.0047)
    >>> 0.05 < more.ci_low < 0.1, 0.3 < more.ci_high < 0.35
    (True, True)
    """
    first_right, second_right = require_flags("first", first), require_flags("second", second)
    view = require_labels("groups", groups)
    if not first_right.size:
        raise ValueError(f"first has shape {first_right.shape}, but must have rows")
    for name, array in (("first", first_right), ("second", second_right), ("groups", view)):
        require_shape(name, array, (first_right.size,))
    require_generator("rng", rng)
    require("confidence", confidence, positive=True, below=1.0)
    require("resamples", resamples, whole=True, minimum=100)
    from scipy.special import chdtrc

    _, view_index = np.unique(view, return_inverse=True)
    gains = np.bincount(view_index, weights=second_right.astype(float) - first_right)
    rows = np.bincount(view_index).astype(float)
    equal = np.ones(len(rows)) / len(rows)
    times = rng.multinomial(len(rows), equal, size=resamples)  # draws of each view
    tails = 0.5 - 0.5 * confidence, 0.5 + 0.5 * confidence
    low, high = np.quantile((times @ gains) / (times @ rows), tails)
    squares = float((gains**2).sum())
    statistic = float(gains.sum()) ** 2 / squares if squares else 0.0
    return Comparison(
        difference=float(gains.sum() / rows.sum()),
        ci_low=float(low),
        ci_high=float(high),
        first_only=int((first_right & ~second_right).sum()),
        second_only=int((second_right & ~first_right).sum()),
        p_value=float(chdtrc(1, statistic)),
    )

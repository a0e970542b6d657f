"""Detection of the ship by a threshold on its pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr, ndtri

from ncti.checks import require


def detection_threshold(*, false_alarm: float, sigma: float) -> float:
    """Temperature that a pixel of sea exceeds with a given probability.

    Parameters
    ----------
    false_alarm : float
        Probability a pixel, above 0 and below 1.
    sigma : float
        Standard deviation of the sea's pixels, noise included [K].

    Returns
    -------
    float
        Threshold against the mean sea [K].

    Raises
    ------
    ValueError
        If the probability is not inside (0, 1) or sigma is not positive and finite.

    Notes
    -----
    sigma Q^-1(false_alarm), Q the Gaussian tail: the sea is Gaussian about 0 (article, Appendix 2).
    """
    require("false_alarm", false_alarm, positive=True)
    if false_alarm >= 1:
        raise ValueError(f"false_alarm is {false_alarm!r}, but must be below 1")
    require("sigma", sigma, positive=True)
    # Q^-1(p) = -ndtri(p): the lower tail keeps the digits that 1 - p would lose.
    return -float(sigma) * float(ndtri(false_alarm))


def detection_probability(
    target: int | NDArray[np.bool_],
    *,
    contrast: float,
    target_sigma: float,
    sea_sigma: float,
    false_alarm: float,
) -> float:
    """Probability that at least one of the ship's pixels exceeds the threshold.

    Parameters
    ----------
    target : int or (row, col) bool ndarray
        Number of the ship's pixels, or its template.
    contrast : float
        Mean temperature of the ship against the mean sea [K].
    target_sigma, sea_sigma : float
        Standard deviations of ship and sea in a pixel, noise included [K].
    false_alarm : float
        Probability that a pixel of sea exceeds the threshold.

    Returns
    -------
    float
        Probability; 0 for a ship without pixels.

    Raises
    ------
    ValueError
        If a parameter is out of range.

    Notes
    -----
    1 - (1 - p)^n with p = Q((t - contrast) / target_sigma) and t of `detection_threshold`: the
    pixels are independent (article, Appendix 2), which holds for images of `thermal_images` but not
    for super-resolved ones, whose neighbours share noise. The logarithm of 1 - p is taken as that
    of the opposite tail, so that neither a p near 1 nor one near 0 loses its digits.
    """
    require("contrast", contrast)
    require("target_sigma", target_sigma, positive=True)
    require("sea_sigma", sea_sigma, positive=True)
    if isinstance(target, np.ndarray) and target.ndim:
        count = int(np.count_nonzero(target))
    else:
        require("target", float(target), minimum=0.0)
        count = int(target)
        if count != target:
            raise ValueError(f"target is {target!r}, but must be a whole number of pixels")
    threshold = detection_threshold(false_alarm=false_alarm, sigma=sea_sigma)
    if count == 0:
        return 0.0
    log_missed = log_ndtr((threshold - contrast) / target_sigma)
    return float(-np.expm1(count * log_missed))

"""Detection of the ship by a threshold on its pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require, require_all


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
    require("false_alarm", false_alarm, positive=True, below=1.0)
    require("sigma", sigma, positive=True)
    # Imported where it is used: scipy takes a tenth of a second.
    from scipy.special import ndtri

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
    target : int or (row, col) bool array_like
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
        If a parameter is out of range, or the target neither a number nor booleans.

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
    count = _pixels(target)
    threshold = detection_threshold(false_alarm=false_alarm, sigma=sea_sigma)
    if count == 0:
        return 0.0
    from scipy.special import log_ndtr

    log_missed = float(log_ndtr((threshold - contrast) / target_sigma))
    return float(-np.expm1(count * log_missed))


def _pixels(target: int | NDArray[np.bool_]) -> int:
    """How many pixels the ship has, given as a number or as a template."""
    if not (isinstance(target, np.ndarray) and target.dtype == bool):
        number = require_all("target", target, whole=True, minimum=0.0)
        if number.ndim == 0:
            return int(number)
        dtype = np.asarray(target).dtype
        if dtype.kind != "b":
            raise ValueError(
                f"target is an array of {dtype}, but must be a number of pixels or an array of bool"
            )
    return int(np.count_nonzero(target))

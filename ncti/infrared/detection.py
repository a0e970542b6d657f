"""Detection of a ship by a threshold on the pixels of its infrared image."""

from __future__ import annotations

import numpy as np

from ncti.checks import require


def detection_threshold(*, false_alarm: float, sigma: float) -> float:
    """Return the temperature that a pixel of sea exceeds with a given probability.

    Parameters
    ----------
    false_alarm : float
        Probability per pixel, above 0 and below 1.
    sigma : float
        Standard deviation of a pixel of sea, noise included [K].

    Returns
    -------
    float
        Threshold above the mean sea [K].

    Raises
    ------
    ValueError
        If the probability is not inside (0, 1) or sigma is not positive and finite.

    See Also
    --------
    detection_probability : Probability that a ship exceeds this threshold.
    pixel_sigma : Standard deviation of a pixel.

    Notes
    -----
    sigma Q^-1(false_alarm), with Q the Gaussian tail: the sea is Gaussian about 0 [1]_.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, Appendix 2.

    Examples
    --------
    One false alarm in 10,000 pixels:

    >>> print(f"{detection_threshold(false_alarm=1e-4, sigma=0.141):.2f} K")
    0.52 K
    """
    require("false_alarm", false_alarm, positive=True, below=1.0)
    require("sigma", sigma, positive=True)
    from scipy.special import ndtri

    # Q^-1(p) = -ndtri(p): the lower tail keeps the digits that 1 - p would lose.
    return -float(sigma) * float(ndtri(false_alarm))


def detection_probability(
    pixels: int,
    *,
    contrast: float,
    target_sigma: float,
    sea_sigma: float,
    false_alarm: float,
) -> float:
    """Return the probability that at least one pixel of the ship exceeds the threshold.

    Parameters
    ----------
    pixels : int
        Number of the ship's pixels.
    contrast : float
        Mean temperature of the ship above the mean sea [K].
    target_sigma, sea_sigma : float
        Standard deviation of a pixel of ship and of sea, noise included [K].
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

    See Also
    --------
    detection_threshold : The threshold.
    thermal_images : Images with independent pixels.

    Notes
    -----
    1 - (1 - p)^n with p = Q((t - contrast) / target_sigma) and t from `detection_threshold`, for
    independent pixels [1]_. That holds for images of `thermal_images` but not for super-resolved
    ones, whose neighbouring pixels share noise. The logarithm of 1 - p is computed from the
    opposite tail, so that no digits are lost for p near 0 or 1.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, Appendix 2.

    Examples
    --------
    Twenty pixels of ship at 100 km, with 16 frames:

    >>> probability = detection_probability(
    ...     20, contrast=0.27, target_sigma=0.141, sea_sigma=0.141, false_alarm=1e-4
    ... )
    >>> print(f"{probability:.2f}")
    0.52
    """
    require("contrast", contrast)
    require("target_sigma", target_sigma, positive=True)
    require("sea_sigma", sea_sigma, positive=True)
    require("pixels", pixels, whole=True, minimum=0)
    threshold = detection_threshold(false_alarm=false_alarm, sigma=sea_sigma)
    if pixels == 0:
        return 0.0
    from scipy.special import log_ndtr

    log_missed = float(log_ndtr((threshold - contrast) / target_sigma))
    return float(-np.expm1(pixels * log_missed))

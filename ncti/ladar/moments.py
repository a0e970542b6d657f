"""Exact mean and covariance of a frame: sums of correlated Rayleigh magnitudes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipe, ellipk

from ncti.checks import require
from ncti.ladar.extent import RangeExtent
from ncti.ladar.pulse import noise_covariance, target_kernel


def magnitude_covariance(field: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance of the magnitudes of a circular complex Gaussian vector.

    Parameters
    ----------
    field : (..., bin, bin) float64 ndarray
        Covariance of each quadrature.

    Returns
    -------
    (..., bin, bin) float64 ndarray
        Cov(|l_n|, |l_m|).

    Notes
    -----
    With sigma_n^2 = field[n, n] and rho = field[n, m] / (sigma_n sigma_m),

        Cov = sigma_n sigma_m [2 E(rho^2) - (1 - rho^2) K(rho^2) - pi/2],

    K and E the complete elliptic integrals of parameter rho^2 (the bivariate Rayleigh moment;
    Middleton, Introduction to Statistical Communication Theory, 1960, section 9.1). The bracket
    cancels as rho vanishes, so below rho^2 = 0.01 its series (pi/2)(m/4 + m^2/64 + m^3/256)
    stands in, good to 1e-9 of itself there.
    """
    sigma = np.sqrt(np.diagonal(field, axis1=-2, axis2=-1))
    scale = sigma[..., :, None] * sigma[..., None, :]
    rho = np.divide(field, scale, out=np.zeros_like(field), where=scale > 0)
    m = np.minimum(rho**2, 1.0)
    series = (math.pi / 2) * m * (1 / 4 + m * (1 / 64 + m / 256))
    with np.errstate(invalid="ignore"):  # 0 * inf at m = 1, where the product tends to 0
        k_term = np.where(m < 1.0, (1 - m) * ellipk(np.minimum(m, 1.0)), 0.0)
    exact = 2 * ellipe(m) - k_term - math.pi / 2
    covariance: NDArray[np.float64] = scale * np.where(m < 0.01, series, exact)
    return covariance


def frame_moments(
    extent: RangeExtent,
    *,
    pulse_width: float,
    cnr: float,
    target_free_ifovs: int = 0,
    frame_count: int = 1,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean and covariance of an average of frames, in closed form.

    Parameters
    ----------
    extent : RangeExtent
        Range-extent fractions of the IFOVs on the target.
    pulse_width : float
        1/e^2 pulse width [s].
    cnr : float
        Carrier-to-noise power ratio of a filled IFOV.
    target_free_ifovs : int
        How many IFOVs without target the frame accumulates besides.
    frame_count : int
        Frames in the average.

    Returns
    -------
    mean : (bin,) float64 ndarray
        In units of Equation C.
    covariance : (bin, bin) float64 ndarray
        Of the average, the same units squared.

    Notes
    -----
    Per quadrature, one IFOV's field has covariance CNR K diag(beta) K' + noise (article,
    Appendix 1, Equations A and B, unit variance in each quadrature). IFOVs and frames are
    independent, so means and covariances add.
    """
    require("cnr", cnr, minimum=0.0)
    require("target_free_ifovs", target_free_ifovs, minimum=0)
    require("frame_count", frame_count, minimum=1)
    bins = extent.down_range.size
    pulse = {"pulse_width": pulse_width, "bin_width": extent.bin_width}
    kernel = target_kernel(**pulse, bin_count=bins)
    noise = noise_covariance(**pulse, bin_count=bins)
    mean = np.zeros(bins)
    covariance = np.zeros((bins, bins))
    fields = [(1, cnr * (kernel * beta) @ kernel.T + noise) for beta in extent.density]
    for weight, field in [*fields, (target_free_ifovs, noise)]:
        mean += weight * np.sqrt(np.diagonal(field) * math.pi / 2)
        covariance += weight * magnitude_covariance(field)
    return mean, covariance / frame_count

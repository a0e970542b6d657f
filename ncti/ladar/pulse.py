"""The transmitted pulse, the matched filter, and what they do to target and noise."""

from __future__ import annotations

import math
import warnings
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require

SPEED_OF_LIGHT = 299_792_458.0  # m/s, exact

# Bins a pulse must span, N_z: samples of a narrower kernel would not add up to its integral (at 2
# they do within 1.5 %, at 1 within 60 %), and the amplitude would depend on the bin.
MIN_BINS = 2.0

SHORTEST, LONGEST = 1e-15, 1.0  # s; beyond them squares of N_z leave float64
MOST_BINS = 2**14  # of a profile: its response to itself, bin by bin, then has 2 GB


def shortest_pulse(bin_width: float) -> float:
    """Shortest pulse [s] that range bins of a width [m] can sample: N_z = 2."""
    return MIN_BINS * math.sqrt(2) * bin_width / SPEED_OF_LIGHT


def target_response(*, pulse_width: float, bin_width: float) -> NDArray[np.float64]:
    """Field response to one scatterer over the range bins around it, as far as it counts.

    Parameters
    ----------
    pulse_width, bin_width
        As in `target_kernel`.

    Returns
    -------
    (bin,) float64 ndarray
        A row of `target_kernel`, of an odd number of bins, down to exp(-16) of its peak.
    """
    n_z = SPEED_OF_LIGHT * pulse_width / (math.sqrt(2) * bin_width)
    reach = math.ceil(2 * n_z)
    response: NDArray[np.float64] = np.exp(-4 * np.arange(-reach, reach + 1) ** 2 / n_z**2)
    return response / math.sqrt(n_z)


def _check(pulse_width: float, bin_width: float, bin_count: int) -> None:
    """Refuse pulses and bins that no arithmetic or memory holds."""
    require("pulse_width", pulse_width, minimum=SHORTEST, maximum=LONGEST)
    require("bin_width", bin_width, positive=True)
    if bin_count > MOST_BINS:
        raise ValueError(
            f"bin_width is {bin_width!r} m, which makes {bin_count} range bins, but must be so "
            f"wide that there are at most {MOST_BINS}"
        )


@lru_cache(maxsize=32)
def target_kernel(*, pulse_width: float, bin_width: float, bin_count: int) -> NDArray[np.float64]:
    """Field response of every range bin to a scatterer in every range bin.

    Parameters
    ----------
    pulse_width : float
        Full width of pulse and filter at 1/e^2 of the intensity [s].
    bin_width : float
        Range bin [m].
    bin_count : int
        Number of bins.

    Returns
    -------
    (bin, bin) float64 ndarray
        Read-only. K[n, k] = exp(-4 (n - k)^2 / N_z^2) / sqrt(N_z).

    Raises
    ------
    ValueError
        If a width is out of range, or there are too many bins.

    Warns
    -----
    UserWarning
        If the pulse is too short for the bins to sample, N_z < 2.

    Notes
    -----
    Article, Appendix 1, Equation B, with N_z = c T / (sqrt(2) dR): pulse and matched filter
    are the same Gaussian, so the filtered pulse is sqrt(2) wider in time.
    """
    _check(pulse_width, bin_width, bin_count)
    if pulse_width < shortest_pulse(bin_width) * (1 - 1e-12):
        warnings.warn(
            f"pulse_width is {pulse_width!r} s, but range bins of {bin_width:g} m sample only "
            f"pulses from {shortest_pulse(bin_width):.3g} s on: the amplitude depends on the bin",
            UserWarning,
            stacklevel=2,
        )
    n_z = SPEED_OF_LIGHT * pulse_width / (math.sqrt(2) * bin_width)
    lag = np.subtract.outer(np.arange(bin_count), np.arange(bin_count))
    kernel = np.exp(-4 * lag**2 / n_z**2) / math.sqrt(n_z)
    kernel.setflags(write=False)  # it is kept for the next caller
    return kernel


def noise_covariance(
    *, pulse_width: float, bin_width: float, bin_count: int
) -> NDArray[np.float64]:
    """Covariance over range bins of one quadrature of the filtered shot noise.

    Parameters
    ----------
    pulse_width, bin_width, bin_count
        As in `target_kernel`.

    Returns
    -------
    (bin, bin) float64 ndarray
        sqrt(pi/8) exp(-2 (n - m)^2 / N_t^2).

    Notes
    -----
    Article, Appendix 1: white noise through the matched filter h, N_t = c T / (2 dR). The
    article sums the noise over samples one bin apart, yet its constant B in Equation C is the
    integral; at 10 ns and 1 m the sum gives 6 % more amplitude and depends on the bin. We take
    the integral here (noise sampled as finely as it takes), so samples agree with the printed
    B, and nothing depends on the bin width.
    """
    by_lag = noise_by_lag(pulse_width=pulse_width, bin_width=bin_width, bin_count=bin_count)
    return by_lag[np.abs(np.subtract.outer(np.arange(bin_count), np.arange(bin_count)))]


def noise_by_lag(*, pulse_width: float, bin_width: float, bin_count: int) -> NDArray[np.float64]:
    """First row of `noise_covariance`: what two bins share that are so many bins apart.

    Parameters
    ----------
    pulse_width, bin_width, bin_count
        As in `target_kernel`.

    Returns
    -------
    (bin,) float64 ndarray
        sqrt(pi/8) exp(-2 l^2 / N_t^2).
    """
    _check(pulse_width, bin_width, bin_count)
    n_t = SPEED_OF_LIGHT * pulse_width / (2 * bin_width)
    return math.sqrt(math.pi / 8) * np.exp(-2 * np.arange(bin_count) ** 2 / n_t**2)


def noise_floor() -> float:
    """Expected detector output of one target-free IFOV, sqrt(B) with B = sqrt(pi^3 / 32).

    Article, Appendix 1, Equation C; the unit of every amplitude in this package.
    """
    return (math.pi**3 / 32) ** 0.25


@lru_cache(maxsize=32)
def noise_factor(
    *, pulse_width: float, bin_width: float, bin_count: int, tolerance: float = 1e-6
) -> NDArray[np.float32]:
    """Low-rank factor F with F.T @ F equal to the noise covariance.

    Parameters
    ----------
    pulse_width, bin_width, bin_count
        As in `target_kernel`.
    tolerance : float
        Largest eigenvalue that may be dropped, relative to the largest one.

    Returns
    -------
    (rank, bin) float32 ndarray
        Read-only. z @ F of standard normals z has the noise covariance.

    Notes
    -----
    The matched filter is a band limit, so the noise of 250 bins of 1 m has far fewer degrees
    of freedom than bins: about 500 sqrt(2 ln(1/tolerance)) / (pi N_t).
    """
    covariance = noise_covariance(pulse_width=pulse_width, bin_width=bin_width, bin_count=bin_count)
    return low_rank_factor(covariance, tolerance=tolerance)


def low_rank_factor(covariance: NDArray[np.float64], *, tolerance: float) -> NDArray[np.float32]:
    """Factor F of a covariance, F.T @ F, without its negligible eigenvalues.

    Parameters
    ----------
    covariance : (bin, bin) float64 ndarray
        Symmetric, positive semi-definite up to rounding.
    tolerance : float
        Eigenvalues up to this, relative to the largest, are dropped.

    Returns
    -------
    (rank, bin) float32 ndarray
        Read-only.
    """
    values, vectors = np.linalg.eigh(covariance)
    kept = values > tolerance * values[-1]
    factor = (vectors[:, kept] * np.sqrt(values[kept])).T.astype(np.float32)
    factor.setflags(write=False)
    return factor

"""Pulse and matched filter: their response to the target, and the filtered shot noise."""

from __future__ import annotations

import math
import warnings
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require

SPEED_OF_LIGHT = 299_792_458.0  # m/s, exact

# Smallest N_z, the bins that a pulse must span. The samples of a narrower kernel do not add up to
# its integral (within 1.5 % at 2, 60 % at 1), and the amplitude would depend on the bin width.
MIN_BINS = 2.0

SHORTEST, LONGEST = 1e-15, 1.0  # s; outside these limits the square of N_z leaves float64
UNDECOMPOSED = 0.1  # share of the tolerance of eigenvalues that their decomposition may leave out
MOST_BINS = 2**14  # bins of a profile; its (bin, bin) kernel then takes 2 GB


def shortest_pulse(bin_width: float) -> float:
    """Return the shortest pulse [s] that range bins of width `bin_width` [m] sample, N_z = 2.

    See Also
    --------
    target_kernel : Response that must be sampled.

    Examples
    --------
    Bins of 1 m sample pulses of 9.4 ns and longer:

    >>> from ncti.ladar.pulse import shortest_pulse
    >>> print(f"{1e9 * shortest_pulse(1.0):.1f} ns")
    9.4 ns
    """
    return MIN_BINS * math.sqrt(2) * bin_width / SPEED_OF_LIGHT


def target_response(*, pulse_width: float, bin_width: float) -> NDArray[np.float64]:
    """Return the field response to one scatterer over the range bins around it.

    Parameters
    ----------
    pulse_width, bin_width
        See `target_kernel`.

    Returns
    -------
    (bin,) float64 ndarray
        The part of a row of `target_kernel` above exp(-16) of its peak; an odd number of bins,
        the scatterer in the middle one.
    """
    n_z = SPEED_OF_LIGHT * pulse_width / (math.sqrt(2) * bin_width)
    reach = math.ceil(2 * n_z)
    response: NDArray[np.float64] = np.exp(-4 * np.arange(-reach, reach + 1) ** 2 / n_z**2)
    return response / math.sqrt(n_z)


def _check(pulse_width: float, bin_width: float, bin_count: int) -> None:
    """Raise `ValueError` for pulses and bins beyond the limits of float64 or memory."""
    require("pulse_width", pulse_width, minimum=SHORTEST, maximum=LONGEST)
    require("bin_width", bin_width, positive=True)
    if bin_count > MOST_BINS:
        raise ValueError(
            f"bin_width is {bin_width!r} m, which makes {bin_count} range bins, but must be so "
            f"wide that there are at most {MOST_BINS}"
        )


@lru_cache(maxsize=32)
def target_kernel(*, pulse_width: float, bin_width: float, bin_count: int) -> NDArray[np.float64]:
    """Return the field response in every range bin to a scatterer in every range bin.

    Parameters
    ----------
    pulse_width : float
        Full width of pulse and filter at 1/e^2 of the intensity [s].
    bin_width : float
        Width of a range bin [m].
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

    See Also
    --------
    noise_covariance : Covariance of the noise behind the same filter.

    Notes
    -----
    Equation B of [1]_, with N_z = c T / (sqrt(2) dR): pulse and matched filter are the same
    Gaussian, so the filtered pulse is sqrt(2) wider in time.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, Appendix 1, Equation B.

    Examples
    --------
    A pulse of 30 ns spreads over N_z = 6.4 bins of 1 m. The power response to one scatterer sums
    to sqrt(pi/8), however wide the pulse:

    >>> from ncti.ladar.pulse import target_kernel
    >>> kernel = target_kernel(pulse_width=30e-9, bin_width=1.0, bin_count=101)
    >>> print(f"{(kernel[50] ** 2).sum():.4f}")
    0.6267
    >>> kernel = target_kernel(pulse_width=60e-9, bin_width=1.0, bin_count=101)
    >>> print(f"{(kernel[50] ** 2).sum():.4f}")
    0.6267
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
    kernel = _by_bins(np.exp(-4 * np.arange(bin_count) ** 2 / n_z**2) / math.sqrt(n_z))
    kernel.setflags(write=False)  # the cache returns the same array to every caller
    return kernel


def noise_covariance(
    *, pulse_width: float, bin_width: float, bin_count: int
) -> NDArray[np.float64]:
    """Return the covariance between range bins of one quadrature of the filtered shot noise.

    Parameters
    ----------
    pulse_width, bin_width, bin_count
        See `target_kernel`.

    Returns
    -------
    (bin, bin) float64 ndarray
        sqrt(pi/8) exp(-2 (n - m)^2 / N_t^2).

    See Also
    --------
    target_kernel : Response of the same filter to the target.

    Notes
    -----
    White noise through the matched filter h of [1]_, N_t = c T / (2 dR). The article sums the noise
    over samples one bin apart, yet its constant B in Equation C is the integral; at 10 ns and 1 m
    the sum gives 6 % more amplitude, and it depends on the bin width. We use the integral, so that
    samples agree with the printed B and nothing depends on the bin width.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, Appendix 1.

    Examples
    --------
    The variance is sqrt(pi/8) in every bin, and the correlation falls to 1/e over N_t / sqrt(2)
    bins, 3.2 m at 30 ns:

    >>> from ncti.ladar.pulse import noise_covariance
    >>> noise_covariance(pulse_width=30e-9, bin_width=1.0, bin_count=4)[0].round(3)
    array([0.627, 0.568, 0.422, 0.257])
    """
    by_lag = noise_by_lag(pulse_width=pulse_width, bin_width=bin_width, bin_count=bin_count)
    return _by_bins(by_lag)


def _by_bins(by_lag: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (bin, bin) matrix of values that depend on the distance of two bins alone."""
    bins = np.arange(by_lag.size)
    return by_lag[np.abs(np.subtract.outer(bins, bins))]


def noise_by_lag(*, pulse_width: float, bin_width: float, bin_count: int) -> NDArray[np.float64]:
    """Return the first row of `noise_covariance`: covariance of two bins by their distance.

    Parameters
    ----------
    pulse_width, bin_width, bin_count
        See `target_kernel`.

    Returns
    -------
    (bin,) float64 ndarray
        sqrt(pi/8) exp(-2 l^2 / N_t^2).
    """
    _check(pulse_width, bin_width, bin_count)
    n_t = SPEED_OF_LIGHT * pulse_width / (2 * bin_width)
    return math.sqrt(math.pi / 8) * np.exp(-2 * np.arange(bin_count) ** 2 / n_t**2)


def noise_floor() -> float:
    """Return the expected detector output of one target-free IFOV.

    Returns
    -------
    float
        sqrt(B) with B = sqrt(pi^3 / 32), in the units of every amplitude of this package.

    See Also
    --------
    expected_profile : Profile that includes the floor of every IFOV.

    Notes
    -----
    The term of Equation C of [1]_ that remains without a target.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, Appendix 1, Equation C.

    Examples
    --------
    It is the mean of a Rayleigh distribution, sigma sqrt(pi/2), whose variance in each quadrature
    is that of the filtered noise, sqrt(pi/8):

    >>> import math
    >>> from ncti.ladar import noise_floor
    >>> print(f"{noise_floor():.4f}")
    0.9921
    >>> print(f"{math.sqrt(math.pi / 2) * math.sqrt(math.sqrt(math.pi / 8)):.4f}")
    0.9921
    """
    return (math.pi**3 / 32) ** 0.25


def mirrored_factors(
    by_lag: NDArray[np.float64], *, tolerance: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the rows of a factor of a stationary covariance that are even, and odd, by halves.

    Parameters
    ----------
    by_lag : (bin,) float64 ndarray
        Covariance of two bins by their distance, as of `noise_by_lag`.
    tolerance : float
        See `low_rank_factor`.

    Returns
    -------
    even, odd : (rank, half) float32 ndarray
        Rows in the lower half of the window, a middle bin included, which is 0 in odd ones. Rows
        F of the whole window, each with its mirror image or the negative of it, have the
        covariance F.T @ F.

    Notes
    -----
    Such a covariance is symmetric about the middle of the window, too, so that its eigenvectors
    are even or odd about it. The matched filter limits the band: the noise of 250 bins of 1 m has
    far fewer degrees of freedom than bins, about 500 sqrt(2 ln(1/tolerance)) / (pi N_t).
    """
    bins = by_lag.size
    half = np.arange((bins + 1) // 2)
    direct = _by_bins(by_lag[: half.size])
    across = by_lag[bins - 1 - np.add.outer(half, half)]
    return (
        low_rank_factor((direct + across) / 2, tolerance=tolerance),
        low_rank_factor((direct - across) / 2, tolerance=tolerance),
    )


def low_rank_factor(covariance: NDArray[np.float64], *, tolerance: float) -> NDArray[np.float32]:
    """Return a factor F of a covariance, F.T @ F, without its negligible eigenvalues.

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

    Notes
    -----
    A Cholesky decomposition with pivots, L L.T, stops at a rank near that of F; the eigenvectors of
    the small matrix L.T L then rotate L to F. For a rank r of n bins it takes some n r^2 steps,
    where the eigenvectors of the whole matrix take 10 n^3. An eigenvector's sign is arbitrary, and
    LAPACK's hangs on rounding; here its sum over bins, weighted by 1 / (bin + 1), is positive, so
    that the same random numbers make the same noise when a pulse width changes by rounding.
    """
    # Imported here because scipy takes a tenth of a second.
    from scipy.linalg.lapack import dpstrf

    # What the decomposition leaves out is at most n times the pivot at which it stops; the largest
    # eigenvalue is at least the mean of row sums and any variance.
    count = len(covariance)
    largest = max(covariance.sum() / count, np.diagonal(covariance).max())
    least = UNDECOMPOSED * tolerance * largest / count
    packed, order, rank, _ = dpstrf(covariance, tol=least, lower=1)
    root = np.empty((count, rank))
    root[order - 1] = np.tril(packed[:, :rank])
    values, vectors = np.linalg.eigh(root.T @ root)
    kept = values > tolerance * values.max(initial=0.0)
    modes = root @ vectors[:, kept]
    modes *= np.where((1 / np.arange(1.0, count + 1)) @ modes < 0, -1, 1)
    factor = np.ascontiguousarray(modes.T, dtype=np.float32)
    factor.setflags(write=False)
    return factor

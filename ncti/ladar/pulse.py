"""Pulse and matched filter: their response to the target, and the filtered shot noise."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require

SPEED_OF_LIGHT = 299_792_458.0  # m/s, exact

# Smallest N_z, the bins that a pulse must span. The samples of a narrower kernel do not add up to
# its integral (within 1.5 % at 2, 60 % at 1), and the amplitude would depend on the bin width.
MIN_BINS = 2.0

# Outside these limits [s] the square of N_z leaves float64.
MIN_PULSE_WIDTH, MAX_PULSE_WIDTH = 1e-15, 1.0
REMAINDER = 0.1  # share of the eigenvalue tolerance that the truncated Cholesky may discard
MAX_KERNEL_BINS = 2**14  # bins of a profile; its (bin, bin) kernel then takes 2 GB


def shortest_pulse(bin_width: float) -> float:
    """Return the shortest pulse [s] that range bins of width `bin_width` [m] sample, N_z = 2."""
    return MIN_BINS * math.sqrt(2) * bin_width / SPEED_OF_LIGHT


@dataclass(frozen=True)
class Pulse:
    """Pulse and matched filter, the same Gaussian, and the range bins that sample them.

    `width` is the full width at 1/e^2 of the intensity [s], `bin_width` that of a range bin [m].
    """

    width: float
    bin_width: float

    @property
    def n_z(self) -> float:
        """N_z = c T / (sqrt(2) dR), the width of the filtered pulse [bins]."""
        return SPEED_OF_LIGHT * self.width / (math.sqrt(2) * self.bin_width)

    @property
    def n_t(self) -> float:
        """N_t = c T / (2 dR), the width of the matched filter [bins]."""
        return SPEED_OF_LIGHT * self.width / (2 * self.bin_width)

    def check(self, bin_count: int) -> None:
        """Raise `ValueError` if the kernel of so many bins exceeds float64 or memory."""
        require("pulse_width", self.width, minimum=MIN_PULSE_WIDTH, maximum=MAX_PULSE_WIDTH)
        require("bin_width", self.bin_width, positive=True)
        if bin_count > MAX_KERNEL_BINS:
            raise ValueError(
                f"bin_width is {self.bin_width!r} m, which makes {bin_count} range bins, but must "
                f"be so wide that there are at most {MAX_KERNEL_BINS}"
            )


def target_response(pulse: Pulse) -> NDArray[np.float64]:
    """Return the field response to one scatterer over the (bin,) range bins around it.

    This is a row of `target_kernel`, cut at exp(-16) of its peak, which is in the middle bin.
    """
    reach = math.ceil(2 * pulse.n_z)
    response: NDArray[np.float64] = np.exp(-4 * np.arange(-reach, reach + 1) ** 2 / pulse.n_z**2)
    return response / math.sqrt(pulse.n_z)


@lru_cache(maxsize=32)
def target_kernel(pulse: Pulse, bin_count: int) -> NDArray[np.float64]:
    """Return the field response (bin, bin) of every range bin to a scatterer in every range bin.

    K[n, k] = exp(-4 (n - k)^2 / N_z^2) / sqrt(N_z), Equation B of the article's Appendix 1. The
    filtered pulse is sqrt(2) wider than the pulse; its power sums to sqrt(pi/8). Read-only. Warns
    of pulses too short for the bins to sample, N_z < 2.
    """
    pulse.check(bin_count)
    shortest = shortest_pulse(pulse.bin_width)
    if pulse.width < shortest * (1 - 1e-12):
        warnings.warn(
            f"pulse_width is {pulse.width!r} s, but range bins of {pulse.bin_width:g} m sample "
            f"only pulses from {shortest:.3g} s on: the amplitude depends on the bin",
            UserWarning,
            stacklevel=2,
        )
    by_lag = np.exp(-4 * np.arange(bin_count) ** 2 / pulse.n_z**2) / math.sqrt(pulse.n_z)
    kernel = _lag_matrix(by_lag)
    kernel.setflags(write=False)  # the cache returns the same array to every caller
    return kernel


def noise_covariance(pulse: Pulse, bin_count: int) -> NDArray[np.float64]:
    """Return the (bin, bin) covariance of one quadrature of the filtered shot noise.

    White noise through the matched filter of the article's Appendix 1 has the covariance

        sqrt(pi/8) exp(-2 (n - m)^2 / N_t^2),     N_t = c T / (2 dR).

    The article sums the noise over samples one bin apart, yet its constant B in Equation C is the
    integral; at 10 ns and 1 m the sum gives 6 % more amplitude, and it depends on the bin width. We
    use the integral, so that samples agree with the printed B at any bin width.
    """
    return _lag_matrix(noise_by_lag(pulse, bin_count))


def _lag_matrix(by_lag: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (bin, bin) matrix of values that depend only on the distance of two bins."""
    bins = np.arange(by_lag.size)
    return by_lag[np.abs(np.subtract.outer(bins, bins))]


def noise_by_lag(pulse: Pulse, bin_count: int) -> NDArray[np.float64]:
    """Return the (bin,) first row of `noise_covariance`, sqrt(pi/8) exp(-2 l^2 / N_t^2)."""
    pulse.check(bin_count)
    return math.sqrt(math.pi / 8) * np.exp(-2 * np.arange(bin_count) ** 2 / pulse.n_t**2)


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
    """Return the even and odd rows of a factor F of a stationary covariance F' F, by halves.

    `by_lag` (bin,) is the covariance by lag, from `noise_by_lag`. Both results have rows
    (rank, half) over the lower half of the window, including any middle bin, which is 0 in odd
    rows; the upper half mirrors them, negated if odd. A stationary covariance is symmetric about
    the middle of the window, so its eigenvectors are even or odd. The matched filter limits the
    band: the noise of 250 bins of 1 m has some 500 sqrt(2 ln(1/tolerance)) / (pi N_t) degrees of
    freedom, far fewer than bins.
    """
    bins = by_lag.size
    half = np.arange((bins + 1) // 2)
    direct = _lag_matrix(by_lag[: half.size])
    across = by_lag[bins - 1 - np.add.outer(half, half)]
    return (
        low_rank_factor((direct + across) / 2, tolerance=tolerance),
        low_rank_factor((direct - across) / 2, tolerance=tolerance),
    )


def low_rank_factor(covariance: NDArray[np.float64], *, tolerance: float) -> NDArray[np.float32]:
    """Return a (rank, bin) factor F of a (bin, bin) covariance F' F without negligible eigenvalues.

    Drop eigenvalues up to `tolerance` times the largest. A pivoted Cholesky decomposition L L'
    stops at a rank near the rank of F, and the eigenvectors of the small matrix L' L rotate L to F:
    n r^2 steps for rank r of n bins instead of 10 n^3. LAPACK leaves the sign of an eigenvector
    arbitrary; here its sum over bins, weighted by 1 / (bin + 1), is made positive, so that the same
    random numbers give the same noise when a pulse width changes by rounding. Read-only.
    """
    from scipy.linalg.lapack import dpstrf

    # The remainder of the decomposition is at most n times the pivot at which it stops; the largest
    # eigenvalue is at least the mean of row sums and any variance.
    count = len(covariance)
    largest = max(covariance.sum() / count, np.diagonal(covariance).max())
    cutoff = REMAINDER * tolerance * largest / count
    packed, order, rank, _ = dpstrf(covariance, tol=cutoff, lower=1)
    root = np.empty((count, rank))
    root[order - 1] = np.tril(packed[:, :rank])
    values, vectors = np.linalg.eigh(root.T @ root)
    significant = values > tolerance * values.max(initial=0.0)
    modes = root @ vectors[:, significant]
    modes *= np.where((1 / np.arange(1.0, count + 1)) @ modes < 0, -1, 1)
    factor = np.ascontiguousarray(modes.T, dtype=np.float32)
    factor.setflags(write=False)
    return factor

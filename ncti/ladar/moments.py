"""Exact mean and covariance of a frame: sums of correlated Rayleigh magnitudes."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require
from ncti.ladar.expected import STRONGEST
from ncti.ladar.extent import REFERENCE_BIN, RangeExtent
from ncti.ladar.pulse import SPEED_OF_LIGHT, noise_by_lag, target_kernel

# Share of the variance of one target-free IFOV: field powers and covariances below it are not
# worth computing. A view of 30 IFOVs then errs by some 1e-12 of its variance.
NEGLIGIBLE = 1e-12
PLACES_AT_ONCE = 500_000  # pairs of bins that are looked through at once, in some megabytes

Floats = NDArray[np.float64]


def magnitude_covariance(field: Floats) -> Floats:
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
    stands in, good to 6.2e-9 of itself there.
    """
    sigma = np.sqrt(np.diagonal(field, axis1=-2, axis2=-1))
    scale = sigma[..., :, None] * sigma[..., None, :]
    rho = np.divide(field, scale, out=np.zeros_like(field), where=scale > 0)
    return scale * _bracket(np.minimum(rho**2, 1.0))


def frame_moments(
    extent: RangeExtent,
    *,
    pulse_width: float,
    cnr: float,
    target_free_ifovs: int = 0,
    frame_count: int = 1,
) -> tuple[Floats, Floats]:
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

    Raises
    ------
    ValueError
        If a parameter is out of range.

    Notes
    -----
    That of `banded_frame_moments`, with its mirror image and zeros beyond its lags.
    """
    mean, band = banded_frame_moments(
        extent,
        pulse_width=pulse_width,
        cnr=cnr,
        target_free_ifovs=target_free_ifovs,
        frame_count=frame_count,
    )
    bins = mean.size
    covariance = np.zeros((bins, bins))
    for lag, diagonal in enumerate(band):
        n = np.arange(bins - lag)
        covariance[n, n + lag] = covariance[n + lag, n] = diagonal[: bins - lag]
    return mean, covariance


def banded_frame_moments(
    extent: RangeExtent,
    *,
    pulse_width: float,
    cnr: float,
    target_free_ifovs: int = 0,
    frame_count: int = 1,
) -> tuple[Floats, Floats]:
    """Mean and covariance of an average of frames, the covariance as a band of lags.

    Parameters
    ----------
    extent, pulse_width, cnr, target_free_ifovs, frame_count
        As for `frame_moments`.

    Returns
    -------
    mean : (bin,) float64 ndarray
        In units of Equation C.
    covariance : (lag, bin) float64 ndarray
        Element [l, n] is the covariance of bins n and n + l, the same units squared: the lower
        band that `scipy.linalg.cholesky_banded` takes. Zero where n + l is no bin. The number of
        lags depends on pulse, bins and CNR alone.

    Raises
    ------
    ValueError
        If a parameter is out of range.

    Notes
    -----
    Per quadrature, one IFOV's field has covariance CNR K diag(beta) K' + noise (article,
    Appendix 1, Equations A and B, unit variance in each quadrature). IFOVs and frames are
    independent, so means and covariances add. The kernel is Gaussian, so that the target's
    part at bins n and n + l is

        exp(-2 l^2 / N_z^2) T(n + l/2),   T(c) = CNR sum_k beta(k) exp(-8 (c - k)^2 / N_z^2) / N_z,

    one product with T's kernel at half bins. Left out is what cannot be seen: lags whose
    correlation is so small that the covariance stays below NEGLIGIBLE of the variance of one
    target-free IFOV, and bins that one IFOV's target reaches with less than NEGLIGIBLE of its
    noise, where the covariance is the noise's own.
    """
    require("cnr", cnr, minimum=0.0, maximum=STRONGEST)
    require("target_free_ifovs", target_free_ifovs, minimum=0, whole=True)
    require("frame_count", frame_count, minimum=1, whole=True)
    bins = extent.down_range.size
    pulse = {"pulse_width": pulse_width, "bin_width": extent.bin_width}
    noise = noise_by_lag(**pulse, bin_count=bins)
    # T, from bin 0 in steps of half a bin
    power = cnr * extent.density @ _half_bin_kernel(**pulse, bin_count=bins)
    variance = power[:, ::2] + noise[0]
    live = power[:, ::2] > NEGLIGIBLE * noise[0]
    n_z = SPEED_OF_LIGHT * pulse_width / (math.sqrt(2) * extent.bin_width)
    everywhere = len(power) + target_free_ifovs

    sigma = np.sqrt(variance)
    mean = sigma.sum(axis=0) + target_free_ifovs * math.sqrt(noise[0])
    filled = cnr * REFERENCE_BIN / extent.bin_width / n_z  # most that T can be
    lags = _reach(filled / noise[0], n_z=n_z, bin_count=bins)
    covariance = np.zeros((lags, bins))
    covariance[0] = (2 - math.pi / 2) * (variance.sum(axis=0) + target_free_ifovs * noise[0])
    floor = noise[0] * _bracket(np.square(noise[:lags] / noise[0]))  # of one target-free IFOV
    decay = np.array([math.exp(-2 * apart**2 / n_z**2) for apart in range(lags)])
    at_once = max(1, PLACES_AT_ONCE // max(1, live.size))
    for first in range(1, lags, at_once):
        last = min(first + at_once, lags)
        lag, ifov, n = _reached(live, first, last)
        here = ifov * bins + n
        scale = sigma.take(here) * sigma.take(here + lag)
        field = decay.take(lag) * power.take(2 * here - ifov + lag) + noise.take(lag)
        excess = scale * _bracket(np.square(field / scale)) - floor.take(lag)
        place = (lag - first) * bins + n
        band = np.bincount(place, weights=excess, minlength=(last - first) * bins)
        covariance[first:last] = band.reshape(-1, bins) + everywhere * floor[first:last, None]
    for apart in range(1, lags):
        covariance[apart, bins - apart :] = 0.0
    return mean * math.sqrt(math.pi / 2), covariance / frame_count


def _reached(
    live: NDArray[np.bool_], first: int, last: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Lag, IFOV and bin n of pairs of bins n and n + lag one of which a target reaches.

    For lags from `first` to before `last`, in the order of these three.
    """
    ifovs, bins = live.shape
    either = np.zeros((last - first, ifovs, bins), dtype=bool)
    for apart, pairs in enumerate(either, start=first):
        np.logical_or(live[:, :-apart], live[:, apart:], out=pairs[:, :-apart])
    pair, n = np.divmod(np.flatnonzero(either), bins)
    lag, ifov = np.divmod(pair, ifovs)
    return lag + first, ifov, n


def _bracket(m: Floats) -> Floats:
    """2 E(m) - (1 - m) K(m) - pi/2, m in [0, 1]: see `magnitude_covariance`."""
    # Imported where it is used: scipy takes a tenth of a second.
    from scipy.special import ellipe, ellipk

    m = np.minimum(m, 1.0)
    bracket: Floats = (math.pi / 2) * m * (1 / 4 + m * (1 / 64 + m / 256))
    large = m >= 0.01
    m = m[large]
    with np.errstate(invalid="ignore"):  # 0 * inf at m = 1, where the product tends to 0
        k_term = np.where(m < 1.0, (1 - m) * ellipk(m), 0.0)
    bracket[large] = 2 * ellipe(m) - k_term - math.pi / 2
    return bracket


def _reach(peak: float, *, n_z: float, bin_count: int) -> int:
    """Number of lags, zero included, at which a frame is correlated.

    The bracket is at most (2 - pi/2) m, so the covariance of two bins is at most (2 - pi/2) times
    the square of their field's over the noise's variance v, and that field at most
    (peak + 1) v exp(-2 l^2 / N_z^2), the noise's correlation being narrower. The peak is that of
    an IFOV filled in one bin, so that all views have the same lags.
    """
    farthest = n_z * math.sqrt(math.log((peak + 1) / math.sqrt(NEGLIGIBLE)) / 2)
    return min(bin_count, math.floor(farthest) + 1)


@lru_cache(maxsize=8)
def _half_bin_kernel(*, pulse_width: float, bin_width: float, bin_count: int) -> Floats:
    """(bin, 2 bin - 1) float64 ndarray: power response in half bins to a scatterer in each bin."""
    target_kernel(pulse_width=pulse_width, bin_width=bin_width, bin_count=bin_count)  # its checks
    n_z = SPEED_OF_LIGHT * pulse_width / (math.sqrt(2) * bin_width)
    lag = np.subtract.outer(np.arange(bin_count), np.arange(2 * bin_count - 1) / 2)
    kernel = np.exp(-8 * lag**2 / n_z**2) / n_z
    kernel[kernel < 1e-300] = 0.0  # what is near underflow takes a hundred times as long
    kernel.setflags(write=False)  # it is kept for the next caller
    return kernel

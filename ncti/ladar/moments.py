"""Exact mean and covariance of frames, which are sums of correlated Rayleigh magnitudes."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require
from ncti.ladar.expected import MAX_CNR
from ncti.ladar.extent import REFERENCE_BIN, RangeExtent
from ncti.ladar.pulse import Pulse, noise_by_lag, noise_floor, target_kernel

# Share of the variance of one target-free IFOV below which field powers and covariances are
# neglected. The error for a view of 30 IFOVs is then some 1e-12 of its variance.
NEGLIGIBLE = 1e-12
PAIRS_PER_BLOCK = 500_000  # pairs of bins, which bounds memory to some megabytes

Floats = NDArray[np.float64]


def magnitude_covariance(field: Floats) -> Floats:
    """Return the (..., bin, bin) covariance of magnitudes of a circular complex Gaussian vector.

    `field` (..., bin, bin) is the covariance of each quadrature. With sigma_n^2 = field[n, n] and
    rho = field[n, m] / (sigma_n sigma_m), the bivariate Rayleigh moment (Middleton, An Introduction
    to Statistical Communication Theory, 1960, section 9.1) gives

        Cov = sigma_n sigma_m [2 E(rho^2) - (1 - rho^2) K(rho^2) - pi/2],

    K and E the complete elliptic integrals of parameter rho^2. The bracket cancels as rho vanishes,
    so below m = rho^2 = 0.01 its series (pi/2)(m/4 + m^2/64 + m^3/256) replaces it, to 6.2e-9.
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
    """Return the mean and covariance of an average of frames, in closed form.

    Parameters
    ----------
    extent : RangeExtent
        Range-extent fractions of the IFOVs on the target.
    pulse_width : float
        1/e^2 pulse width [s].
    cnr : float
        Carrier-to-noise ratio of a filled IFOV, as a power ratio, not in decibels;
        ``power_ratio(32)`` is that of 32 dB.
    target_free_ifovs : int
        Number of IFOVs without target that are added to each frame.
    frame_count : int
        Number of frames in the average.

    Returns
    -------
    mean : (bin,) float64 ndarray
        The profile of `expected_profile`.
    covariance : (bin, bin) float64 ndarray
        Covariance of the average, in the same units squared.

    Raises
    ------
    ValueError
        If a parameter is out of range.

    See Also
    --------
    banded_frame_moments : The same covariance as a band, in less memory; explains the equations.
    sample_frames : Random frames with these moments.

    Examples
    --------
    A plate that fills four IFOVs: its peak fluctuates by half the contrast of speckle,
    sqrt(4/pi - 1) / 2 = 0.26, from frame to frame, and by a quarter of that in an average of 16:

    >>> import numpy as np
    >>> import trimesh
    >>> from ncti.ladar import frame_moments, range_extent
    >>> from ncti.render import line_image
    >>> plate = trimesh.creation.box(extents=(4.0, 30.0, 30.0))
    >>> lines = line_image(plate, aspect=0, depression=0, spacing=0.5)
    >>> extent = range_extent(lines, slant_range=100e3)
    >>> for frame_count in (1, 16):
    ...     mean, covariance = frame_moments(
    ...         extent, pulse_width=30e-9, cnr=10**3.2, frame_count=frame_count
    ...     )
    ...     peak = mean.argmax()
    ...     print(f"{covariance[peak, peak] ** 0.5 / mean[peak]:.3f}")
    0.261
    0.065
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
    """Return the mean and covariance of an average of frames, the covariance as a band of lags.

    Parameters
    ----------
    extent, pulse_width, cnr, target_free_ifovs, frame_count
        See `frame_moments`.

    Returns
    -------
    mean : (bin,) float64 ndarray
        The profile of `expected_profile`.
    covariance : (lag, bin) float64 ndarray
        Element [l, n] is the covariance of bins n and n + l, in the same units squared: the lower
        band that `scipy.linalg.cholesky_banded` takes. Zero if n + l is beyond the last bin. The
        number of lags depends on pulse, bins and CNR alone.

    Raises
    ------
    ValueError
        If a parameter is out of range.

    See Also
    --------
    frame_moments : The same covariance as a full matrix.
    ncti.classify.GaussianTemplates : Classifier that takes these moments.

    Notes
    -----
    In each quadrature the field of one IFOV has covariance CNR K diag(beta) K' + noise
    (Equations A and B of [1]_, unit variance in each quadrature). IFOVs and frames are
    independent, so means and covariances add. The kernel is Gaussian, so the part of the target
    in bins n and n + l is

        exp(-2 l^2 / N_z^2) T(n + l/2),   T(c) = CNR sum_k beta(k) exp(-8 (c - k)^2 / N_z^2) / N_z,

    one product with the kernel of T at half bins. Lags with a covariance below NEGLIGIBLE times the
    variance of one target-free IFOV are dropped. Where the target adds less than NEGLIGIBLE of an
    IFOV's noise, the covariance is the noise covariance.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, Appendix 1, Equations A and B.

    Examples
    --------
    The matched filter correlates the 250 bins of a 30 ns profile over some 20 lags only:

    >>> import trimesh
    >>> from ncti.ladar import banded_frame_moments, range_extent
    >>> from ncti.render import line_image
    >>> plate = trimesh.creation.box(extents=(4.0, 30.0, 30.0))
    >>> lines = line_image(plate, aspect=0, depression=0, spacing=0.5)
    >>> extent = range_extent(lines, slant_range=100e3)
    >>> mean, band = banded_frame_moments(extent, pulse_width=30e-9, cnr=10**3.2)
    >>> band.shape
    (21, 250)
    >>> print(f"{band[0, mean.argmax()] ** 0.5 / mean.max():.3f}")
    0.261
    """
    require("cnr", cnr, minimum=0.0, maximum=MAX_CNR)
    require("target_free_ifovs", target_free_ifovs, minimum=0, whole=True)
    require("frame_count", frame_count, minimum=1, whole=True)
    bins = extent.down_range.size
    pulse = Pulse(pulse_width, extent.bin_width)
    noise = noise_by_lag(pulse, bins)
    # T in steps of half a bin from bin 0, variance of each bin, and bins where the target counts.
    power = cnr * extent.density @ _half_bin_kernel(pulse, bins)
    variance = power[:, ::2] + noise[0]
    live = power[:, ::2] > NEGLIGIBLE * noise[0]
    n_z = pulse.n_z
    ifov_count = len(power) + target_free_ifovs

    # Means and variances, which need no elliptic integral.
    sigma = np.sqrt(variance)
    mean = sigma.sum(axis=0) + target_free_ifovs * math.sqrt(noise[0])
    filled = cnr * REFERENCE_BIN / extent.bin_width / n_z  # upper bound of T
    lags = _correlation_reach(filled / noise[0], n_z=n_z, bin_count=bins)
    covariance = np.zeros((lags, bins))
    covariance[0] = (2 - math.pi / 2) * (variance.sum(axis=0) + target_free_ifovs * noise[0])
    floor = floor_by_lag(noise[:lags])  # of one target-free IFOV
    decay = np.array([math.exp(-2 * shift**2 / n_z**2) for shift in range(lags)])

    # Every lag: the floor's covariance times the number of IFOVs, plus the excess of the pairs of
    # bins that a target reaches, in blocks of lags to bound the memory.
    lags_per_block = max(1, PAIRS_PER_BLOCK // max(1, live.size))
    for first in range(1, lags, lags_per_block):
        last = min(first + lags_per_block, lags)
        lag, ifov, n = _target_pairs(live, first, last)
        index = ifov * bins + n
        scale = sigma.take(index) * sigma.take(index + lag)
        field = decay.take(lag) * power.take(2 * index - ifov + lag) + noise.take(lag)
        excess = scale * _bracket(np.square(field / scale)) - floor.take(lag)
        flat_index = (lag - first) * bins + n
        band = np.bincount(flat_index, weights=excess, minlength=(last - first) * bins)
        covariance[first:last] = band.reshape(-1, bins) + ifov_count * floor[first:last, None]
    for shift in range(1, lags):
        covariance[shift, bins - shift :] = 0.0
    return mean * math.sqrt(math.pi / 2), covariance / frame_count


def frame_variance(
    extent: RangeExtent, *, pulse_width: float, cnr: float, target_free_ifovs: int = 0
) -> Floats:
    """Return the (bin,) variance of one frame, the zero lag of `banded_frame_moments`.

    IFOVs are independent, and the variance of a Rayleigh magnitude is 4 / pi - 1 times its mean
    squared.
    """
    kernel = target_kernel(Pulse(pulse_width, extent.bin_width), extent.down_range.size)
    power = cnr * extent.density.sum(axis=0) @ (kernel**2).T
    # Squared means of the target add up, like variances.
    squares = (math.pi / 2) * power + (len(extent.density) + target_free_ifovs) * noise_floor() ** 2
    return (4 / math.pi - 1) * squares


def floor_by_lag(noise: Floats) -> Floats:
    """Return the covariance of one target-free IFOV's output by lag, from `noise_by_lag`."""
    return noise[0] * _bracket(np.square(noise / noise[0]))


def floor_reach(pulse: Pulse) -> int:
    """Return the lag from which on `floor_by_lag` is below NEGLIGIBLE times its variance."""
    return math.ceil(pulse.n_t * math.sqrt(-math.log(NEGLIGIBLE)) / 2)


def _target_pairs(
    live: NDArray[np.bool_], first: int, last: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return lag, IFOV and bin n of all pairs of bins n, n + lag with a target in either.

    Lags are from `first` to below `last`; pairs are sorted by lag, IFOV and bin.
    """
    ifovs, bins = live.shape
    either = np.zeros((last - first, ifovs, bins), dtype=bool)
    for shift, pairs in enumerate(either, start=first):
        np.logical_or(live[:, :-shift], live[:, shift:], out=pairs[:, :-shift])
    pair, n = np.divmod(np.flatnonzero(either), bins)
    lag, ifov = np.divmod(pair, ifovs)
    return lag + first, ifov, n


def _bracket(m: Floats) -> Floats:
    """Return 2 E(m) - (1 - m) K(m) - pi/2 for m in [0, 1]; see `magnitude_covariance`."""
    from scipy.special import ellipe, ellipk

    m = np.minimum(m, 1.0)
    bracket: Floats = (math.pi / 2) * m * (1 / 4 + m * (1 / 64 + m / 256))
    is_large = m >= 0.01
    m = m[is_large]
    with np.errstate(invalid="ignore"):  # 0 * inf at m = 1, where the product tends to 0
        k_term = np.where(m < 1.0, (1 - m) * ellipk(m), 0.0)
    bracket[is_large] = 2 * ellipe(m) - k_term - math.pi / 2
    return bracket


def _correlation_reach(peak: float, *, n_z: float, bin_count: int) -> int:
    """Return the number of lags, zero included, over which a frame is correlated.

    The bracket is at most (2 - pi/2) m, so the covariance of two bins is at most (2 - pi/2) f^2/v,
    f the covariance of their fields and v the variance of the noise. Noise correlates over fewer
    lags than the target, so f is at most (peak + 1) v exp(-2 l^2 / N_z^2). A common peak, of an
    IFOV filled in one bin, gives all views the same lags.
    """
    farthest = n_z * math.sqrt(math.log((peak + 1) / math.sqrt(NEGLIGIBLE)) / 2)
    return min(bin_count, math.floor(farthest) + 1)


@lru_cache(maxsize=8)
def _half_bin_kernel(pulse: Pulse, bin_count: int) -> Floats:
    """Return the (bin, 2 bin - 1) power response at half bins to a scatterer in each bin."""
    # Called for its checks alone.
    target_kernel(pulse, bin_count)
    lag = np.subtract.outer(np.arange(bin_count), np.arange(2 * bin_count - 1) / 2)
    kernel = np.exp(-8 * lag**2 / pulse.n_z**2) / pulse.n_z
    kernel[kernel < 1e-300] = 0.0  # arithmetic near underflow is a hundred times slower
    kernel.setflags(write=False)  # the cache returns the same array to every caller
    return kernel

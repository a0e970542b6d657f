"""Banded covariances of neighbouring bins: construction, factors, whitening and densities."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import LinAlgError, cholesky_banded

from ncti.checks import require_all, require_labels, require_shape

Floats = NDArray[np.float64]


def checked_moments(
    mean: ArrayLike, covariance: ArrayLike, labels: ArrayLike, floor: ArrayLike
) -> tuple[Floats, Floats, NDArray[Any], Floats]:
    """Return (template, place, bin) means, bands, labels, and the means less the floor.

    Arguments are as of `ncti.classify.GaussianTemplates.fit`. Raises `ValueError` if shapes do not
    match.
    """
    means = require_all("mean", mean)
    bands = require_all("covariance", covariance)
    if means.ndim not in (2, 3) or not means.size:
        raise ValueError(
            f"mean has shape {means.shape}, but must be (template, bin) or (template, place, bin)"
        )
    count, bins = means.shape[0], means.shape[-1]
    lags = bands.shape[1] if bands.ndim == 3 else 0
    if bands.shape != (count, lags, bins) or not 1 <= lags <= bins:
        raise ValueError(
            f"covariance has shape {bands.shape}, but must be ({count}, lag, {bins}) with 1 "
            f"to {bins} lags"
        )
    names = require_labels("labels", labels)
    require_shape("labels", names, (count,))
    floors = require_all("floor", floor)
    require_shape("floor", floors, (), (bins,), (*means.shape[:-1], 1), means.shape)
    shape = count, -1, bins
    return means.reshape(shape), bands, names, (means - floors).reshape(shape)


def checked_averages(X: ArrayLike, frame_count: ArrayLike, bins: int) -> tuple[Floats, Floats]:
    """Return (sample, bin) averages and the (sample,) numbers of frames, or raise `ValueError`."""
    samples = require_all("X", X)
    if samples.ndim != 2 or samples.shape[1] != bins or not samples.size:
        raise ValueError(
            f"X has shape {samples.shape}, but must be (sample, {bins}) with at least one sample"
        )
    frames = require_all("frame_count", frame_count, minimum=1)
    require_shape("frame_count", frames, (), (len(samples),))
    return samples, np.broadcast_to(frames, len(samples))


def cholesky_factors(bands: Floats, diagonal_loading: float) -> Floats:
    """Return the lower Cholesky factors of (template, lag, bin) bands that include the loading.

    Raises `ValueError` if a band is not positive definite; a larger diagonal loading helps.
    """
    factors = np.empty_like(bands)
    for t, band in enumerate(bands):
        try:
            factors[t] = cholesky_banded(band, lower=True)
        except LinAlgError:
            raise ValueError(
                f"diagonal_loading is {diagonal_loading!r}, but must be larger for "
                f"covariance[{t}], which is not positive definite with it"
            ) from None
    return factors


def residual_band(residual: Floats, correlation: Floats) -> Floats:
    """Return the covariance (lag, bin), a lower band, of a residual with the noise's correlation.

    `residual` (bin,) is the standard deviation in each bin, `correlation` (lag,) positive definite.
    The band is positive semidefinite, as the elementwise product of a positive definite Toeplitz
    matrix and an outer product.
    """
    bins = len(residual)
    band = np.zeros((len(correlation), bins))
    for lag, share in enumerate(correlation):
        band[lag, : bins - lag] = share * residual[: bins - lag] * residual[lag:]
    return band


def mean_correlation(bands: Floats) -> Floats:
    """Return the correlation between bins by lag (lag,), averaged over templates and bins.

    `bands` (template, lag, bin) are positive definite covariances, and so is the mean: sums along
    the diagonals of such a matrix have a nonnegative spectrum.
    """
    along: Floats = bands.sum(axis=(0, 2))
    return along / along[0]


def whiten(factor: Floats, columns: Floats) -> Floats:
    """Return L^-1 times (bin, column) columns, with L a lower band."""
    from ncti.classify.whitening import solve_band

    return solve_band(np.ascontiguousarray(factor), np.ascontiguousarray(columns.T)).T


def colour(factor: Floats, white: Floats) -> Floats:
    """Return L times a (bin,) vector, with L a lower band."""
    product = np.zeros_like(white)
    for lag, band in enumerate(factor):
        product[lag:] += band[: len(white) - lag] * white[: len(white) - lag]
    return product


def densities(
    factor: Floats,
    unit: Floats,
    samples: Floats,
    mean: Floats,
    frames: Floats,
    priors: ArrayLike,
    *,
    places: int = 1,
) -> Floats:
    """Return (prior, sample) log densities of averages of frames under one template.

    `factor` (lag, bin) is the lower Cholesky factor L of the covariance of one frame; `unit` (bin,
    column) has, whitened by L, the steps from the mean at the first place to each other place, the
    signal at each place, and the unknown directions that all places share, at a unit of their
    prior; `samples` (sample, bin) are averages of `frames` (sample,); `mean` (bin,) is the mean at
    the first place; `priors` (prior, scaled) are deviations of the signal and the first shared
    directions, while the others keep their scale; the `places`, over which densities are averaged,
    are equally probable.

    With U the directions times their deviations, the covariance of n frames is L (I + n U U') L' /
    n. By the Woodbury identity and the matrix determinant lemma only the small matrix I + n U'U has
    to be inverted, once per number of frames. Averages are whitened once for all places: their
    products with the steps give the products at any other place.
    """
    from ncti.classify.whitening import band_products

    squared, along = band_products(*map(np.ascontiguousarray, (factor, samples, mean, unit)))
    gram, deviations = unit.T @ unit, np.asarray(priors)
    n = frames if np.ptp(frames) else frames[:1]
    size = 2 * np.log(factor[0]).sum() + len(mean) * np.log(2 * math.pi / n)
    shared = np.arange(2 * places - 1, len(gram))
    density: Floats = np.empty((places, len(deviations), len(samples)))
    for p in range(places):
        directions, step = np.append(places - 1 + p, shared), p - 1
        # Squared distance from the mean at this place, and its components along unknown directions.
        distance, overlapping = squared, along[:, directions]
        if p:
            distance = squared - 2 * along[:, step] + gram[step, step]
            overlapping = overlapping - gram[step, directions]
        for k, prior in enumerate(deviations):
            scale = np.append(prior, np.ones(len(directions) - len(prior)))
            inner = gram[np.ix_(directions, directions)] * np.outer(scale, scale)
            inner = np.eye(len(directions)) + n[:, None, None] * inner
            overlap = n[:, None] * (overlapping * scale)
            explained = np.einsum("sd,sde,se->s", overlap, np.linalg.inv(inner), overlap)
            density[p, k] = (
                -(n * distance - explained + size + np.linalg.slogdet(inner).logabsdet) / 2
            )
    return density[0] if places == 1 else np.logaddexp.reduce(density) - math.log(places)

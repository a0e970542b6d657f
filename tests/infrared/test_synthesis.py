"""Thermal images: both Gaussians, the frames, and the deviation of a pixel."""

import numpy as np
import pytest
from scipy import stats

from ncti.infrared import pixel_sigma, thermal_images

LEVEL = 1e-3  # of each statistical test, over all that it compares (Bonferroni)
HALF = np.zeros((200, 200), bool)  # half ship, half sea: 20,000 pixels of each
HALF[:, :100] = True


def draw(seed=1, *, target=HALF, contrast=0.7, frame_counts=(16,), **parameters):
    return thermal_images(
        target,
        contrast=contrast,
        frame_counts=frame_counts,
        rng=np.random.default_rng(seed),
        **parameters,
    )


def z_of_variance(sample, variance):
    """Of a normal sample with known mean 0: the chi-squared sum as a normal."""
    return (np.mean(sample**2) / variance - 1) / np.sqrt(2 / sample.size)


@pytest.mark.parametrize("frame_count", [1, 4, 16, 32])
def test_both_gaussians(frame_count):
    """KS over 20,000 pixels at 1e-3, and z-tests of mean and variance, of ship and of sea."""
    (thermal,) = draw(
        frame_count, frame_counts=(frame_count,), nedt=0.4, target_spread=0.15, sea_spread=0.05
    )
    for pixels, mean, spread in ((thermal[HALF], 0.7, 0.15), (thermal[~HALF], 0.0, 0.05)):
        sigma = np.hypot(spread, 0.4 / np.sqrt(frame_count))
        for way in ("none", "perfect"):
            deviation = pixel_sigma(spread, frame_count=(frame_count,), super_resolution=way)
            assert deviation == pytest.approx([sigma], rel=1e-14)
        assert stats.kstest(pixels, stats.norm(mean, sigma).cdf).pvalue > LEVEL / 2
        z_mean = (pixels.mean() - mean) / (sigma / np.sqrt(pixels.size))
        z = np.abs([z_mean, z_of_variance(pixels - mean, sigma**2)])
        assert z.max() < stats.norm.isf(LEVEL / 2 / 4)


COUNTS = (1, 4, 5, 16)


def test_moments_of_prefix_averages():
    """Mean and covariance between frame counts, z-tests over 40,000 pixels at 1e-3.

    Cov(average of M, average of N) = spread^2 + nedt^2 / max(M, N).
    """
    averages = draw(8, frame_counts=COUNTS, nedt=0.4, target_spread=0.1, sea_spread=0.1)
    deviation = (averages - np.where(HALF, 0.7, 0.0)).reshape(len(COUNTS), -1)
    count = deviation.shape[1]
    expected = 0.1**2 + 0.4**2 / np.maximum.outer(COUNTS, COUNTS)
    z_mean = deviation.mean(axis=1) / np.sqrt(np.diagonal(expected) / count)
    # Wick: Var(x y) = Cov^2 + Var x Var y.
    error = np.sqrt((expected**2 + np.outer(*[np.diagonal(expected)] * 2)) / count)
    z_covariance = (deviation @ deviation.T / count - expected) / error
    z = np.concatenate([z_mean, z_covariance[np.triu_indices(len(COUNTS))]])
    assert np.abs(z).max() < stats.norm.isf(LEVEL / 2 / z.size)

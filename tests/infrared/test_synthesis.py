"""Pixels of thermal images are Gaussian on ship and sea, with the stated deviation."""

import numpy as np
import pytest
from scipy import stats

from ncti.infrared import pixel_sigma, thermal_images

LEVEL = 1e-3  # of each statistical test, over all that it compares (Bonferroni)
HALF = np.zeros((200, 200), bool)  # half ship, half sea: 20,000 pixels of each
HALF[:, :100] = True


@pytest.mark.parametrize("frame_count", [1, 4, 16, 32])
def test_ship_and_sea_pixels_are_gaussian(frame_count):
    """KS test of 20,000 pixels at 1e-3, and z-tests of mean and variance, on ship and sea."""
    (thermal,) = thermal_images(
        HALF,
        contrast=0.7,
        frame_counts=(frame_count,),
        rng=np.random.default_rng(frame_count),
        nedt=0.4,
        target_spread=0.15,
        sea_spread=0.05,
    )
    for pixels, mean, spread in ((thermal[HALF], 0.7, 0.15), (thermal[~HALF], 0.0, 0.05)):
        sigma = np.hypot(spread, 0.4 / np.sqrt(frame_count))
        for way in ("none", "perfect"):
            deviation = pixel_sigma(spread, frame_count=(frame_count,), super_resolution=way)
            assert deviation == pytest.approx([sigma], rel=1e-14)
        assert stats.kstest(pixels, stats.norm(mean, sigma).cdf).pvalue > LEVEL / 2
        z_mean = (pixels.mean() - mean) / (sigma / np.sqrt(pixels.size))
        z_variance = (np.mean((pixels - mean) ** 2) / sigma**2 - 1) / np.sqrt(2 / pixels.size)
        assert max(abs(z_mean), abs(z_variance)) < stats.norm.isf(LEVEL / 2 / 4)

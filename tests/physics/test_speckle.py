"""Speckle and shot noise have the statistics of any coherent receiver."""

import math

import numpy as np
import pytest
from scipy import stats

from ncti.ladar import RangeExtent, noise_floor, sample_frames
from ncti.ladar.frames import _floor_filter
from ncti.ladar.moments import magnitude_covariance
from ncti.ladar.pulse import (
    Pulse,
    mirrored_factors,
    noise_by_lag,
    noise_covariance,
)

FRAMES = 20_000
LEVEL = 1e-3
FACE = 32  # the bin that holds the target


def filled_ifov(count: int = 1) -> RangeExtent:
    """Return IFOVs filled by a face square to the line of sight."""
    fraction = np.zeros((count, 64))
    fraction[:, FACE] = 1.0
    cell = np.stack([np.arange(count), np.zeros(count, int)], axis=1)
    return RangeExtent(fraction, np.arange(64) - 31.5, 1.0, cell, 150e-6, 1e5)


def draw(count: int = 1, *, cnr: float = 1e3, frames: int = FRAMES, seed: int = 1) -> np.ndarray:
    return sample_frames(
        filled_ifov(count),
        pulse_width=30e-9,
        cnr=cnr,
        frame_count=frames,
        rng=np.random.default_rng(seed),
    )


@pytest.mark.parametrize("bin_index", [FACE, FACE + 3, 2])
def test_amplitude_of_one_ifov_is_rayleigh(bin_index):
    """20,000 frames pass a Kolmogorov-Smirnov test at 1e-3 on target, flank and noise."""
    amplitude = draw()[:, bin_index]
    # Its mean is Equation C: sigma sqrt(pi / 2).
    n_z = 299_792_458.0 * 30e-9 / math.sqrt(2)
    a = (math.pi / 2) * 1e3 * math.exp(-8 * (bin_index - FACE) ** 2 / n_z**2) / n_z
    sigma = math.sqrt((a + noise_floor() ** 2) * 2 / math.pi)
    assert stats.kstest(amplitude, stats.rayleigh(scale=sigma).cdf).pvalue > LEVEL


def test_averaging_reduces_the_variance_as_one_over_n():
    average = 32
    amplitude = draw(frames=1000 * average, seed=average)[:, FACE]
    single = amplitude.var()
    averaged = amplitude.reshape(-1, average).mean(axis=1).var()
    # A variance of 1,000 near-normal averages errs by sqrt(2/1000) of itself.
    z = (averaged * average / single - 1) / math.sqrt(2 / 1000)
    assert abs(z) < stats.norm.isf(LEVEL / 2)


def test_magnitude_covariance_at_zero_and_full_correlation():
    field = np.array([[2.0, 0.0, 2.0], [0.0, 3.0, 0.0], [2.0, 0.0, 2.0]])
    covariance = magnitude_covariance(field)
    rayleigh = 2 - math.pi / 2
    np.testing.assert_allclose(np.diagonal(covariance), rayleigh * np.diagonal(field))
    assert covariance[0, 1] == 0
    assert covariance[0, 2] == pytest.approx(2 * rayleigh)


@pytest.mark.parametrize("nanoseconds", [10, 20, 30, 40, 50, 90, 300])
@pytest.mark.parametrize("bins", [7, 250, 251])
def test_noise_is_stable_to_pulse_width_rounding(nanoseconds, bins):
    """The sign of eigenvectors is arbitrary and therefore fixed by a rule.

    Rounding of 2e-16 rotates modes by this over the least distance of two eigenvalues, a share of
    some 2 (2 pi / bins)^2: 2e-13 of the amplitude, below the rounding to float32.
    """
    rounded = [30e-9 * (nanoseconds / 30), nanoseconds * 1e-9]
    rounded += [np.nextafter(rounded[1], 0), np.nextafter(rounded[1], 1)]
    first, *others = (
        mirrored_factors(noise_by_lag(Pulse(width, 1.0), bins), tolerance=1e-6) for width in rounded
    )
    for other in others:
        for half, ours in zip(first, other, strict=True):
            np.testing.assert_allclose(ours, half, rtol=0, atol=1e-6)


@pytest.mark.parametrize("pulse_width", [1e-9, 10e-9, 30e-9, 300e-9])
@pytest.mark.parametrize("bins", [1, 7, 250])
def test_floor_filter_matches_target_free_ifov_covariance(pulse_width, bins):
    """White noise is correlated by the transform of the squared transfer function.

    The filter is rounded to float32; the magnitudes' covariance has a relative error of 6e-9.
    """
    pulse = Pulse(pulse_width, 1.0)
    wanted = magnitude_covariance(noise_covariance(pulse, bins))
    found = np.fft.irfft(_floor_filter(pulse, bins).astype(float) ** 2)[:bins]
    lag = np.abs(np.subtract.outer(np.arange(bins), np.arange(bins)))
    np.testing.assert_allclose(found[lag], wanted, rtol=0, atol=4e-7 * wanted[0, 0])

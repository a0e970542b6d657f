"""The banded covariance of a frame agrees with the full matrices of Equations A and B."""

import numpy as np
import pytest
from plates import plane
from scipy import special

from ncti.ladar import (
    RangeExtent,
    banded_frame_moments,
    expected_profile,
    frame_moments,
    range_extent,
)
from ncti.ladar.moments import NEGLIGIBLE, frame_variance, magnitude_covariance
from ncti.ladar.pulse import Pulse, noise_covariance, target_kernel

CNR = 10**3.2
PULSES = [10e-9, 30e-9, 50e-9]


def view(name: str, bin_width: float = 1.0) -> RangeExtent:
    """Return a hard case by name: a slope, an edge of the window, nothing, or two spikes."""
    bins = round(120 / bin_width)
    fraction = np.zeros((3, bins))
    if name == "slope":
        return range_extent(
            plane(width=38, height=14, slope=(1.7, 0.4), offset=3.0),
            slant_range=1e5,
            bin_width=bin_width,
            window=120.0,
        )
    if name == "edge":
        fraction[:, 0], fraction[0, -1] = 0.9, 1.0
    if name == "spikes":
        fraction[0, bins // 2], fraction[0, bins // 2 + 14], fraction[1, 40] = 0.5, 1e-4, 1e-9
    centres = (np.arange(bins) + 0.5) * bin_width - 60
    return RangeExtent(fraction, centres, bin_width, np.zeros((3, 2), int), 150e-6, 1e5)


def plain_moments(extent, *, pulse_width, cnr, target_free_ifovs=0):
    """Return the moments with a full matrix per IFOV, without dropping bins or lags."""
    pulse, bins = Pulse(pulse_width, extent.bin_width), extent.down_range.size
    kernel, noise = target_kernel(pulse, bins), noise_covariance(pulse, bins)
    fields = [cnr * (kernel * beta) @ kernel.T + noise for beta in extent.density]
    weights = [1] * len(fields) + [target_free_ifovs]
    fields.append(noise)
    mean = sum(
        w * np.sqrt(np.diagonal(f) * np.pi / 2) for w, f in zip(weights, fields, strict=True)
    )
    return mean, sum(w * magnitude_covariance(f) for w, f in zip(weights, fields, strict=True))


@pytest.mark.parametrize("target_free_ifovs", [0, 4000])
@pytest.mark.parametrize("cnr", [0.0, CNR, 1e7])
@pytest.mark.parametrize("pulse_width", PULSES)
@pytest.mark.parametrize("name", ["slope", "edge", "empty", "spikes"])
def test_banded_moments_match_the_full_matrices(name, pulse_width, cnr, target_free_ifovs):
    """The mean agrees with Equation C to rounding; the variance with the covariance's diagonal.

    The covariance is within NEGLIGIBLE of the noise per IFOV, and rounding. Sums of up to 4,000
    terms in another order, and the kernel's product over the window, round by some hundred units
    in the last place of the largest variance.
    """
    extent = view(name)
    parameters = {"pulse_width": pulse_width, "cnr": cnr, "target_free_ifovs": target_free_ifovs}
    mean, covariance = frame_moments(extent, **parameters)
    plain_mean, plain = plain_moments(extent, **parameters)
    np.testing.assert_allclose(mean, plain_mean, rtol=1e-13)
    np.testing.assert_allclose(expected_profile(extent, **parameters), plain_mean, rtol=1e-13)
    variance = frame_variance(extent, **parameters)
    np.testing.assert_allclose(variance, np.diagonal(covariance), rtol=1e-13)
    noise = (2 - np.pi / 2) * np.sqrt(np.pi / 8)
    ifovs = len(extent.cell) + target_free_ifovs
    tolerance = ifovs * NEGLIGIBLE * noise + 200 * np.finfo(float).eps * plain.max()
    assert np.abs(covariance - plain).max() < tolerance


@pytest.mark.parametrize("bin_width", [0.5, 1.0])
def test_banded_covariance_scales_with_frame_count(bin_width):
    extent = view("slope", bin_width)
    parameters = {"pulse_width": 30e-9, "cnr": CNR}
    mean, band = banded_frame_moments(extent, frame_count=16, **parameters)
    plain_mean, plain = plain_moments(extent, **parameters)
    np.testing.assert_allclose(mean, plain_mean, rtol=1e-13)
    for lag, diagonal in enumerate(band):
        n = np.arange(mean.size - lag)
        np.testing.assert_allclose(16 * diagonal[n], plain[n, n + lag], rtol=0, atol=1e-11)
        assert not diagonal[mean.size - lag :].any()


@pytest.mark.parametrize("correlation", [1e-6, 1e-3, 0.03, 0.0999, 0.1001, 0.3, 0.7, 0.95])
def test_magnitude_covariance_matches_its_power_series(correlation):
    """It is (pi/2) sum over k of (binomial(1/2, k) rho^k)^2, on both sides of rho^2 = 0.01.

    Below it three terms replace the series, off by 4 (5/128)^2 m^3 = 6.1e-9 of the first at most.
    Above it differences of numbers of order 1 lose some units in the last place.
    """
    terms = special.binom(0.5, np.arange(1, 2000)) ** 2 * correlation ** np.arange(2, 4000, 2)
    series = np.pi / 2 * terms.sum()
    covariance = magnitude_covariance(np.array([[1.0, correlation], [correlation, 1.0]]))[0, 1]
    short = 4 * (5 / 128) ** 2 * correlation**6 if correlation**2 < 0.01 else 0.0
    rounding = 20 * np.finfo(float).eps / min(series, 1.0) if correlation**2 >= 0.01 else 1e-14
    assert covariance == pytest.approx(series, rel=1.1 * short + rounding)

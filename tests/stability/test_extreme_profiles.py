"""Extents and profiles are exact for extreme pulses, bins, ratios and counts."""

import math
from itertools import product

import numpy as np
import pytest
from hard_meshes import ENGINES, area, box, see

from ncti import ladar
from ncti.features import profile_vector

pytestmark = pytest.mark.filterwarnings("ignore:pulse_width is:UserWarning")

EPS = np.finfo(np.float64).eps
LIGHT = 299_792_458.0
PULSES = (0.1e-9, 1e-9, 30e-9, 1e-6, 10e-6)  # [s]
BINS = (1e-3, 1.0, 100.0)  # [m]
RATIOS = tuple(10 ** (db / 10) for db in (-60, 0, 32, 120))
COUNTS = (0, 100, 10**7)


def filled(bin_width, bins=32, share=1.0):
    """Return an extent of one IFOV, with all of its area in the middle bin."""
    fraction = np.zeros((1, bins))
    fraction[0, bins // 2] = share
    centres = bin_width * (np.arange(bins) + 0.5 - bins / 2)
    return ladar.RangeExtent(
        fraction, centres, bin_width, np.zeros((1, 2), dtype=np.int64), 1e-4, 1e5
    )


@pytest.mark.parametrize("engine", ENGINES)
def test_area_is_conserved_in_any_bin_at_any_range(engine):
    """Images drop areas below 1e-8 of a pixel as rounding; lines conserve the sum."""
    image = see(engine, box(), aspect=37.0, depression=3.84)
    for slant_range, bin_width in product((100.0, 4e3, 100e3, 1e6), (1e-3, 0.1, 1.0, 100.0)):
        ifov = max(150e-6, 50.0 / slant_range)  # a few IFOVs, for the bins are many
        extent = ladar.range_extent(
            image, slant_range=slant_range, ifov=ifov, bin_width=bin_width, window=300.0
        )
        dropped = 0.0 if engine == "lines" else 1e-8 * 0.5**2 * extent.fraction.size
        found = extent.fraction.sum() * (ifov * slant_range) ** 2
        assert found == pytest.approx(area(image), rel=1e-9, abs=dropped)
        assert extent.fraction.min() >= 0.0
        assert extent.fraction.sum(axis=1).max() <= 1.0 + 0.5 / (ifov * slant_range) * 4


@pytest.mark.parametrize("bin_width", BINS)
def test_profile_of_a_filled_bin_matches_equation_c(bin_width):
    """A filled bin has Equation C, sqrt(pi/2 CNR beta / N_z + B); Rayleigh variance is 2 - pi/2."""
    extent = filled(bin_width)
    for pulse, cnr, count in product(PULSES, RATIOS, COUNTS):
        signal = {"pulse_width": pulse, "cnr": cnr, "target_free_ifovs": count}
        n_z = LIGHT * pulse / (math.sqrt(2) * bin_width)
        variance = cnr / bin_width / n_z + math.sqrt(math.pi / 8)
        expected = math.sqrt(math.pi / 2 * variance) + count * ladar.noise_floor()
        profile = ladar.expected_profile(extent, **signal)
        mean, band = ladar.banded_frame_moments(extent, **signal)
        assert profile[16] == pytest.approx(expected, rel=32 * EPS)
        np.testing.assert_allclose(mean, profile, rtol=32 * EPS)
        assert profile.min() >= (count + 1) * ladar.noise_floor() * (1 - 8 * EPS)
        spread = (2 - math.pi / 2) * (variance + count * math.sqrt(math.pi / 8))
        assert band[0, 16] == pytest.approx(spread, rel=32 * EPS)
        assert np.isfinite(band).all()


@pytest.mark.parametrize("engine", ENGINES)
def test_more_bins_than_memory_holds_are_refused(engine):
    image = see(engine, box(), aspect=37.0, depression=3.84)
    with pytest.raises(ValueError, match=r"^bin_width is 1e-05 m, but must be .* at least 5.96"):
        ladar.range_extent(image, slant_range=1e5, bin_width=1e-5)
    fine = ladar.range_extent(image, slant_range=1e5, bin_width=1e-3)
    with pytest.raises(ValueError, match=r"^bin_width is 0.001 m, which makes 250000 range bins"):
        ladar.expected_profile(fine, pulse_width=30e-9, cnr=1.0)


@pytest.mark.parametrize("engine", ENGINES)
def test_ship_below_resolution_gives_a_zero_profile(engine):
    image = see(engine, box(1e-6), aspect=37.0, depression=3.84)
    extent = ladar.range_extent(image, slant_range=1e5)
    assert extent.fraction.shape == (0, 250)
    assert math.isnan(extent.error)
    signal = {"pulse_width": 30e-9, "cnr": 1e3}
    assert not ladar.expected_profile(extent, **signal).any()
    frames = ladar.sample_frames(extent, frame_count=3, rng=np.random.default_rng(0), **signal)
    assert not profile_vector(frames).any()

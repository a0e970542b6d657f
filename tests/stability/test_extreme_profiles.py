"""Pulses, bins, ratios and counts at their ends, from the extent to the vector."""

import math
from itertools import product

import numpy as np
import pytest
from hard_meshes import ENGINES, area, box, see
from hypothesis import given, settings
from hypothesis import strategies as st

from ncti.classify import GaussianTemplates
from ncti.features import profile_vector
from ncti.ladar import (
    RangeExtent,
    banded_frame_moments,
    carrier_to_noise,
    cumulative_average,
    expected_profile,
    frame_moments,
    lines_within,
    noise_floor,
    range_extent,
    sample_frames,
)

pytestmark = pytest.mark.filterwarnings("ignore:pulse_width is:UserWarning")

EPS = np.finfo(np.float64).eps
LIGHT = 299_792_458.0
PULSES = (0.1e-9, 1e-9, 30e-9, 1e-6, 10e-6)  # [s]
BINS = (1e-3, 1.0, 100.0)  # [m]
RATIOS = tuple(10 ** (db / 10) for db in (-60, 0, 32, 120))
COUNTS = (0, 100, 10**7)


def filled(bin_width, bins=32, share=1.0):
    """One IFOV that the target fills, all of it in the middle bin."""
    fraction = np.zeros((1, bins))
    fraction[0, bins // 2] = share
    centres = bin_width * (np.arange(bins) + 0.5 - bins / 2)
    return RangeExtent(fraction, centres, bin_width, np.zeros((1, 2), dtype=np.int64), 1e-4, 1e5)


@pytest.mark.parametrize("engine", ENGINES)
def test_area_is_conserved_in_any_bin_at_any_range(engine):
    """Bins of an image drop what is below 1e-8 of a pixel, as rounding; lines add up."""
    image = see(engine, box(), aspect=37.0, depression=3.84)
    for slant_range, bin_width in product((100.0, 4e3, 100e3, 1e6), (1e-3, 0.1, 1.0, 100.0)):
        ifov = max(150e-6, 50.0 / slant_range)  # a few IFOVs, for the bins are many
        extent = range_extent(
            image, slant_range=slant_range, ifov=ifov, bin_width=bin_width, window=300.0
        )
        dropped = 0.0 if engine == "lines" else 1e-8 * 0.5**2 * extent.fraction.size
        found = extent.fraction.sum() * (ifov * slant_range) ** 2
        assert found == pytest.approx(area(image), rel=1e-9, abs=dropped)
        assert extent.fraction.min() >= 0.0
        assert extent.fraction.sum(axis=1).max() <= 1.0 + 0.5 / (ifov * slant_range) * 4


@pytest.mark.parametrize("bin_width", BINS)
def test_the_expected_profile_of_one_bin(bin_width):
    """Equation C of a filled bin, sqrt(pi/2 CNR beta / N_z + B); Rayleigh variance 2 - pi/2."""
    extent = filled(bin_width)
    for pulse, cnr, count in product(PULSES, RATIOS, COUNTS):
        signal = {"pulse_width": pulse, "cnr": cnr, "target_free_ifovs": count}
        n_z = LIGHT * pulse / (math.sqrt(2) * bin_width)
        variance = cnr / bin_width / n_z + math.sqrt(math.pi / 8)
        expected = math.sqrt(math.pi / 2 * variance) + count * noise_floor()
        profile = expected_profile(extent, **signal)
        mean, band = banded_frame_moments(extent, **signal)
        assert profile[16] == pytest.approx(expected, rel=32 * EPS)
        np.testing.assert_allclose(mean, profile, rtol=32 * EPS)
        assert profile.min() >= (count + 1) * noise_floor() * (1 - 8 * EPS)
        spread = (2 - math.pi / 2) * (variance + count * math.sqrt(math.pi / 8))
        assert band[0, 16] == pytest.approx(spread, rel=32 * EPS)
        assert np.isfinite(band).all()


@pytest.mark.parametrize("bin_width", BINS)
def test_frames_have_their_mean_and_variance(bin_width):
    """At a level of 1e-7 for each of 120 tests, 256 frames each.

    The mean of a sum of magnitudes is normal within its skewness, 0.63 / sqrt(256). Variance
    varies by sqrt((kurtosis - 1) / 256), the kurtosis of a Rayleigh magnitude being 3.245, with a
    tail heavier than the normal one: to 6.5 of those.
    """
    extent = filled(bin_width)
    for number, (pulse, cnr, count) in enumerate(product(PULSES, RATIOS, COUNTS)):
        signal = {"pulse_width": pulse, "cnr": cnr, "target_free_ifovs": min(count, 10**7)}
        rng = np.random.default_rng([number, int(1e3 * bin_width)])
        frames = sample_frames(extent, frame_count=256, rng=rng, **signal)[:, 16]
        mean, band = banded_frame_moments(extent, **signal)
        z = (frames.mean() - mean[16]) / math.sqrt(band[0, 16] / 256)
        assert abs(z) < 5.5
        ratio = frames.var(ddof=1) / band[0, 16]
        assert abs(ratio - 1) < 6.5 * math.sqrt(2.245 / 256)


def test_templates_of_any_pulse_and_ratio_are_positive_definite():
    """With the default nugget; the likeliest profile is the mean."""
    for pulse, cnr, count in product(PULSES, RATIOS, COUNTS):
        mean, band = banded_frame_moments(
            filled(1.0, 64), pulse_width=pulse, cnr=cnr, target_free_ifovs=count
        )
        floor = (count + 1) * noise_floor()
        templates = GaussianTemplates().fit(mean[None], band[None], ["a"], floor=floor)
        at_mean, beside = templates.log_likelihood([mean, mean * (1 + 1e-3)], 16)[:, 0]
        assert at_mean >= beside


@settings(max_examples=40)
@given(
    st.floats(-10.0, -5.0),
    st.floats(-3.0, 2.0),
    st.floats(-60.0, 120.0),
    st.integers(0, 10**7),
    st.integers(1, 10**6),
)
def test_moments_and_profiles_agree_for_any_signal(pulse, bin_width, decibel, count, frames):
    extent = filled(10.0**bin_width, share=0.3)
    signal = {
        "pulse_width": 10.0**pulse,
        "cnr": 10 ** (decibel / 10),
        "target_free_ifovs": count,
    }
    mean, covariance = frame_moments(extent, frame_count=frames, **signal)
    np.testing.assert_allclose(mean, expected_profile(extent, **signal), rtol=64 * EPS)
    scale = np.sqrt(np.diagonal(covariance))
    assert scale.min() > 0.0
    # Lags are cut at 1e-12 of the variance of one target-free IFOV, products round.
    assert np.linalg.eigvalsh(covariance / np.outer(scale, scale)).min() > -1e-9


def test_a_million_frames_in_blocks():
    """Blocks of one generator go on where the last one ended; mean and variance follow theory.

    Two z-scores, at a level of 1e-6 each. Sums of a block round by at most n ulp, 32768 of them.
    """
    extent, signal = filled(100.0, bins=4), {"pulse_width": 1e-6, "cnr": 10.0}
    rng = np.random.default_rng(3)
    total, square, first = np.zeros(4), np.zeros(4), None
    mean, band = banded_frame_moments(extent, **signal)
    for block in [32768] * 30 + [16960]:
        frames = sample_frames(extent, frame_count=block, rng=rng, **signal)
        first = frames if first is None else first
        total += frames.sum(axis=0)
        square += ((frames - mean) ** 2).sum(axis=0)
    count = 10**6
    z = (total / count - mean) / np.sqrt(band[0] / count)
    assert np.abs(z).max() < 5.0
    # Rayleigh kurtosis bounds that of the magnitude.
    assert np.abs(square / count / band[0] - 1).max() < 5.0 * math.sqrt(2.245 / count)
    whole = sample_frames(extent, frame_count=96, rng=np.random.default_rng(3), **signal)
    np.testing.assert_array_equal(whole, first[:96])


def test_the_average_of_a_million_frames():
    """A sum of n terms is wrong by (n - 1) u at most."""
    frames = np.full((10**6, 2), 0.1)
    average = cumulative_average(frames, [1, 10**6])
    assert average[0].tolist() == [0.1, 0.1]
    np.testing.assert_allclose(average[1], 0.1, rtol=10**6 * EPS / 2)


@pytest.mark.parametrize("function", [expected_profile, banded_frame_moments, sample_frames])
@pytest.mark.parametrize(
    ("name", "value"),
    [
        *product(("pulse_width", "cnr", "target_free_ifovs"), (math.nan, math.inf, -1.0)),
        ("pulse_width", 0.0),
        ("pulse_width", 1e-16),
        ("pulse_width", 2.0),
        ("cnr", 1e21),
        ("target_free_ifovs", 1.5),
    ],
)
def test_signals_that_are_none_are_refused(function, name, value):
    signal = {"pulse_width": 30e-9, "cnr": 1e3, "target_free_ifovs": 0} | {name: value}
    if function is sample_frames:
        signal |= {"frame_count": 1, "rng": np.random.default_rng(0)}
    with pytest.raises(ValueError, match=f"^{name} is .*, but must be a (whole|finite) number"):
        function(filled(1.0), **signal)


def test_counts_and_generators_that_are_none_are_refused():
    signal = {"pulse_width": 30e-9, "cnr": 1e3, "rng": np.random.default_rng(0)}
    for count in (0, 1.5, math.nan):
        with pytest.raises(ValueError, match=r"^frame_count is .*, but must be a whole number at"):
            sample_frames(filled(1.0), frame_count=count, **signal)
        with pytest.raises(ValueError, match=r"^frame_count is .*, but must be a whole number at"):
            cumulative_average(np.ones((3, 5)), [count])
    with pytest.raises(ValueError, match=r"^rng is None, but must be a numpy.random.Generator"):
        sample_frames(filled(1.0), frame_count=1, **signal | {"rng": None})
    for receiver in ("peak_pulse", "first_pulse"):
        with pytest.raises(
            ValueError, match=r"^target_free_ifovs is 10000000, but must be at most"
        ):
            sample_frames(
                filled(1.0), frame_count=1, target_free_ifovs=10**7, receiver=receiver, **signal
            )


@pytest.mark.parametrize("slant_range", [0.5, 2e9, math.nan])
def test_ranges_without_a_ratio_are_refused(slant_range):
    with pytest.raises(ValueError, match=r"^slant_range is .* at least 1 and at most 1e"):
        carrier_to_noise(slant_range)


def test_the_ratio_falls_by_four_decades_in_four():
    """As 1 / R^2 from 100 m to 1,000 km."""
    near, far = carrier_to_noise(100.0), carrier_to_noise(1e6)
    assert near / far == pytest.approx(1e8, rel=8 * EPS)


@pytest.mark.parametrize("engine", ENGINES)
def test_more_bins_than_memory_holds_are_refused(engine):
    image = see(engine, box(), aspect=37.0, depression=3.84)
    with pytest.raises(ValueError, match=r"^bin_width is 1e-05 m, but must be at least 5.96e-05 m"):
        range_extent(image, slant_range=1e5, bin_width=1e-5)
    fine = range_extent(image, slant_range=1e5, bin_width=1e-3)
    with pytest.raises(ValueError, match=r"^bin_width is 0.001 m, which makes 250000 range bins"):
        expected_profile(fine, pulse_width=30e-9, cnr=1.0)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("slant_range", 1e300),
        ("ifov", 1.5),
        ("ifov", 1e-9),
        ("bin_width", math.nan),
        ("window", math.inf),
        ("spread", -1.0),
    ],
)
@pytest.mark.parametrize("engine", ENGINES)
def test_extents_that_are_none_are_refused(engine, name, value):
    image = see(engine, box(), aspect=37.0, depression=3.84)
    with pytest.raises(ValueError, match=f"^{name} is .*, but must be"):
        range_extent(image, **{"slant_range": 1e5} | {name: value})


@pytest.mark.parametrize("engine", ENGINES)
def test_a_ship_too_small_to_be_seen_is_a_profile_of_nothing(engine):
    image = see(engine, box(1e-6), aspect=37.0, depression=3.84)
    extent = range_extent(image, slant_range=1e5)
    assert extent.fraction.shape == (0, 250)
    assert math.isnan(extent.error)
    signal = {"pulse_width": 30e-9, "cnr": 1e3}
    assert not expected_profile(extent, **signal).any()
    frames = sample_frames(extent, frame_count=3, rng=np.random.default_rng(0), **signal)
    assert not profile_vector(frames).any()


@pytest.mark.parametrize("pulse_width", [0.1e-9, 10e-6])
def test_lines_within_a_tolerance_are_refined_until_they_meet_the_ship(pulse_width):
    """A ship of 1 m, 8 to 15 cm broad and high: lines of 1 m miss it."""
    ask = {"aspect": 37.0, "depression": 3.84, "tolerance": 0.2, "pulse_width": pulse_width}
    lines = lines_within(box(1 / 130), bin_width=0.01 if pulse_width < 1e-6 else 10.0, **ask)
    assert lines.spacing < 1.0
    assert lines.area.sum() > 0.0


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e301])
def test_profiles_that_are_none_are_refused(value):
    profile = np.ones(250)
    profile[7] = value
    with pytest.raises(ValueError, match=r"^profile (holds|is) .*, but must be"):
        profile_vector(profile)
    with pytest.raises(ValueError, match=r"^floor is .*, but must be a finite number at least"):
        profile_vector(np.ones(250), floor=value)
    with pytest.raises(ValueError, match=r"^profile has shape \(3, 0\), but must have bins"):
        profile_vector(np.ones((3, 0)))


@settings(max_examples=60)
@given(st.integers(0, 249), st.floats(1e-300, 1e300), st.floats(-1e3, 1e3))
def test_vectors_of_one_bin_and_of_constants(place, peak, level):
    """A bin beyond the edges is the peak, all others are 0; a constant has no peak.

    The mean of 40 equal numbers rounds by some ulp, which is no peak either.
    """
    profile = np.zeros(250)
    profile[place] = peak
    vector = profile_vector(profile)
    assert vector[place] == 1.0
    edge = 0.0 if 20 <= place < 230 else 1 / 40
    np.testing.assert_allclose(np.delete(vector, place), -edge / (1 - edge), rtol=64 * EPS)
    assert not profile_vector(np.full(250, level)).any()
    assert not profile_vector(np.full(250, peak)).any()
    assert not profile_vector(np.zeros(250)).any()

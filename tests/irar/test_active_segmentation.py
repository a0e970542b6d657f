"""Segmentation of the active images: what stays, and how seldom noise alone does."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from ncti.irar import noise_threshold, segment

powers = st.one_of(st.floats(0, 100), st.sampled_from([0.0, 5.0, math.nan]))
metres = st.one_of(st.floats(-130, 130), st.just(math.nan))


@given(
    arrays(float, (3, 4), elements=powers),
    arrays(float, (3, 4), elements=metres),
    st.one_of(st.just(5.0), arrays(float, (3, 4), elements=st.floats(0, 100))),
)
def test_what_reaches_the_threshold_stays(intensity, down_range, threshold):
    kept, where = segment(intensity, down_range, threshold=threshold)
    least = np.broadcast_to(threshold, (3, 4))
    for at in np.ndindex(3, 4):
        ship = intensity[at] >= least[at]
        assert kept[at] == (intensity[at] if ship else 0)
        np.testing.assert_equal(where[at], down_range[at] if ship else math.nan)
    again = segment(kept, where, threshold=threshold)
    np.testing.assert_array_equal(again, (kept, where))


def test_pixels_without_a_look_are_no_ship_even_at_threshold_zero():
    intensity, down_range = segment([math.nan, 0.0], [3.0, 4.0], threshold=0.0)
    np.testing.assert_array_equal(intensity, [0.0, 0.0])
    np.testing.assert_array_equal(down_range, [math.nan, 4.0])


def test_inputs_are_left_alone():
    intensity, down_range = np.array([1.0, 9.0]), np.array([3.0, 4.0])
    segment(intensity, down_range, threshold=5.0)
    np.testing.assert_array_equal((intensity, down_range), [[1.0, 9.0], [3.0, 4.0]])


@pytest.mark.parametrize("false_alarm", [1e-9, 1e-4, 0.3])
@pytest.mark.parametrize("cells", [1, 2.5, 122, 1e6])
def test_threshold_of_one_look_is_closed_form(cells, false_alarm):
    """P(peak <= x) = (1 - exp(-x))^M; between edges 1/64 apart the tail bends by some 1e-5."""
    expected = -math.log(-math.expm1(math.log1p(-false_alarm) / cells))
    found = noise_threshold(cells=cells, looks=1, false_alarm=false_alarm)
    assert found == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("false_alarm", [1e-9, 1e-4, 0.3])
@pytest.mark.parametrize("looks", [2, 10, 300])
def test_threshold_of_one_cell_is_a_gamma_quantile(looks, false_alarm):
    """The grid adds a variance of (1/64)^2 / 12 to each look's 1: 2e-5."""
    expected = stats.gamma.isf(false_alarm, looks) / looks
    found = noise_threshold(cells=1, looks=looks, false_alarm=false_alarm)
    assert found == pytest.approx(expected, rel=1e-4)


def test_noise_exceeds_its_threshold_as_often_as_stated():
    """Averaged peaks of noise, 10 looks of 122 cells: binomial, 50,000 pixels at 1e-3."""
    rng = np.random.default_rng(9)
    peaks = rng.exponential(size=(100, 5000, 122)).max(axis=-1)
    image = peaks.reshape(50_000, 10).mean(axis=-1)
    threshold = noise_threshold(cells=122, looks=10, false_alarm=0.01)
    kept, _ = segment(image, np.zeros_like(image), threshold=threshold)
    alarms = np.count_nonzero(kept)
    assert stats.binomtest(alarms, image.size, 0.01).pvalue > 1e-3
    # Averaged looks of a single cell, which hold no peaks, would be held to far too little.
    single = noise_threshold(cells=1, looks=10, false_alarm=0.01)
    assert np.mean(image > single) > 0.99


def test_many_looks_leave_the_pedestal_of_noise_peaks():
    """A harmonic number, plus sigma / sqrt(looks) times the Gaussian quantile."""
    steps = np.arange(1, 123)
    harmonic, sigma = np.sum(1 / steps), math.sqrt(np.sum(1 / steps**2))
    found = noise_threshold(cells=122, looks=1000, false_alarm=0.01)
    gaussian = harmonic + stats.norm.isf(0.01) * sigma / math.sqrt(1000)
    # Skewness of 1.1 / sqrt(1000) moves the quantile by skewness (z^2 - 1) / 6 sigmas.
    assert found == pytest.approx(gaussian, abs=0.04 * sigma / math.sqrt(1000))
    assert harmonic == pytest.approx(5.4, abs=0.05)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"cells": 0.5}, r"cells is 0\.5"),
        ({"looks": 0}, "looks is 0"),
        ({"looks": 2.5}, r"looks is 2\.5"),
        ({"false_alarm": 0.0}, r"false_alarm is 0\.0"),
        ({"false_alarm": 0.7}, r"false_alarm is 0\.7"),
    ],
)
def test_bad_noise_is_named(change, message):
    given = {"cells": 122, "looks": 10, "false_alarm": 0.01} | change
    with pytest.raises(ValueError, match=message):
        noise_threshold(**given)


@pytest.mark.parametrize(
    ("down_range", "threshold", "message"),
    [
        ([1.0], 5.0, r"range_ has shape \(1,\)"),
        ([1.0, 2.0], [5.0, 5.0, 5.0], r"threshold has shape \(3,\)"),
        ([1.0, 2.0], -1.0, r"threshold is -1\.0"),
        ([1.0, 2.0], math.nan, "threshold is nan"),
    ],
)
def test_bad_images_are_named(down_range, threshold, message):
    with pytest.raises(ValueError, match=message):
        segment([7.0, 8.0], down_range, threshold=threshold)

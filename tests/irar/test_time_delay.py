"""Time delay and integration: the right columns, sqrt(12), and why delays are whole."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ncti.irar import time_delay_integrate

DETECTORS = 12


def trailing(scene, detectors):
    """What the detectors see of a scene (line, column): nothing is 1e9 before it begins."""
    samples = np.full((detectors, *scene.shape), 1e9)
    for k in range(detectors):
        samples[k, :, k:] = scene[:, : max(0, scene.shape[1] - k)]
    return samples


def snr(image):
    return image.mean() / image.std()


@given(
    arrays(float, (3, 2, 9), elements=st.integers(-1000, 1000).map(float)),
    st.integers(1, 3),
)
def test_columns_are_those_of_the_definition(samples, detectors):
    samples = samples[:detectors]
    expected = np.empty(samples.shape[1:])
    for line, c in np.ndindex(expected.shape):
        seen = [samples[k, line, c + k] for k in range(detectors) if c + k < 9]
        expected[line, c] = np.mean(seen)
    found = time_delay_integrate(samples)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


@given(arrays(float, (2, 20), elements=st.integers(-1000, 1000).map(float)))
def test_a_noiseless_scene_comes_back(scene):
    """Up to the last column: whatever a detector saw before the scene began is not used."""
    found = time_delay_integrate(trailing(scene, DETECTORS))
    np.testing.assert_allclose(found, scene, rtol=0, atol=1e-12)


def test_one_detector_is_its_own_image():
    image = np.random.default_rng(0).normal(size=(3, 40))
    np.testing.assert_array_equal(time_delay_integrate(image[None]), image)


def test_twelve_detectors_gain_the_root_of_twelve():
    """SNR over 5,000 pixels within 5 %: 5 standard errors, a level of 1e-6.

    The relative standard error of a standard deviation of Gaussian noise is 1 / sqrt(2 n).
    """
    rng = np.random.default_rng(12)
    samples = 10 + rng.normal(size=(DETECTORS, 50, 111))
    image = time_delay_integrate(samples)[:, :100]  # what all detectors have seen
    assert image.size == 5000
    assert snr(image) / snr(samples) == pytest.approx(math.sqrt(12), rel=0.05)

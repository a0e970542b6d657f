"""Time delay and integration: the right columns, sqrt(12), and why delays are whole."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ncti.irar import time_delay_integrate
from ncti.irar.looks import average, gather_looks

DETECTORS = 12


def trailing(scene, detectors):
    """What the detectors see of a scene (line, column): nothing is 1e9 before it begins."""
    samples = np.full((detectors, *scene.shape), 1e9)
    for k in range(detectors):
        samples[k, :, k:] = scene[:, : max(0, scene.shape[1] - k)]
    return samples


def interpolated(samples, delay):
    """Time delay by linear interpolation, as one would do for a delay between samples."""
    frames = []
    for k, frame in enumerate(samples):
        whole, part = int(k * delay // 1), k * delay % 1
        end = samples.shape[-1] - math.ceil((len(samples) - 1) * delay) - 1
        frames.append(
            (1 - part) * frame[:, whole : whole + end]
            + part * frame[:, whole + 1 : whole + 1 + end]
        )
    return np.mean(frames, axis=0)


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


def test_the_rim_gains_by_the_detectors_that_have_seen_it():
    """Noise of the last columns over 20,000 lines, within 5 standard errors of 0.5 %."""
    samples = np.random.default_rng(2).normal(size=(DETECTORS, 20_000, 20))
    noise = time_delay_integrate(samples).std(axis=0)
    seen = np.minimum(DETECTORS, 20 - np.arange(20))
    np.testing.assert_allclose(noise, 1 / np.sqrt(seen), rtol=0.025)


def test_overscans_and_delays_together_gain_about_ten():
    """sqrt(12 x 8) = 9.8 over 4,000 pixels within 5 % (4.5 standard errors)."""
    overscan, rows, columns = 8, 40, 100
    row = np.repeat((np.arange(overscan * rows) + 0.5) / overscan - 0.5, columns)
    index = gather_looks(
        row, np.tile(np.arange(columns), overscan * rows), rows=np.arange(rows), columns=columns
    )
    samples = 10 + np.random.default_rng(3).normal(size=(DETECTORS, overscan * rows, columns + 11))
    image = average(time_delay_integrate(samples)[:, :columns], index)
    assert snr(image) / snr(samples) == pytest.approx(math.sqrt(96), rel=0.05)


def test_interpolation_inflates_the_gain():
    """Linear interpolation by a part f halves the noise's power at worst, (1-f)^2 + f^2.

    Over delays of k / 2 sample the gain measured is sqrt(12 / 0.75), 15 % above sqrt(12) where
    the tolerance is 5 %. It is no gain: neighbours share the noise, so that the mean of 20
    columns is no better than by whole delays, and a pattern of single columns loses half its
    contrast, which whole delays keep.
    """
    samples = 10 + np.random.default_rng(5).normal(size=(DETECTORS, 400, 140))
    single = snr(samples)
    blurred = interpolated(samples, delay=0.5)[:, :120]
    plain = time_delay_integrate(samples)[:, :120]
    assert snr(plain) / single == pytest.approx(math.sqrt(12), rel=0.02)
    assert snr(blurred) / single == pytest.approx(math.sqrt(12 / 0.75), rel=0.02)
    # Half the detectors share an average of two: covariance 1/4 of each, over 0.75 in all.
    noise = blurred - blurred.mean()
    shared = np.mean(noise[:, 1:] * noise[:, :-1]) / noise.var()
    assert shared == pytest.approx(0.125 / 0.75, abs=0.02)  # 4 standard errors of 1 / sqrt(n)
    # Means over 20 columns: noise power 1 / (20 x 12), for interpolation less its two ends.
    wide = [image.reshape(400, 6, 20).mean(axis=-1).std() for image in (plain, blurred)]
    assert wide[1] / wide[0] == pytest.approx(math.sqrt(1 - 0.25 / 20), rel=0.1)
    # Columns that alternate, seen without noise by detectors half a sample apart.
    fence = np.tile([1.0, -1.0], 70)[None]
    seen = np.array([np.roll(fence, k // 2, axis=1) for k in range(DETECTORS)])
    seen[1::2] = (seen[1::2] + np.roll(seen[1::2], 1, axis=-1)) / 2
    assert np.ptp(interpolated(seen, delay=0.5)) == pytest.approx(1.0)
    whole = time_delay_integrate(trailing(fence, DETECTORS))
    assert np.ptp(whole) == pytest.approx(2.0)


def test_input_is_left_alone():
    samples = np.random.default_rng(6).normal(size=(3, 4, 8))
    before = samples.copy()
    time_delay_integrate(samples)[:] = 0
    time_delay_integrate(samples[:1])[:] = 0
    np.testing.assert_array_equal(samples, before)


@pytest.mark.parametrize("shape", [(4, 8), (0, 4, 8)])
def test_bad_samples_are_named(shape):
    with pytest.raises(ValueError, match="samples has shape"):
        time_delay_integrate(np.zeros(shape))

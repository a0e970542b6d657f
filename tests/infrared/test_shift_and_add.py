"""Shift-and-add agrees with its definition, and scales scene and noise by the stated gains."""

import numpy as np
import pytest
from ships_on_pixels import template

from ncti.infrared import shifted_images, thermal_images
from ncti.infrared.super_resolution import NOISE_GAIN, SCENE_GAIN, detector_samples, shift_and_add


@pytest.mark.parametrize("dy", [0, 1])
@pytest.mark.parametrize("dx", [0, 1])
def test_samples_are_four_detector_images_interlaced(dx, dy):
    """Each detector position equals plain averaging of 2 x 2 blocks, for stacks too."""
    fine = np.random.default_rng(0).standard_normal((3, 9, 12))
    moved = fine[:, dy:, dx:]
    rows, cols = moved.shape[1] // 2, moved.shape[2] // 2
    blocks = moved[:, : 2 * rows, : 2 * cols].reshape(3, rows, 2, cols, 2).mean(axis=(2, 4))
    np.testing.assert_allclose(
        detector_samples(fine)[:, dy::2, dx::2], blocks, rtol=1e-13, atol=1e-15
    )


def test_shift_and_add_is_the_mean_of_four_samples():
    samples = np.random.default_rng(4).standard_normal((6, 7))
    by_hand = np.zeros((5, 6))
    for row, col in np.ndindex(by_hand.shape):
        by_hand[row, col] = samples[row : row + 2, col : col + 2].mean()
    np.testing.assert_allclose(shift_and_add(samples), by_hand, atol=1e-15)


def test_gains_are_the_norms_of_the_responses():
    """Gains are norms of the responses to one sample and one half pixel, also by Parseval.

    A half pixel has twice the spread of a detector pixel.
    """
    impulse = np.zeros((9, 9))
    impulse[4, 4] = 1.0
    assert np.linalg.norm(shift_and_add(impulse)) == pytest.approx(NOISE_GAIN, rel=1e-15)
    response = shift_and_add(detector_samples(impulse))
    assert 2 * np.linalg.norm(response) == pytest.approx(SCENE_GAIN, rel=1e-15)
    u = 2 * np.pi * np.arange(64) / 64
    b = np.cos(u / 2)[:, None] * np.cos(u / 2)
    assert 2 * np.sqrt(np.mean(b**4)) == pytest.approx(SCENE_GAIN, rel=1e-9)
    assert np.sqrt(np.mean(b**2)) == pytest.approx(NOISE_GAIN, rel=1e-9)


def test_the_scene_is_that_of_the_perfect_image():
    """Without noise the shifted image is the perfect image seen by the detector.

    Half pixels have twice the spread, of which a detector pixel keeps half.
    """
    fine, _ = template()
    parameters = {"contrast": 0.7, "frame_counts": (4, 16), "nedt": 0.0}
    perfect = thermal_images(
        fine, rng=np.random.default_rng(9), target_spread=0.1, sea_spread=0.3, **parameters
    )
    shifted = shifted_images(
        fine,
        rng=np.random.default_rng(9),
        target_spread=0.05,
        sea_spread=0.15,
        **parameters,
    )
    detected = shift_and_add(detector_samples(perfect))
    np.testing.assert_array_equal(shifted[:, 1:-1, 1:-1], detected)
    assert shifted.shape == perfect.shape

"""Shift-and-add agrees with its definition, and its images differ by the documented errors."""

import re

import numpy as np
import pytest
from scipy import stats
from ships_on_pixels import SHIPS, template

from ncti import infrared
from ncti.infrared import super_resolution

LEVEL = 1e-3
WAYS = ("none", "perfect", "shifted")


def expected_square_error(fine, coarse, way, *, warmth, noise):
    """Return the expected square error: the template's blur plus the variance of a pixel."""
    if way == "none":
        blur, scene, detector = super_resolution.enlarge(coarse) ^ fine, 1.0, 1.0
    elif way == "perfect":
        blur, scene, detector = np.zeros(fine.shape), 1.0, 1.0
    else:
        blur = (
            super_resolution.shift_and_add(
                super_resolution.detector_samples(np.pad(fine.astype(float), 1))
            )
            - fine
        )
        scene, detector = super_resolution.SCENE_GAIN, super_resolution.NOISE_GAIN
    variance = (scene * infrared.SPREAD) ** 2 + (detector * noise) ** 2
    return np.mean(blur.astype(float) ** 2) + variance / warmth**2


def test_documented_error_table_is_reproduced():
    """The table in the docstring of `shift_and_add` has the expected errors.

    Its columns are km, frames, none, perfect, shift-and-add, and this with a quarter of the frames;
    errors are means over four ships, three aspects and two phases.
    """
    errors = []
    for slant_range in (25e3, 50e3, 100e3):
        warmth = infrared.contrast(slant_range)
        views = [
            template(name, aspect, slant_range=slant_range, phase=phase)
            for name in SHIPS
            for aspect in (0.0, 45.0, 90.0)
            for phase in ((0.2, 0.7), (0.6, 0.1))
        ]
        for frame_count in (4, 16, 64):
            cells = [(way, frame_count) for way in WAYS] + [("shifted", frame_count // 4)]
            errors.append(
                [
                    np.mean(
                        [
                            expected_square_error(
                                *pair, way, warmth=warmth, noise=infrared.noise_temperature(frames)
                            )
                            ** 0.5
                            for pair in views
                        ]
                    )
                    for way, frames in cells
                ]
            )
    rows = re.findall(r"^ +\d+ +\d+ +0.*$", super_resolution.shift_and_add.__doc__, re.M)
    printed = np.array([row.split() for row in rows], dtype=float)
    assert printed.shape == (9, 6)
    # Half a unit of the last digit.
    np.testing.assert_allclose(errors, printed[:, 2:], rtol=0, atol=0.0005)


@pytest.mark.parametrize("way", WAYS)
def test_sampled_errors_match_expected_errors(way):
    """z-test at 1e-3 of the mean square error over 300 draws of one ship at 50 km."""
    fine, coarse = template()
    warmth, noise = infrared.contrast(50e3), infrared.noise_temperature(16)
    rng = np.random.default_rng(17)
    parameters = {"contrast": warmth, "frame_counts": (16,), "rng": rng}
    squares = []
    for _ in range(300):
        if way == "none":
            image = super_resolution.enlarge(infrared.thermal_images(coarse, **parameters))
        elif way == "perfect":
            image = infrared.thermal_images(fine, **parameters)
        else:
            image = infrared.shifted_images(fine, **parameters)
        squares.append(infrared.reconstruction_error(image, fine, contrast=warmth)[0] ** 2)
    expected = expected_square_error(fine, coarse, way, warmth=warmth, noise=noise)
    z = (np.mean(squares) - expected) / (np.std(squares) / np.sqrt(300))
    assert abs(z) < stats.norm.isf(LEVEL / 2 / len(WAYS))


@pytest.mark.parametrize("dy", [0, 1])
@pytest.mark.parametrize("dx", [0, 1])
def test_detector_samples_interlace_four_detector_images(dx, dy):
    """Each detector position equals plain averaging of 2 x 2 blocks, for stacks too."""
    fine = np.random.default_rng(0).standard_normal((3, 9, 12))
    moved = fine[:, dy:, dx:]
    rows, cols = moved.shape[1] // 2, moved.shape[2] // 2
    blocks = moved[:, : 2 * rows, : 2 * cols].reshape(3, rows, 2, cols, 2).mean(axis=(2, 4))
    np.testing.assert_allclose(
        super_resolution.detector_samples(fine)[:, dy::2, dx::2], blocks, rtol=1e-13, atol=1e-15
    )


def test_shift_and_add_is_the_mean_of_four_samples():
    samples = np.random.default_rng(4).standard_normal((6, 7))
    by_hand = np.zeros((5, 6))
    for row, col in np.ndindex(by_hand.shape):
        by_hand[row, col] = samples[row : row + 2, col : col + 2].mean()
    np.testing.assert_allclose(super_resolution.shift_and_add(samples), by_hand, atol=1e-15)


def test_gains_equal_impulse_response_norms():
    """They are of one sample and one half pixel, which has twice the spread of a pixel."""
    impulse = np.zeros((9, 9))
    impulse[4, 4] = 1.0
    assert np.linalg.norm(super_resolution.shift_and_add(impulse)) == pytest.approx(
        super_resolution.NOISE_GAIN, rel=1e-15
    )
    response = super_resolution.shift_and_add(super_resolution.detector_samples(impulse))
    assert 2 * np.linalg.norm(response) == pytest.approx(super_resolution.SCENE_GAIN, rel=1e-15)
    sigma = infrared.pixel_sigma(0.1, frame_count=16, nedt=0.0, super_resolution="shifted")
    assert sigma == pytest.approx(0.1 * super_resolution.SCENE_GAIN)


def test_shifted_and_perfect_images_share_one_scene():
    """Without noise the shifted image is the perfect image seen by the detector.

    Half pixels have twice the spread, of which a detector pixel keeps half.
    """
    fine, _ = template()
    parameters = {"contrast": 0.7, "frame_counts": (4, 16), "nedt": 0.0}
    perfect = infrared.thermal_images(
        fine, rng=np.random.default_rng(9), target_spread=0.1, sea_spread=0.3, **parameters
    )
    shifted = infrared.shifted_images(
        fine,
        rng=np.random.default_rng(9),
        target_spread=0.05,
        sea_spread=0.15,
        **parameters,
    )
    detected = super_resolution.shift_and_add(super_resolution.detector_samples(perfect))
    np.testing.assert_array_equal(shifted[:, 1:-1, 1:-1], detected)
    assert shifted.shape == perfect.shape

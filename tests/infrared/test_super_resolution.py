"""Super-resolution: what is left between image and true scene, and the default that follows."""

import numpy as np
import pytest
from fine_templates import template
from scipy import stats
from warm_views import SHIPS

from ncti.infrared import (
    BACK_PROJECTIONS,
    LEAST_CONTRAST,
    SPREAD,
    contrast,
    detector_samples,
    enlarge,
    noise_gain,
    noise_temperature,
    recombine,
    reconstruction_error,
    scene_gain,
    shifted_images,
    thermal_images,
)

LEVEL = 1e-3


def test_reconstruction_error_by_hand():
    target = np.array([[True, False], [False, False]])
    assert reconstruction_error(3.0 * target, target, contrast=3.0) == 0.0
    assert reconstruction_error(np.zeros((2, 2)), target, contrast=3.0) == 0.5
    stack = reconstruction_error(np.zeros((4, 5, 2, 2)), target, contrast=3.0)
    np.testing.assert_array_equal(stack, np.full((4, 5), 0.5))


# The table of BACK_PROJECTIONS: km, frames, none, perfect, 0, 1, 2 and 3 back-projections, and 0
# of a quarter of the frames.
TABLE = """
 25      4     0.264   0.174       0.149      0.166  0.185  0.201   0.201
 25     16     0.227   0.110       0.132      0.133  0.140  0.146   0.149
 25     64     0.216   0.087       0.128      0.124  0.126  0.129   0.132
 50      4     0.362   0.294       0.202      0.252  0.291  0.322   0.305
 50     16     0.282   0.186       0.167      0.189  0.208  0.223   0.202
 50     64     0.257   0.147       0.158      0.169  0.181  0.191   0.167
100      4     0.852   0.832       0.480      0.665  0.790  0.886   0.804
100     16     0.556   0.526       0.356      0.469  0.542  0.595   0.480
100     64     0.453   0.416       0.317      0.406  0.459  0.496   0.356
"""
WAYS = ("none", "perfect", 0, 1, 2, 3)


def expected_square_error(fine, coarse, way, *, warmth, noise):
    """Mean over the draws: the blur of the template, plus the variance of a pixel."""
    if way == "none":
        blur, scene, detector = enlarge(coarse) ^ fine, 1.0, 1.0
    elif way == "perfect":
        blur, scene, detector = np.zeros(fine.shape), 1.0, 1.0
    else:
        padded = np.pad(fine.astype(float), 1 + way)
        blur = recombine(detector_samples(padded), back_projections=way) - fine
        scene, detector = scene_gain(way), noise_gain(way)
    variance = (scene * SPREAD) ** 2 + (detector * noise) ** 2
    return np.mean(blur.astype(float) ** 2) + variance / warmth**2


@pytest.fixture(scope="module")
def measured():
    """(range and frame count, way) errors over four ships, three aspects, two phases.

    The last column is `BACK_PROJECTIONS` with a quarter of the frames.
    """
    rows = []
    for slant_range in (25e3, 50e3, 100e3):
        warmth = contrast(slant_range)
        views = [
            template(name, aspect, slant_range=slant_range, phase=phase)
            for name in SHIPS
            for aspect in (0.0, 45.0, 90.0)
            for phase in ((0.2, 0.7), (0.6, 0.1))
        ]
        for frame_count in (4, 16, 64):
            cells = [(way, frame_count) for way in WAYS] + [(BACK_PROJECTIONS, frame_count // 4)]
            rows.append(
                [
                    np.mean(
                        [
                            expected_square_error(
                                *pair, way, warmth=warmth, noise=noise_temperature(frames)
                            )
                            ** 0.5
                            for pair in views
                        ]
                    )
                    for way, frames in cells
                ]
            )
    return np.array(rows)


def test_table_of_back_projections(measured):
    printed = np.array([line.split() for line in TABLE.split("\n") if line], dtype=float)
    # Half a unit of the last digit.
    np.testing.assert_allclose(measured, printed[:, 2:], rtol=0, atol=0.0005)
    from ncti.infrared import super_resolution

    with open(super_resolution.__file__, encoding="utf-8") as source:
        assert TABLE.strip("\n") in source.read()


def test_default_has_the_least_error(measured):
    shifted = measured[:, 2:6]
    relative = shifted / shifted.min(axis=1, keepdims=True)
    assert np.argmin(shifted.mean(axis=0)) == BACK_PROJECTIONS
    assert np.argmin(relative.max(axis=0)) == BACK_PROJECTIONS
    assert np.count_nonzero(relative[:, 0] == 1) == 8
    assert relative[:, 0].max() < 1.04
    assert 1.38 < relative[:, 1].max() < 1.39
    # Whatever the range and frame count it is better than none, also with as many frames in all.
    assert np.all(shifted[:, 0] < measured[:, 0])
    assert np.all(measured[:, 6] < measured[:, 0])
    np.testing.assert_array_equal(measured[:, 6] < measured[:, 1], [False] * 6 + [True] * 3)


@pytest.mark.parametrize("way", WAYS)
def test_errors_by_drawing_are_the_expected_ones(way):
    """300 draws of one ship at 50 km, z-test at 1e-3 of the mean square error."""
    fine, coarse = template()
    warmth, noise = contrast(50e3), noise_temperature(16)
    rng = np.random.default_rng(17)
    parameters = {"contrast": warmth, "frame_counts": (16,), "rng": rng}
    squares = []
    for _ in range(300):
        if way == "none":
            image = enlarge(thermal_images(coarse, **parameters))
        elif way == "perfect":
            image = thermal_images(fine, **parameters)
        else:
            image = shifted_images(fine, back_projections=way, **parameters)
        squares.append(reconstruction_error(image, fine, contrast=warmth)[0] ** 2)
    expected = expected_square_error(fine, coarse, way, warmth=warmth, noise=noise)
    z = (np.mean(squares) - expected) / (np.std(squares) / np.sqrt(300))
    assert abs(z) < stats.norm.isf(LEVEL / 2 / len(WAYS))


def test_errors_over_the_least_contrast_are_told():
    target = np.array([[True, False], [False, False]])
    errors = reconstruction_error(np.full((2, 2), 0.1), target, contrast=LEAST_CONTRAST)
    assert errors == pytest.approx(0.1 / LEAST_CONTRAST, rel=1e-15)
    assert errors < np.finfo(np.float32).max

"""Super-resolution: the error that is left between the image and the true scene."""

import numpy as np
import pytest
from fine_templates import template
from scipy import stats
from warm_views import SHIPS

from ncti import infrared
from ncti.infrared import super_resolution

LEVEL = 1e-3
WAYS = ("none", "perfect", "shifted")


# The table of `shift_and_add`: km, frames, none, perfect, shift-and-add, and that with a quarter of
# the frames.
TABLE = """
     25      4     0.264   0.174       0.149       0.201
     25     16     0.227   0.110       0.132       0.149
     25     64     0.216   0.087       0.128       0.132
     50      4     0.362   0.294       0.202       0.305
     50     16     0.282   0.186       0.167       0.202
     50     64     0.257   0.147       0.158       0.167
    100      4     0.852   0.832       0.480       0.804
    100     16     0.556   0.526       0.356       0.480
    100     64     0.453   0.416       0.317       0.356
"""


def expected_square_error(fine, coarse, way, *, warmth, noise):
    """Mean over the draws: the blur of the template, plus the variance of a pixel."""
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


@pytest.fixture(scope="module")
def measured():
    """(range and frame count, way) errors over four ships, three aspects, two phases.

    The last column is shift-and-add with a quarter of the frames.
    """
    rows = []
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
            rows.append(
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
    return np.array(rows)


def test_table_of_errors(measured):
    printed = np.array([line.split() for line in TABLE.strip().split("\n")], dtype=float)
    # Half a unit of the last digit.
    np.testing.assert_allclose(measured, printed[:, 2:], rtol=0, atol=0.0005)
    assert TABLE.strip("\n") in super_resolution.shift_and_add.__doc__


@pytest.mark.parametrize("way", WAYS)
def test_errors_by_drawing_are_the_expected_ones(way):
    """300 draws of one ship at 50 km, z-test at 1e-3 of the mean square error."""
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

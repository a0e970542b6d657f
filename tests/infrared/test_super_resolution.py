"""Super-resolved images differ from the true scene by the documented errors."""

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


def test_table_of_errors():
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
def test_errors_by_drawing_are_the_expected_ones(way):
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

"""Constants that no other test covers agree with the physics that determines them."""

import math

import numpy as np
import pytest
import trimesh

from ncti.infrared import band_contrast
from ncti.render import line_image


def test_the_long_wave_band_loses_half_a_decibel_a_kilometre():
    """Small radiance contrasts fall by Beer's law, 2 dB over 4 km and 5 dB over 10 km."""
    near, middle, far = (
        band_contrast(distance, contrast_at_zero=1e-4) for distance in (0.0, 4e3, 10e3)
    )
    assert 10 * math.log10(near / middle) == pytest.approx(2.0, abs=0.01)
    assert 10 * math.log10(near / far) == pytest.approx(5.0, abs=0.01)
    assert band_contrast(3900.0) == pytest.approx(1.39, abs=0.005)  # as stated


def test_nearly_coplanar_plates_keep_their_ranges():
    """An arch of 100 plates, each 8 urad from the next, has a sagitta of 1 cm in 100 m.

    From above, on lines along the arch, range is the depth below the crown, k x^2 / 2. One plane
    through all plates would be off by a centimetre, a plate's chord by k w^2 / 8 = 1 um.
    """
    bend, plates = 8e-6, 100  # [1/m], plates of 1 m
    x = np.arange(plates + 1) - plates / 2
    low = np.column_stack([x, np.full(x.size, -2.0), -bend * x**2 / 2])
    high = low + np.array([0.0, 4.0, 0.0])
    a = np.arange(plates)
    b, c, d = a + 1, a + 1 + x.size, a + x.size
    arch = trimesh.Trimesh(
        np.concatenate([low, high]),
        np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]),
        process=False,
    )
    lines = line_image(arch, aspect=90.0, depression=90.0, roll=0.0, spacing=0.5)
    ranges = lines.piece[:, 2:]
    assert lines.area.sum() == pytest.approx(400.0, rel=0.01)
    assert np.ptp(ranges) == pytest.approx(bend * (plates / 2) ** 2 / 2, abs=2e-4)

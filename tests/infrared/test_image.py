"""Images of range images have the right window, range and scale."""

import numpy as np
import pytest
from ships_on_pixels import view

from ncti import infrared


@pytest.mark.parametrize("way", ["none", "perfect", "shifted"])
@pytest.mark.parametrize("phase", [(0.0, 0.0), (0.3, 0.9)])
def test_window_size_does_not_change_ship_pixels(way, phase):
    texas, frame_counts = view("texas", 60.0), (16, 4, 24)
    footprint = infrared.IFOV * 50e3 * (1.0 if way == "none" else 0.5)
    windows = [{"margin": margin} for margin in (0, 1, 2, 7, 20)]
    thermal = infrared.image(
        texas,
        slant_range=50e3,
        frame_count=frame_counts,
        phase=phase,
        super_resolution=way,
        rng=np.random.default_rng(4),
    )
    on_ship = thermal[:, infrared.silhouette(texas, footprint=footprint, phase=phase).target(0.25)]
    for window in (*windows, {"extent": (-130.0, 130.0, -60.0, 80.0)}):
        target = infrared.silhouette(texas, footprint=footprint, phase=phase, **window).target(0.25)
        thermal = infrared.Imager().images(
            target,
            contrast=infrared.contrast(50e3),
            frame_counts=frame_counts,
            rng=np.random.default_rng(4),
            super_resolution=way,
        )
        assert thermal[:, target].tobytes() == on_ship.tobytes(), window


NOISELESS = infrared.Imager(nedt=0.0, target_spread=0.0, sea_spread=0.0)


def test_perfect_super_resolution_halves_footprint_keeps_contrast():
    """The template is that of half the range, the contrast that of the full range."""
    parameters = {"imager": NOISELESS, "frame_count": 16, "phase": (0.3, 0.6)}
    parameters["rng"] = np.random.default_rng(0)
    duncan = view("duncan", 45.0)
    fine = infrared.image(duncan, slant_range=50e3, super_resolution="perfect", **parameters)
    near = infrared.image(duncan, slant_range=25e3, **parameters)
    np.testing.assert_array_equal(fine > 0, near > 0)
    np.testing.assert_allclose(np.unique(fine), [0, infrared.contrast(50e3)])
    np.testing.assert_allclose(np.unique(near), [0, infrared.contrast(25e3)])

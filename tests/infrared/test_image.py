"""Images of range images have the right window, range and scale."""

import numpy as np
import pytest
from warm_views import SHIPS, ship

from ncti import infrared


@pytest.mark.parametrize("way", ["none", "perfect", "shifted"])
@pytest.mark.parametrize("phase", [(0.0, 0.0), (0.3, 0.9)])
def test_a_larger_window_changes_no_bit_on_the_ship(way, phase):
    view, frame_counts = ship("texas", 60.0), (16, 4, 24)
    footprint = infrared.IFOV * 50e3 * (1.0 if way == "none" else 0.5)
    windows = [{"margin": margin} for margin in (0, 1, 2, 7, 20)]
    thermal = infrared.image(
        view,
        slant_range=50e3,
        frame_count=frame_counts,
        phase=phase,
        super_resolution=way,
        rng=np.random.default_rng(4),
    )
    on_ship = thermal[:, infrared.silhouette(view, footprint=footprint, phase=phase).target(0.25)]
    for window in (*windows, {"extent": (-130.0, 130.0, -60.0, 80.0)}):
        target = infrared.silhouette(view, footprint=footprint, phase=phase, **window).target(0.25)
        thermal = infrared.Imager().images(
            target,
            contrast=infrared.contrast(50e3),
            frame_counts=frame_counts,
            rng=np.random.default_rng(4),
            super_resolution=way,
        )
        assert thermal[:, target].tobytes() == on_ship.tobytes(), window


NOISELESS = infrared.Imager(nedt=0.0, target_spread=0.0, sea_spread=0.0)


@pytest.mark.parametrize("name", SHIPS)
@pytest.mark.parametrize("aspect", [0.0, 45.0, 90.0])
def test_perfect_super_resolution_halves_the_range_but_not_the_sensor(name, aspect):
    view = ship(name, aspect)
    parameters = {"imager": NOISELESS, "frame_count": 16, "phase": (0.3, 0.6)}
    rng = np.random.default_rng(0)
    fine = infrared.image(view, slant_range=50e3, super_resolution="perfect", rng=rng, **parameters)
    near = infrared.image(view, slant_range=25e3, rng=rng, **parameters)
    # The template is that of half the range, the contrast that of the full range.
    np.testing.assert_array_equal(fine > 0, near > 0)
    np.testing.assert_allclose(np.unique(fine), [0, infrared.contrast(50e3)])
    np.testing.assert_allclose(np.unique(near), [0, infrared.contrast(25e3)])
    # With noise it equals thermal_images of that template.
    template = infrared.silhouette(view, footprint=3.75, phase=(0.3, 0.6)).target(0.25)
    noisy = infrared.image(
        view,
        slant_range=50e3,
        super_resolution="perfect",
        rng=np.random.default_rng(3),
        frame_count=(4, 16),
        phase=(0.3, 0.6),
    )
    same = infrared.thermal_images(
        template,
        contrast=infrared.contrast(50e3),
        frame_counts=(4, 16),
        rng=np.random.default_rng(3),
    )
    np.testing.assert_array_equal(noisy, same)


def test_windows_of_an_extent_have_one_shape():
    extent = (-95.0, 95.0, -15.0, 50.0)
    for footprint in (3.75, 7.5):
        shapes = {
            infrared.silhouette(
                ship(name, aspect), footprint=footprint, phase=phase, extent=extent
            ).coverage.shape
            for name in SHIPS
            for aspect in (0.0, 45.0, 90.0)
            for phase in ((0.0, 0.0), (0.99, 0.5))
        }
        assert len(shapes) == 1

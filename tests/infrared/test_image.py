"""Images of range images: the window, the range and the scale."""

import warnings

import numpy as np
import pytest
from scipy import stats
from warm_views import SHIPS, plate, ship

from ncti.infrared import (
    IFOV,
    SUPER_RESOLUTIONS,
    contrast,
    image,
    noise_temperature,
    silhouette,
    thermal_images,
)

LEVEL = 1e-3  # of each statistical test, over all that it compares (Bonferroni)


@pytest.mark.parametrize("way", SUPER_RESOLUTIONS)
@pytest.mark.parametrize("kelvin", [0.0, 1e-9, 1e9, -1e9])
def test_extreme_contrasts(way, kelvin):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        thermal = image(
            plate(width=60, height=30),
            slant_range=50e3,
            frame_count=(1, 16),
            rng=np.random.default_rng(0),
            super_resolution=way,
            contrast_at_zero=kelvin,
            extinction=0.0,
            target_spread=0.0,
            sea_spread=0.0,
        )
    assert np.isfinite(thermal).all()
    largest = np.abs(thermal).max()
    assert 0.4 / 4 < largest < 4 if abs(kelvin) < 1 else largest == pytest.approx(1e9)


@pytest.mark.parametrize("way", ["none", "perfect", "shifted"])
@pytest.mark.parametrize("phase", [(0.0, 0.0), (0.3, 0.9)])
def test_a_larger_window_changes_no_bit_on_the_ship(way, phase):
    look = {
        "slant_range": 50e3,
        "frame_count": (16, 4, 24),
        "super_resolution": way,
        "phase": phase,
    }
    view = ship("texas", 60.0)
    footprint = IFOV * 50e3 * (1.0 if way == "none" else 0.5)
    images = {}
    for margin in (0, 1, 2, 4, 7, 20):
        target = silhouette(view, footprint=footprint, phase=phase, margin=margin).target(0.25)
        thermal = image(view, rng=np.random.default_rng(4), margin=margin, **look)
        images[margin] = thermal[:, target]
    for margin, pixels in images.items():
        assert pixels.tobytes() == images[0].tobytes(), margin
    extent = (-130.0, 130.0, -60.0, 80.0)
    window = {"phase": phase, "extent": extent}
    target = silhouette(view, footprint=footprint, **window).target(0.25)
    thermal = image(view, rng=np.random.default_rng(4), **look | window)
    assert thermal[:, target].tobytes() == images[0].tobytes()


def test_one_frame_count_gives_one_image():
    look = {"slant_range": 50e3, "margin": 2}
    view = plate(width=60, height=30)
    one = image(view, frame_count=16, rng=np.random.default_rng(1), **look)
    several = image(view, frame_count=[16], rng=np.random.default_rng(1), **look)
    assert one.ndim == 2 and one.dtype == np.float64
    np.testing.assert_array_equal(one, several[0])


def test_statistics_of_an_image_are_those_of_its_range():
    view = plate(width=600, height=600, pixel=1.0)
    for slant_range in (25e3, 50e3):
        thermal = image(view, slant_range=slant_range, frame_count=16, rng=np.random.default_rng(2))
        inner = silhouette(view, footprint=150e-6 * slant_range).target(1.0 - 0.2)
        pixels = thermal[inner]
        sigma = np.hypot(0.1, noise_temperature(16))
        z = (pixels.mean() - contrast(slant_range)) / (sigma / np.sqrt(pixels.size))
        assert pixels.size > 1000 and abs(z) < stats.norm.isf(LEVEL / 2 / 2)


NOISELESS = {"nedt": 0.0, "target_spread": 0.0, "sea_spread": 0.0}


@pytest.mark.parametrize("name", SHIPS)
@pytest.mark.parametrize("aspect", [0.0, 45.0, 90.0])
def test_perfect_super_resolution_halves_the_range_but_not_the_sensor(name, aspect):
    view = ship(name, aspect)
    parameters = NOISELESS | {"frame_count": 16, "phase": (0.3, 0.6)}
    rng = np.random.default_rng(0)
    fine = image(view, slant_range=50e3, super_resolution="perfect", rng=rng, **parameters)
    near = image(view, slant_range=25e3, rng=rng, **parameters)
    # The template of half the range, as warm as from the whole of it.
    np.testing.assert_array_equal(fine > 0, near > 0)
    np.testing.assert_allclose(np.unique(fine), [0, contrast(50e3)])
    np.testing.assert_allclose(np.unique(near), [0, contrast(25e3)])
    # With noise it is what thermal_images makes of that template.
    template = silhouette(view, footprint=3.75, phase=(0.3, 0.6)).target(0.25)
    noisy = image(
        view,
        slant_range=50e3,
        super_resolution="perfect",
        rng=np.random.default_rng(3),
        frame_count=(4, 16),
        phase=(0.3, 0.6),
    )
    same = thermal_images(
        template, contrast=contrast(50e3), frame_counts=(4, 16), rng=np.random.default_rng(3)
    )
    np.testing.assert_array_equal(noisy, same)


def test_windows_of_an_extent_have_one_shape():
    extent = (-95.0, 95.0, -15.0, 50.0)
    for way in SUPER_RESOLUTIONS:
        shapes = {
            image(
                ship(name, aspect),
                slant_range=50e3,
                frame_count=4,
                rng=np.random.default_rng(0),
                phase=phase,
                extent=extent,
                super_resolution=way,
            ).shape
            for name in SHIPS
            for aspect in (0.0, 45.0, 90.0)
            for phase in ((0.0, 0.0), (0.99, 0.5))
        }
        assert len(shapes) == 1


def test_a_range_image_of_its_own_range():
    near = plate(width=60, height=30, slant_range=25e3)
    rng = np.random.default_rng(0)
    assert image(near, slant_range=25e3, frame_count=4, rng=rng).ndim == 2
    with pytest.raises(ValueError, match=r"slant_range is 50000\.0, but must be the 25000\.0 m"):
        image(near, slant_range=50e3, frame_count=4, rng=rng)


@pytest.mark.parametrize(
    ("parameters", "named"),
    [
        ({"slant_range": 0.0}, "slant_range"),
        ({"slant_range": np.nan}, "slant_range"),
        ({"slant_range": "far"}, "slant_range is 'far'"),
        ({"slant_range": 1}, "slant_range is 1 and ifov 0.00015, .* at least .* 0.25 m"),
        ({"slant_range": 1e300}, "slant_range is 1e[+]300"),
        ({"ifov": -1e-6}, "ifov"),
        ({"ifov": 1e300}, "ifov"),
        ({"ifov": 1e-6}, "slant_range is 50000.0 and ifov 1e-06, "),
        ({"coverage_rule": 0.0}, "coverage_rule is 0.0"),
        ({"coverage_rule": 2}, "coverage_rule is 2"),
        ({"super_resolution": "magic"}, "super_resolution is 'magic'"),
        ({"frame_count": 0}, "frame_count is 0"),
        ({"frame_count": "16"}, "frame_count is '16'"),
        ({"frame_count": ["16"]}, "frame_count is '16'"),
        ({"frame_count": None}, "frame_count is None"),
        ({"frame_count": 10**300}, "frame_count is 1000"),
        ({"frame_count": (4, 1.5)}, "frame_count is 1.5"),
        ({"frame_count": [[4, 16]]}, r"frame_count has shape \(1, 2\)"),
        ({"frame_count": [[4, 16], 1]}, r"frame_count is \[\[4, 16\], 1\]"),
        ({"frame_count": ()}, r"frame_count has shape \(0,\)"),
        ({"rng": None}, "rng is None"),
        ({"rng": 3, "super_resolution": "shifted"}, "rng is 3"),
        ({"margin": 0.5}, "margin is 0.5"),
        ({"contrast_at_zero": np.nan}, "contrast_at_zero"),
        ({"extinction": -1.0}, "extinction"),
        ({"nedt": -0.1}, "nedt"),
        ({"target_spread": -0.1}, "target_spread"),
        ({"sea_spread": np.inf}, "sea_spread"),
        ({"super_resolution": "shifted", "sea_spread": -0.1}, "sea_spread is -0.1"),
        ({"super_resolution": "shifted", "target_spread": "2"}, "target_spread is '2'"),
        ({"phase": (1.5, 0.0)}, r"phase\[0\] is 1.5"),
        ({"phase": (0.0, 1.0)}, r"phase\[1\] is 1.0, .* below 1"),
        ({"phase": 0.5}, "phase is 0.5, .* 2 numbers"),
        ({"phase": (0.1, 0.2, 0.3)}, r"phase is \(0.1, 0.2, 0.3\), .* 2 numbers"),
        ({"phase": ((0.1, 0.2), 0.3)}, r"phase\[0\] is \(0.1, 0.2\)"),
        ({"extent": (-1.0, 1.0, -1.0, 1.0)}, "extent"),
        ({"extent": (-99.0, 99.0, -99.0)}, "extent is .*, .* 4 numbers"),
        ({"extent": 99.0}, "extent is 99.0, .* 4 numbers"),
        ({"extent": (None, 99.0, -99.0, 99.0)}, r"extent\[0\] is None"),
    ],
)
def test_bad_parameters_are_named(parameters, named):
    good = {"slant_range": 50e3, "frame_count": 16, "rng": np.random.default_rng(0)}
    with pytest.raises(ValueError, match=f"^{named}") as refused:
        image(plate(width=60, height=30), **good | parameters)
    assert "\n" not in str(refused.value) and ", but " in str(refused.value)


def test_the_window_is_given_in_any_sequence():
    look = {"slant_range": 50e3, "frame_count": 16}
    by_tuple, by_array = (
        image(
            plate(width=60, height=30),
            rng=np.random.default_rng(0),
            phase=kind((0.3, 0.9)),
            extent=kind((-60.0, 60.0, -30.0, 30.0)),
            **look,
        )
        for kind in (tuple, np.array)
    )
    np.testing.assert_array_equal(by_tuple, by_array)

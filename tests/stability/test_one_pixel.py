"""Images of one pixel, through every stage."""

import math

import numpy as np
import pytest

import ncti.infrared
from ncti.features import log_polar, segment
from ncti.infrared import silhouette, thermal_images
from ncti.ladar import range_extent
from ncti.render import RangeImage
from ncti.render.lines import LineImage

VIEW = {"aspect": 0.0, "depression": 0.0, "roll": 0.0}
MATCHED = {"contrast": 1.0, "target_sigma": 0.1, "sea_sigma": 0.1}


def pixel(down_range=3.25, side=1.0):
    gradient = np.zeros((1, 1, 2), dtype=np.float32)
    return RangeImage(np.array([[down_range]]), gradient, side, (side / 2, side / 2), **VIEW)


def piece(down_range=3.25, side=1.0):
    """One line that sees a square metre."""
    return LineImage(
        np.zeros(1, dtype=np.int32),
        np.array([[0.0, side, down_range, down_range]]),
        np.zeros(1, dtype=np.int32),
        np.array([[0.0, 0.0, -1.0]]),
        spacing=side,
        phase=0.5,
        **VIEW,
    )


@pytest.mark.parametrize("image", [pixel(), piece()], ids=["image", "lines"])
@pytest.mark.parametrize("slant_range", [100.0, 1e5, 1e6])
def test_a_square_metre_in_one_bin(image, slant_range):
    """Its range is 3.25 m and the sagitta of half a pixel, at most 1/400 m: the bin from 3 m on."""
    extent = range_extent(image, slant_range=slant_range, ifov=15.0 / slant_range)
    assert extent.fraction.shape == (1, 250)
    assert np.flatnonzero(extent.fraction).tolist() == [128]
    assert extent.fraction.sum() == pytest.approx(1 / 225, rel=1e-12)


@pytest.mark.parametrize("image", [pixel(), piece()], ids=["image", "lines"])
def test_one_detector_pixel(image):
    shape = silhouette(image, footprint=4.0, margin=0, extent=(0.0, 1.0, 0.0, 1.0))
    assert shape.coverage.sum() == pytest.approx(1 / 16, rel=1e-12)
    (one,) = (
        silhouette(image, footprint=4.0, phase=(0.25, 0.25), margin=0).coverage[part]
        for part in [(0, 0)]
    )
    assert one == pytest.approx(1 / 16, rel=1e-12)
    rng = np.random.default_rng(0)
    for way in ("none", "perfect", "shifted"):
        seen = ncti.infrared.image(
            image,
            slant_range=1e5,
            frame_count=[1, 10**6],
            rng=rng,
            margin=0,
            coverage_rule=1e-3,
            super_resolution=way,
        )
        assert np.isfinite(seen).all()
        assert not log_polar(segment(seen, **MATCHED)).any() or seen[0].size > 1


def test_a_pixel_of_one_frame_and_of_a_million():
    """400 pixels, each drawn alone: mean and variance of both at a level of 1e-6."""
    target = np.ones((1, 1), dtype=bool)
    drawn = np.array(
        [
            thermal_images(
                target, contrast=2.0, frame_counts=[1, 10**6], rng=np.random.default_rng(seed)
            ).ravel()
            for seed in range(400)
        ]
    )
    for column, frames in enumerate((1, 10**6)):
        sigma = ncti.infrared.pixel_sigma(ncti.infrared.SPREAD, frame_count=frames)
        assert abs(drawn[:, column].mean() - 2.0) < 4.9 * sigma / math.sqrt(400)
        assert abs(drawn[:, column].var() / sigma**2 - 1) < 5.2 * math.sqrt(2 / 400)


@pytest.mark.parametrize("method", ["matched", "otsu", "li", "isodata"])
@pytest.mark.parametrize("value", [0.0, 1.0, -1e300, 1e300])
def test_nothing_stands_out_in_one_pixel(method, value):
    assert not segment(np.full((1, 1), value), method=method, **MATCHED).any()


@pytest.mark.parametrize("mask", [np.zeros((1, 1)), np.ones((1, 1)), np.full((1, 1), 0.5)])
@pytest.mark.parametrize("interpolation", ["bilinear", "nearest"])
def test_one_pixel_has_no_shape(mask, interpolation):
    assert not log_polar(mask, interpolation=interpolation).any()


def test_what_is_no_image_is_refused():
    for value in (np.nan, np.inf):
        with pytest.raises(ValueError, match=r"^image is (nan|inf), but must be a finite number"):
            segment(np.full((1, 1), value), method="otsu")
        with pytest.raises(ValueError, match=r"^mask is (nan|inf), but must be a finite number"):
            log_polar(np.full((1, 1), value))
    with pytest.raises(ValueError, match=r"^image has shape \(0, 1\), but must have rows"):
        segment(np.zeros((0, 1)), method="otsu")
    with pytest.raises(ValueError, match=r"^mask has shape \(0, 1\), but must have rows"):
        log_polar(np.zeros((0, 1)))

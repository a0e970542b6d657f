"""The tilt of a corrected image recovers known shears of rendered ships."""

import math

import numpy as np
import pytest
from scipy import ndimage, stats

from ncti import ships
from ncti.irar import tilts
from ncti.render import range_image

CELLS = 8  # of a pixel
PIXEL = 0.8  # m
SHAPE = 70, 60
LOOKS = 10
SEA = 0.01  # 20 dB below a face that looks at the sensor


@pytest.fixture(scope="module")
def truth():
    """Return a frigate near stern in the middle of SHAPE, bright by the cosine of incidence."""
    view = range_image(
        ships.load("roberts"),
        aspect=175,
        depression=6.7,
        pixel=PIXEL / CELLS,
        roll=0,
        slant_range=4000,
    )
    cosine = 1 / np.sqrt(1 + (np.nan_to_num(view.gradient).astype(float) ** 2).sum(axis=-1))
    return centred(np.where(view.hit, cosine, 0.0), SHAPE)


def centred(values, shape):
    """Return the image centred on a dark ground of `shape` pixels."""
    ground = np.zeros((shape[0] * CELLS, shape[1] * CELLS))
    top, left = ((a - b) // 2 for a, b in zip(ground.shape, values.shape, strict=True))
    ground[top : top + values.shape[0], left : left + values.shape[1]] = values
    return ground


def averaged(cells, factor=CELLS):
    rows, columns = (n // factor for n in cells.shape)
    return cells.reshape(rows, factor, columns, factor).mean(axis=(1, 3))


def sheared(cells, mast, waterline):
    """Return the sheared ship: each pixel is the mean of its source in the truth."""
    m, w = math.tan(math.radians(mast)), math.tan(math.radians(waterline))
    inverse = np.linalg.inv([[1.0, w], [m, 1.0]])
    middle = (np.array(cells.shape) - 1) / 2
    offset = middle - inverse @ middle
    return averaged(ndimage.affine_transform(cells, inverse, offset=offset, order=1))


def speckled(image, rng):
    """Return the mean of exponential looks at the image on noisy sea."""
    ship, sea = rng.standard_gamma(LOOKS, (2, *image.shape)) / LOOKS
    return image * ship + SEA * sea


SHEARS = [(0.0, 0.0), (0.1, 0.0), (0.0, -0.5), (-5.0, 0.0), (2.0, 0.5), (5.0, -5.0)]


@pytest.mark.parametrize(("mast", "waterline"), SHEARS)
def test_tilts_recover_known_shears(truth, mast, waterline):
    measured = tilts(sheared(truth, mast, waterline), truth)
    assert measured.mast == pytest.approx(mast, abs=0.02)
    assert measured.waterline == pytest.approx(waterline, abs=0.02)


def test_tilts_stay_accurate_with_coarser_truth(truth):
    measured = tilts(sheared(truth, 2.0, 0.5), averaged(truth, 2))
    assert (measured.mast, measured.waterline) == pytest.approx((2.0, 0.5), abs=0.05)


def test_tilt_errors_under_speckle_match_standard_errors(truth):
    """Check 12 images of 10 looks at 20 dB: masts within 0.2 deg, errors as stated.

    Squared errors over squared standard errors sum to a chi-squared of 12 degrees, which
    exceeds its bound once in 10,000 times. The standard error may be twice too large.
    """
    rng = np.random.default_rng(1)
    image = sheared(truth, 0.5, -0.5)
    measured = [tilts(speckled(image, rng), truth) for _ in range(12)]
    mast = np.array([t.mast - 0.5 for t in measured])
    waterline = np.array([t.waterline + 0.5 for t in measured])
    assert np.abs(mast).max() < 0.2
    assert np.sqrt(np.mean(waterline**2)) < 0.2
    assert np.abs(waterline).max() < 0.5
    for error, deviation in (
        (mast, np.array([t.mast_error for t in measured])),
        (waterline, np.array([t.waterline_error for t in measured])),
    ):
        squares = np.sum((error / deviation) ** 2)
        assert squares < stats.chi2(12).isf(1e-4)
        assert squares > stats.chi2(12).ppf(1e-4) / 4


def test_image_without_a_ship_has_no_tilt(truth):
    measured = tilts(np.zeros(SHAPE), truth)
    assert math.isnan(measured.mast)
    assert math.isnan(measured.waterline)

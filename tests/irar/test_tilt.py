"""Tilt of a corrected image: known shears of rendered ships come back."""

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


@pytest.fixture(scope="module", params=["roberts", "connole"])
def truth(request):
    """A frigate near stern in the middle of SHAPE, as bright as it faces the sensor."""
    view = range_image(
        ships.load(request.param),
        aspect=175,
        depression=6.7,
        pixel=PIXEL / CELLS,
        roll=0,
        slant_range=4000,
    )
    cosine = 1 / np.sqrt(1 + (np.nan_to_num(view.gradient).astype(float) ** 2).sum(axis=-1))
    return centred(np.where(view.hit, cosine, 0.0), SHAPE)


def centred(values, shape):
    """A bright image on dark ground of `shape` pixels."""
    ground = np.zeros((shape[0] * CELLS, shape[1] * CELLS))
    top, left = ((a - b) // 2 for a, b in zip(ground.shape, values.shape, strict=True))
    ground[top : top + values.shape[0], left : left + values.shape[1]] = values
    return ground


def averaged(cells, factor=CELLS):
    rows, columns = (n // factor for n in cells.shape)
    return cells.reshape(rows, factor, columns, factor).mean(axis=(1, 3))


def sheared(cells, mast, waterline, up=0.0, right=0.0):
    """Pixels of the leaning ship, gathered: where each comes from in the truth, and its mean."""
    m, w = math.tan(math.radians(mast)), math.tan(math.radians(waterline))
    inverse = np.linalg.inv([[1.0, w], [m, 1.0]])
    middle = (np.array(cells.shape) - 1) / 2
    offset = middle - inverse @ (middle + CELLS * np.array([up, right]))
    return averaged(ndimage.affine_transform(cells, inverse, offset=offset, order=1))


def speckled(image, rng):
    """The mean of exponential looks, upon a sea of noise."""
    ship, sea = rng.standard_gamma(LOOKS, (2, *image.shape)) / LOOKS
    return image * ship + SEA * sea


SHEARS = [
    (0.0, 0.0),
    (0.1, 0.0),
    (0.0, 0.1),
    (0.5, 0.0),
    (0.0, -0.5),
    (2.0, 0.0),
    (0.0, 2.0),
    (-5.0, 0.0),
    (0.0, 5.0),
    (2.0, 0.5),
    (5.0, -5.0),
]


@pytest.mark.parametrize(("mast", "waterline"), SHEARS)
def test_known_shears_come_back(truth, mast, waterline):
    found = tilts(sheared(truth, mast, waterline), truth)
    assert found.mast == pytest.approx(mast, abs=0.02)
    assert found.waterline == pytest.approx(waterline, abs=0.02)


def test_shift_does_not_look_like_tilt(truth):
    found = tilts(sheared(truth, 0.5, -0.5, up=0.4, right=-3.3), truth)
    assert (found.mast, found.waterline) == pytest.approx((0.5, -0.5), abs=0.02)
    assert (found.up, found.right) == pytest.approx((0.4, -3.3), abs=0.01)


def test_gain_and_offset_do_not_matter(truth):
    image = sheared(truth, 1.0, 0.3)
    plain = tilts(image, truth)
    other = tilts(700 * image + 20, truth / 9)
    assert (other.mast, other.waterline) == pytest.approx((plain.mast, plain.waterline), abs=0.01)


def test_unknown_pixels_are_not_dark(truth):
    """A fifth of the pixels is missing, and the corners beyond the first and last line are."""
    image = sheared(truth, 1.0, 0.3)
    image[np.random.default_rng(3).random(SHAPE) < 0.2] = np.nan
    image[:14, :25] = np.nan
    image[-4:] = np.nan
    found = tilts(image, truth)
    assert (found.mast, found.waterline) == pytest.approx((1.0, 0.3), abs=0.02)


def test_mirrored_image_leans_the_other_way(truth):
    image = sheared(truth, 1.0, 0.3)
    plain, turned = tilts(image, truth), tilts(image[:, ::-1], truth[:, ::-1])
    assert turned.mast == pytest.approx(-plain.mast, abs=1e-3)
    assert turned.waterline == pytest.approx(-plain.waterline, abs=1e-3)


def test_stretched_rows_do_not_look_like_tilt(truth):
    """A closing speed wrong by 2 % makes the ship taller, and no more oblique."""
    middle = (np.array(truth.shape) - 1) / 2
    matrix = np.diag([1 / 1.02, 1.0])
    taller = ndimage.affine_transform(truth, matrix, offset=middle - matrix @ middle, order=1)
    found = tilts(averaged(taller), truth)
    assert (found.mast, found.waterline) == pytest.approx((0.0, 0.0), abs=0.02)


@pytest.mark.parametrize("mast", [-15.0, 38.0])
def test_uncorrected_lean_is_found(truth, mast):
    """As a mast leans when no line is shifted: its top goes beyond a ship's breadth."""
    wide = np.pad(truth, ((0, 0), (30 * CELLS, 30 * CELLS)))
    found = tilts(sheared(wide, mast, 1.0), wide)
    assert found.mast == pytest.approx(mast, abs=0.05)
    assert found.waterline == pytest.approx(1.0, abs=0.05)


def test_coarser_truth_is_as_good_as_said(truth):
    for factor, bound in ((2, 0.05), (8, 0.4)):
        coarse = averaged(truth, factor)
        for mast, waterline in ((0.5, 0.0), (2.0, 0.5)):
            found = tilts(sheared(truth, mast, waterline), coarse)
            assert (found.mast, found.waterline) == pytest.approx((mast, waterline), abs=bound)


def test_speckle_leaves_what_the_standard_error_says(truth):
    """24 images of 10 looks at 20 dB: masts within 0.2 deg each, both as wide as their errors.

    Squared errors over squared standard errors sum to a chi-squared of 24 degrees, which
    exceeds its bound once in 10,000 times. The standard error may be twice too large.
    """
    rng = np.random.default_rng(1)
    image = sheared(truth, 0.5, -0.5)
    found = [tilts(speckled(image, rng), truth) for _ in range(24)]
    mast = np.array([t.mast - 0.5 for t in found])
    waterline = np.array([t.waterline + 0.5 for t in found])
    assert np.abs(mast).max() < 0.2
    assert np.sqrt(np.mean(waterline**2)) < 0.2
    assert np.abs(waterline).max() < 0.5
    for error, said in (
        (mast, np.array([t.mast_error for t in found])),
        (waterline, np.array([t.waterline_error for t in found])),
    ):
        squares = np.sum((error / said) ** 2)
        assert squares < stats.chi2(24).isf(1e-4)
        assert squares > stats.chi2(24).ppf(1e-4) / 4


@pytest.mark.parametrize("axis", [0, 1])
def test_garbled_lines_are_left_out(truth, axis):
    """A tenth of the rows or columns shows noise three times as bright as the ship."""
    rng = np.random.default_rng(2)
    image = sheared(truth, 0.5, -0.5)
    for noisy in (False, True):
        garbled = speckled(image, rng) if noisy else image.copy()
        lines = rng.choice(garbled.shape[axis], garbled.shape[axis] // 10, replace=False)
        np.moveaxis(garbled, axis, 0)[lines] = rng.exponential(
            3.0, (len(lines), garbled.shape[1 - axis])
        )
        found = tilts(garbled, truth)
        assert found.mast == pytest.approx(0.5, abs=0.2 if noisy else 0.02)
        assert found.waterline == pytest.approx(-0.5, abs=0.5 if noisy else 0.02)


@pytest.mark.parametrize("drift", [0.05, 0.75])
def test_looks_are_led_back_by_their_places(truth, drift):
    """Lines of samples a pixel apart, ten lines a row, each moved on by a tenth of the drift.

    Taken for spread evenly, looks of a pixel that all lie to one side lean by the drift, row by
    row; by their places they do so by the tilt that they were given, as exactly as even ones.
    """
    mast, waterline = 0.5, -0.5
    line = np.arange(-60, 10 * SHAPE[0] + 60)
    row, column = np.meshgrid(line / 10, np.arange(-30.0, SHAPE[1] + 30), indexing="ij")
    column = column + drift * (row - SHAPE[0]) - np.floor(drift * (row - SHAPE[0]))
    leaning = sheared_looks(truth, row, column, mast, waterline)
    pixel = np.floor(row + 0.5), np.floor(column + 0.5)
    edges = [np.arange(n + 1) - 0.5 for n in SHAPE]
    total, count = (
        np.histogram2d(pixel[0].ravel(), pixel[1].ravel(), edges, weights=weight)[0]
        for weight in (leaning.ravel(), None)
    )
    found = tilts(total / count, truth, places=(row, column))
    assert (found.mast, found.waterline) == pytest.approx((mast, waterline), abs=0.02)
    if drift < 0.1:
        assert abs(tilts(total / count, truth).mast - mast) > 0.05


def sheared_looks(cells, row, column, mast, waterline):
    """What looks at some places [pixel] see of the leaning ship, cells taken as points."""
    m, w = math.tan(math.radians(mast)), math.tan(math.radians(waterline))
    place = np.stack([row - (SHAPE[0] - 1) / 2, column - (SHAPE[1] - 1) / 2])
    back = np.einsum("ij,j...->i...", np.linalg.inv([[1.0, w], [m, 1.0]]), place)
    middle = (np.array(cells.shape) - 1) / 2
    return ndimage.map_coordinates(cells, CELLS * back + middle[:, None, None], order=1)


def test_channels_share_a_tilt(truth):
    """A second image of a tenth of the speckle: both together are as good as that one, and say so.

    Of 12 draws, squared errors over squared standard errors as above. In the first two of them
    another channel that is nothing but noise changes nothing.
    """
    rng = np.random.default_rng(4)
    image = sheared(truth, 0.5, -0.5)
    squares = np.zeros(2)
    for draw in range(12):
        steady = image * (1 + 0.03 * rng.standard_normal(SHAPE))
        steady += 0.01 * rng.standard_normal(SHAPE)
        alone = tilts(speckled(image, rng), truth)
        both = tilts([speckled(image, rng), steady], [truth, truth])
        assert both.mast_error < 0.5 * alone.mast_error
        assert both.waterline_error < 0.5 * alone.waterline_error
        if draw < 2:
            more = tilts([steady, rng.standard_normal(SHAPE)], [truth, truth])
            assert abs(more.mast - 0.5) < 5 * both.mast_error
            assert abs(more.waterline + 0.5) < 5 * both.waterline_error
        squares += (
            ((both.mast - 0.5) / both.mast_error) ** 2,
            ((both.waterline + 0.5) / both.waterline_error) ** 2,
        )
    assert (squares < stats.chi2(12).isf(1e-4)).all()
    assert (squares > stats.chi2(12).ppf(1e-4) / 4).all()


def test_image_without_a_ship_has_no_tilt(truth):
    found = tilts(np.zeros(SHAPE), truth)
    assert math.isnan(found.mast)
    assert math.isnan(found.waterline)


def test_refusals():
    ship = np.zeros((8, 8))
    ship[2:6, 3:5] = 1.0
    with pytest.raises(ValueError, match=r"truth has shape \(12, 8\)"):
        tilts(ship, np.ones((12, 8)))
    with pytest.raises(ValueError, match="truth is 0 everywhere"):
        tilts(ship, np.zeros((8, 8)))
    with pytest.raises(ValueError, match=r"image has shape \(8,\)"):
        tilts(ship[0], ship)
    with pytest.raises(ValueError, match="image holds an infinite value"):
        tilts(np.full((8, 8), np.inf), ship)
    with pytest.raises(ValueError, match=r"truth has shape \(8, 8\)"):
        tilts([ship, ship], ship)
    with pytest.raises(ValueError, match="places has rows of shape"):
        tilts(ship, ship, places=([0.0, 1.0], [0.0]))

"""Segmentation by thresholds, neighbours and regions agrees with theory and plain loops."""

import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy import ndimage, stats

from ncti.features import segment
from ncti.features.segmentation import METHODS as SEGMENTATION_METHODS
from ncti.features.segmentation import (
    _conditional_modes,
    _heaviest_region,
    _log_likelihood_ratio,
    largest_region,
)

KNOWN = {"contrast": 1.28, "target_sigma": 0.1, "sea_sigma": 0.1}  # 25 km

sigmas = st.floats(0.01, 10)
contrasts = st.floats(0.01, 10)
images = arrays(
    float,
    array_shapes(min_dims=2, max_dims=2, max_side=12),
    elements=st.floats(-1e6, 1e6, allow_subnormal=False),
)
ratios = arrays(
    float, array_shapes(min_dims=2, max_dims=2, max_side=9), elements=st.floats(-4, 4, width=16)
)


def ratio_of(image, **known):
    return _log_likelihood_ratio(
        image[None], **{k: np.full((1, 1, 1), v) for k, v in known.items()}
    )[0]


def modes(target, ratio):
    return _conditional_modes(target[None], ratio[None])[0]


def whole(target, *, weights):
    return _heaviest_region(target[None], weights=None if weights is None else weights[None])[0]


def ship(shape=(20, 54)):
    """Return a hull with a deckhouse and a mast, one region without holes."""
    mask = np.zeros(shape, dtype=bool)
    mask[12:16, 6:46] = True
    mask[8:12, 16:34] = True
    mask[3:8, 24] = True
    return mask


def image_of(mask, rng, *, contrast, target_sigma, sea_sigma):
    noise = rng.standard_normal(mask.shape)
    return np.where(mask, contrast + target_sigma * noise, sea_sigma * noise)


# Templates and degenerate images


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("method", SEGMENTATION_METHODS)
@given(image=images)
def test_any_image_gives_one_region_without_holes(method, image):
    mask = segment(image, method=method, **KNOWN)
    assert mask.shape == image.shape
    _, regions = ndimage.label(mask, structure=np.ones((3, 3)))
    assert regions <= 1
    np.testing.assert_array_equal(ndimage.binary_fill_holes(mask), mask)


@given(arrays(bool, array_shapes(min_dims=3, max_dims=3, max_side=9)))
def test_noiseless_threshold_keeps_the_largest_region(targets):
    """This needs some sea in the image, as a constant image has no region."""
    targets[:, 0, 0] = False
    np.testing.assert_array_equal(largest_region(targets), segment(targets, method="otsu"))


def test_otsu_without_scikit_image_raises_import_error(monkeypatch):
    monkeypatch.setitem(sys.modules, "skimage", None)
    with pytest.raises(ImportError, match=r"pip install 'ncti-sweep\[segmentation\]'"):
        segment(np.eye(3), method="otsu")
    assert segment(np.eye(3), **KNOWN).shape == (3, 3)


# The likelihood ratio


@given(contrasts, sigmas, sigmas)
def test_log_ratio_matches_two_gaussians_up_to_the_vertex(contrast, target_sigma, sea_sigma):
    x = np.linspace(-3 * sea_sigma, contrast + 3 * target_sigma, 50)[None]
    known = {"contrast": contrast, "target_sigma": target_sigma, "sea_sigma": sea_sigma}
    ratio = ratio_of(x, **known)
    exact = stats.norm.logpdf(x, contrast, target_sigma) - stats.norm.logpdf(x, 0, sea_sigma)
    slope = x / sea_sigma**2 - (x - contrast) / target_sigma**2
    rising = (slope > 0) & ((x > 0) | (exact < 0))
    # Terms of the difference reach 1e6 and more, and cancel.
    size = (x / sea_sigma) ** 2 + ((x - contrast) / target_sigma) ** 2 + 10
    assert (np.abs(ratio - exact)[rising] <= 1e-12 * size[rising]).all()


# Iterated conditional modes


def slow_modes(target, ratio, *, beta=0.5, passes=10):
    """Return the conditional modes pixel by pixel, in the order of the four sets."""
    rows, columns = target.shape
    ship_at = target.tolist()
    for _ in range(passes):
        changed = False
        for first_row, first_column in ((0, 0), (0, 1), (1, 0), (1, 1)):
            for row in range(first_row, rows, 2):
                for column in range(first_column, columns, 2):
                    near = [
                        ship_at[y][x]
                        for y in range(max(0, row - 1), min(rows, row + 2))
                        for x in range(max(0, column - 1), min(columns, column + 2))
                        if (y, x) != (row, column)
                    ]
                    now = ratio[row, column] + beta * (sum(near) - 4) > 0
                    changed = changed or now != ship_at[row][column]
                    ship_at[row][column] = now
        if not changed:
            break
    return np.array(ship_at)


@given(ratios)
def test_conditional_modes_equal_a_plain_loop(ratio):
    np.testing.assert_array_equal(modes(ratio > 0, ratio), slow_modes(ratio > 0, ratio))


# Regions


def test_likeliest_region_beats_the_largest():
    image = np.zeros((20, 40))
    image[2:8, 2:12] = 0.75  # 60 pixels, hardly above mid-level: L = 14 each
    image[12:15, 20:30] = 1.28  # 30 pixels: L = 82 each
    likely, large = segment(image, **KNOWN), segment(image, method="otsu")
    assert likely[13, 25]
    assert likely.sum() == 30
    assert large[4, 4]
    assert large.sum() == 60


@given(arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=10)))
def test_regions_and_holes_match_scipy(target):
    labels, count = ndimage.label(target, structure=np.ones((3, 3)))
    sizes = [(labels == label).sum() for label in range(1, count + 1)]
    largest = labels == 1 + int(np.argmax(sizes)) if count else target
    np.testing.assert_array_equal(whole(target, weights=None), ndimage.binary_fill_holes(largest))

"""The log-polar map is invariant to shift and scale, and rotation shifts it cyclically."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from skimage.transform import warp_polar

import ncti.ships
from ncti.features import cyclic_similarity, log_polar
from ncti.features.log_polar import _unit_grid
from ncti.features.map_vector import map_cells
from ncti.render import range_image

POINT = 0.125  # pixel of the range images that silhouettes are made from [m]
SIDE = 1.0  # of the pixels that silhouettes are seen by [m]


@dataclass(frozen=True)
class Change:
    """A shift along columns and rows [pixel], a factor of size, and a rotation to rows [deg]."""

    shift: tuple[float, float] = (0.0, 0.0)
    scale: float = 1.0
    angle: float = 0.0


@lru_cache(maxsize=64)  # some 2 MB each
def points(name, aspect):
    """Return horizontal and vertical places of a silhouette's points [m], (2, point)."""
    view = {"aspect": aspect, "depression": 3.84, "pixel": POINT}
    image = range_image(ncti.ships.load(name), engine="auto", **view)
    return np.stack(image.cross_range_at(*np.nonzero(image.hit)))


def seen(name, aspect, change=Change()):
    """Return the share of each pixel that a silhouette covers after a change, (row, col)."""
    cos, sin = np.cos(np.radians(change.angle)), np.sin(np.radians(change.angle))
    turned = np.array([[cos, -sin], [sin, cos]]) @ points(name, aspect)
    place = turned * (change.scale / SIDE) + np.array(change.shift)[:, None]
    column, row = np.floor(place).astype(np.intp)
    column -= column.min()
    row -= row.min()
    columns, rows = int(column.max()) + 1, int(row.max()) + 1
    count = np.bincount(row * columns + column, minlength=rows * columns)
    # A full pixel may contain one lattice point too many.
    return np.minimum(count.reshape(rows, columns) * (change.scale * POINT / SIDE) ** 2, 1.0)


def cosine(a, b):
    """Return the cosine of two maps; 0 if either is all zero."""
    norms = np.linalg.norm(a) * np.linalg.norm(b)
    return np.vdot(a, b) / norms if norms else 0.0


def blob(seed=0, shape=(20, 54)):
    """Return a ragged silhouette."""
    rng = np.random.default_rng(seed)
    mask = np.zeros(shape, dtype=bool)
    mask[10:16, 5:45] = True
    return mask ^ (rng.random(shape) < 0.05)


masks = arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=12))
parts = st.floats(0, 1, exclude_max=True)


# On real silhouettes


@settings(max_examples=40, deadline=None)
@given(
    name=st.sampled_from(ncti.ships.names()),
    aspect=st.floats(0, 360),
    shift=st.tuples(parts, parts),
    scale=st.floats(0.5, 2),
    angle=st.floats(0, 360),
)
def test_maps_of_transformed_silhouettes_are_97_percent_similar(name, aspect, shift, scale, angle):
    before = log_polar(seen(name, aspect))
    after = log_polar(seen(name, aspect, Change(shift, scale, angle)))
    similarity, _ = cyclic_similarity(after, before)
    assert similarity >= 0.97
    if angle == 0:
        assert cosine(after, before) >= 0.97


# Symmetries


@given(masks, st.integers(0, 5), st.integers(0, 5), st.sampled_from(["bilinear", "nearest"]))
def test_whole_pixel_shifts_change_nothing(mask, down, right, interpolation):
    moved = np.pad(mask, ((down, 3), (right, 1)))
    np.testing.assert_array_equal(
        log_polar(moved, interpolation=interpolation), log_polar(mask, interpolation=interpolation)
    )


# Closed forms


def ellipse(pixel, *, finer=16, long=40.0, short=15.0, turn=0.4, centre=(0.0, 0.0)):
    """Return the area coverage of an ellipse [m], from finer x finer points a pixel."""
    side = np.arange(-48.0 + pixel / finer / 2, 48.0, pixel / finer)
    inside = inside_ellipse(side - centre[0], side[:, None] - centre[1], long, short, turn)
    count = round(96 / pixel)
    return inside.reshape(count, finer, count, finer).mean(axis=(1, 3))


def inside_ellipse(x, y, long, short, turn):
    along, aside = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    return (along / long) ** 2 + (aside / short) ** 2 <= 1


def test_error_is_first_order_in_pixel_size():
    # A sample is wrong only within about a pixel of the edge, and then by up to one: the mean
    # error goes as the pixel, slope 1.
    long, short, turn = 40.0, 15.0, 0.4
    unit = np.sqrt(long * short)
    across, down = _unit_grid(0.5, 3.0, 32, 64, 2)
    exact = inside_ellipse(unit * across, unit * down, long, short, turn).mean(axis=0)
    pixels = np.array([4.0, 2.0, 1.0, 0.5])
    errors = []
    for pixel in pixels:
        # Mean over places in a pixel, or one lucky place would bend the slope.
        places = pixel * np.array([[0.0, 0.0], [0.25, 0.6], [0.5, 0.3], [0.8, 0.9]])
        maps = [log_polar(ellipse(pixel, centre=place)).ravel() for place in places]
        errors.append(np.abs(np.array(maps) - exact).mean())
    slope = np.polyfit(np.log(pixels), np.log(errors), 1)[0]
    assert 0.9 < slope < 1.2
    assert errors[-1] < 0.005


# Samples


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("interpolation", "order", "oversample"),
    [("nearest", 0, 1), ("bilinear", 1, 1), ("bilinear", 1, 2), ("bilinear", 1, 3)],
)
def test_samples_match_scikit_image(interpolation, order, oversample, seed):
    # Where the inner radius is one pixel, both maps cover the same ring. `warp_polar` samples
    # the corners of cells: of a grid twice as fine, every second sample is a centre.
    mask = np.pad(blob(seed), 40)
    row, column = np.argwhere(mask).mean(axis=0)
    unit = np.sqrt(mask.sum() / np.pi)
    samples = log_polar(
        mask,
        inner_radius=1 / unit,
        outer_radius=30 / unit,
        radii=24,
        angles=48,
        interpolation=interpolation,
        oversample=oversample,
    )
    reference = warp_polar(
        mask.astype(float),
        center=(row, column),
        radius=30.0,
        output_shape=(2 * 48 * oversample, 2 * 24 * oversample),
        scaling="log",
        order=order,
    )[1::2, 1::2]
    cells = reference.reshape(48, oversample, 24, oversample).mean(axis=(1, 3))
    np.testing.assert_allclose(samples, cells, atol=1e-10)


# Any mask at all


def test_fewer_than_two_pixels_have_no_shape():
    mask = np.zeros((9, 9), dtype=bool)
    np.testing.assert_array_equal(log_polar(mask), np.zeros((64, 32)))
    mask[4, 2] = True
    np.testing.assert_array_equal(log_polar(mask), np.zeros((64, 32)))
    mask[4, 3] = True
    assert log_polar(mask).any()


# Cyclic similarity


@pytest.mark.parametrize("eighths", [0, 3, 64, 100, -1, -127])
@pytest.mark.parametrize("angles", [32, 33])
def test_fractional_rotation_of_band_limited_maps_is_exact(angles, eighths):
    turn = 2 * np.pi * np.arange(angles)[:, None] / angles
    radii = np.arange(1, 5)

    def rotated(by):
        return 2 + np.cos(turn - by) + 0.5 * np.sin(radii * (turn - by))

    angle = 360 / angles * eighths / 8
    similarity, rotation = cyclic_similarity(rotated(np.radians(angle)), rotated(0.0))
    assert similarity == pytest.approx(1.0, abs=1e-12)
    assert rotation == pytest.approx(angle, abs=1e-9)


def test_self_similarity_is_one_and_zero_for_empty_maps():
    full, empty = log_polar(blob()), np.zeros((64, 32))
    assert cyclic_similarity(full, full) == (pytest.approx(1.0, abs=1e-12), 0.0)
    for pair in ((full, empty), (empty, full), (empty, empty)):
        assert cyclic_similarity(*pair) == (0.0, 0.0)


def test_map_cells_are_cell_centres():
    angle, radius = map_cells()
    assert angle[:2].tolist() == [2.8125, 8.4375] and angle[-1] == 360 - angle[0]
    np.testing.assert_allclose([radius[0], radius[-1]], [0.5 / radius.size, 1 - 0.5 / radius.size])


@pytest.mark.parametrize("name", ncti.ships.names())
@pytest.mark.parametrize("angle", [0.0, 17.0, 133.3, -61.0])
def test_rotation_is_recovered(name, angle):
    before = log_polar(seen(name, 75.0))
    after = log_polar(seen(name, 75.0, Change((0.4, 0.1), 1.3, angle)))
    _, rotation = cyclic_similarity(after, before)
    # Shifts are 0.7 deg apart; an angle of the map is 5.6 deg.
    assert abs(rotation - angle) <= 0.75

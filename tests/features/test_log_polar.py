"""The log-polar map: what leaves it alone, what turns it, and how well, on real silhouettes."""

from functools import cache, lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.signal import resample
from skimage.transform import warp_polar

import ncti.ships
from benchmarks.invariance import (
    FINE,
    FINE_BINARY,
    SENSOR,
    Change,
    cosine,
    coverage,
    silhouette,
)
from ncti.features import cyclic_similarity, log_polar
from ncti.features.log_polar import _unit_grid

points = lru_cache(maxsize=64)(silhouette)  # some 2 MB each


def seen(name, aspect, pixels, change=None):
    return pixels.mask(coverage(points(name, aspect), side=pixels.side, change=change))


def blob(seed=0, shape=(20, 54)):
    """A ragged silhouette."""
    rng = np.random.default_rng(seed)
    mask = np.zeros(shape, dtype=bool)
    mask[10:16, 5:45] = True
    return mask ^ (rng.random(shape) < 0.05)


masks = arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=12))
shares = arrays(float, array_shapes(min_dims=2, max_dims=2, max_side=12), elements=st.floats(0, 1))
parts = st.floats(0, 1, exclude_max=True)


# On real silhouettes


@settings(max_examples=150, deadline=None)
@given(
    name=st.sampled_from(ncti.ships.names()),
    aspect=st.floats(0, 360),
    shift=st.tuples(parts, parts),
    scale=st.floats(0.5, 2),
    angle=st.floats(0, 360),
)
def test_any_change_of_a_fine_silhouette_leaves_0_97(name, aspect, shift, scale, angle):
    before = log_polar(seen(name, aspect, FINE))
    after = log_polar(seen(name, aspect, FINE, Change(shift, scale, angle)))
    similarity, _ = cyclic_similarity(after, before)
    assert similarity >= 0.97
    if angle == 0:
        assert cosine(after, before) >= 0.97


@cache
def fixed_set(pixels, interpolation):
    """Similarity after random changes: 6 ships, 7 aspects, 3 changes of each."""
    rng = np.random.default_rng(7)
    found = []
    for name in ncti.ships.names():
        for aspect in range(0, 91, 15):
            before = log_polar(seen(name, aspect, pixels), interpolation=interpolation)
            for _ in range(3):
                mask = seen(name, aspect, pixels, Change.drawn(rng))
                after = log_polar(mask, interpolation=interpolation)
                found.append(float(cyclic_similarity(after, before)[0]))
    return np.array(found)


def test_binary_silhouettes_keep_less():
    # A mast half a pixel wide is there or not, as it happens to fall: no interpolation of the
    # mask brings it back.
    found = fixed_set(FINE_BINARY, "bilinear")
    assert np.median(found) >= 0.98
    assert found.min() >= 0.92


def test_at_25_km_interpolation_gains_0_05_over_the_plain_map():
    bilinear, nearest = fixed_set(SENSOR, "bilinear"), fixed_set(SENSOR, "nearest")
    assert np.median(bilinear) >= np.median(nearest) + 0.05
    assert bilinear.min() >= nearest.min() + 0.05
    assert np.median(bilinear) >= 0.94
    assert bilinear.min() >= 0.82


@pytest.mark.parametrize("name", ncti.ships.names())
@pytest.mark.parametrize("angle", [0.0, 17.0, 133.3, -61.0])
def test_rotation_is_recovered(name, angle):
    before = log_polar(seen(name, 75.0, FINE))
    after = log_polar(seen(name, 75.0, FINE, Change((0.4, 0.1), 1.3, angle)))
    _, rotation = cyclic_similarity(after, before)
    # Shifts are 0.7 deg apart; an angle of the map is 5.6 deg.
    assert abs(rotation - angle) <= 0.75


def test_the_inside_of_a_ship_is_left_out():
    # Near their centroids all ships look alike, and would agree the better for it.
    views = [seen(name, 60.0, FINE) for name in ("duncan", "texas")]
    near = cosine(*(log_polar(view, inner_radius=0.3) for view in views))
    assert cosine(*(log_polar(view) for view in views)) < near - 0.02


# Symmetries


@given(masks, st.integers(0, 5), st.integers(0, 5), st.sampled_from(["bilinear", "nearest"]))
def test_whole_pixels_of_shift_change_nothing(mask, down, right, interpolation):
    moved = np.pad(mask, ((down, 3), (right, 1)))
    np.testing.assert_array_equal(
        log_polar(moved, interpolation=interpolation), log_polar(mask, interpolation=interpolation)
    )


@given(shares)
def test_quarter_turns_roll_the_map(mask):
    # np.rot90 with k = -1 takes increasing column to increasing row, as the angle grows.
    plain = log_polar(mask)
    for quarters in range(4):
        turned = log_polar(np.rot90(mask, -quarters))
        np.testing.assert_allclose(turned, np.roll(plain, 16 * quarters, axis=0), atol=1e-9)


@given(shares)
def test_a_mirror_reverses_the_angle(mask):
    np.testing.assert_allclose(log_polar(mask[::-1]), log_polar(mask)[::-1], atol=1e-9)
    np.testing.assert_allclose(
        log_polar(mask[:, ::-1]), np.roll(log_polar(mask)[::-1], 32, axis=0), atol=1e-9
    )


@pytest.mark.parametrize("seed", range(5))
def test_pixels_doubled_leave_the_plain_map_and_nearly_the_other(seed):
    mask = blob(seed)
    double = np.kron(mask, np.ones((2, 2), dtype=bool))
    np.testing.assert_array_equal(
        log_polar(double, interpolation="nearest"), log_polar(mask, interpolation="nearest")
    )
    # Between pixels the doubled mask has steeper edges: no sample changes by more than a half.
    difference = np.abs(log_polar(double) - log_polar(mask))
    assert difference.max() <= 0.5
    assert cosine(log_polar(double), log_polar(mask)) > 0.98


def test_angle_0_is_along_columns_and_grows_towards_rows():
    heavy = np.zeros((41, 41), dtype=bool)
    heavy[19:22, 18:34] = True
    heavy[16:25, 14:20] = True  # the centroid is near this end: the arm points away from it
    # The arm straddles the border of two of 16 sectors.
    for mask, sectors in ((heavy, {15, 0}), (heavy.T, {3, 4}), (heavy[:, ::-1], {7, 8})):
        reach = log_polar(mask, angles=16, inner_radius=1.3).sum(axis=1)
        assert set(np.argsort(reach)[-2:].tolist()) == sectors


# Closed forms


def ellipse(pixel, *, finer=16, long=40.0, short=15.0, turn=0.4, centre=(0.0, 0.0)):
    """Area coverage of an ellipse [m], from finer x finer points a pixel."""
    side = np.arange(-48.0 + pixel / finer / 2, 48.0, pixel / finer)
    inside = inside_ellipse(side - centre[0], side[:, None] - centre[1], long, short, turn)
    count = round(96 / pixel)
    return inside.reshape(count, finer, count, finer).mean(axis=(1, 3))


def inside_ellipse(x, y, long, short, turn):
    along, aside = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    return (along / long) ** 2 + (aside / short) ** 2 <= 1


def test_a_disc_gives_a_step_at_radius_one():
    disc = ellipse(1.0, long=40.0, short=40.0, centre=(0.3, -0.2))
    found = log_polar(disc, radii=48, inner_radius=0.75)
    edges = 0.75 * 4 ** (np.arange(49) / 48)  # of the cells
    blur = 1.5 / 40  # a pixel's half diagonal, and one pixel of interpolation
    inside, outside = edges[1:] < 1 - blur, edges[:-1] > 1 + blur
    assert inside.sum() + outside.sum() >= 43
    np.testing.assert_allclose(found[:, inside], 1.0, atol=1e-12)
    np.testing.assert_array_equal(found[:, outside], 0.0)
    # Between them the map depends on the radius alone, up to a few shares of pixels.
    assert np.ptp(found, axis=0).max() < 0.25


def test_error_falls_as_the_pixel():
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
        found = [log_polar(ellipse(pixel, centre=place)).ravel() for place in places]
        errors.append(np.abs(np.array(found) - exact).mean())
    slope = np.polyfit(np.log(pixels), np.log(errors), 1)[0]
    assert 0.9 < slope < 1.2
    assert errors[-1] < 0.005


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("interpolation", "order", "oversample"),
    [("nearest", 0, 1), ("bilinear", 1, 1), ("bilinear", 1, 2), ("bilinear", 1, 3)],
)
def test_samples_are_those_of_scikit_image(interpolation, order, oversample, seed):
    # Where the inner radius is one pixel, both maps cover the same ring. `warp_polar` samples
    # the corners of cells: of a grid twice as fine, every second sample is a centre.
    mask = np.pad(blob(seed), 40)
    row, column = np.argwhere(mask).mean(axis=0)
    unit = np.sqrt(mask.sum() / np.pi)
    found = log_polar(
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
    np.testing.assert_allclose(found, cells, atol=1e-10)


# Any mask at all


@given(masks | shares, st.sampled_from(["bilinear", "nearest"]))
def test_any_mask_gives_shares(mask, interpolation):
    found = log_polar(mask, interpolation=interpolation)
    assert found.shape == (64, 32)
    assert found.dtype == np.float64
    assert np.isfinite(found).all()
    assert found.min() >= 0
    assert found.max() <= 1


def test_fewer_than_two_pixels_have_no_shape():
    one = np.zeros((9, 9), dtype=bool)
    np.testing.assert_array_equal(log_polar(one), np.zeros((64, 32)))
    one[4, 2] = True
    np.testing.assert_array_equal(log_polar(one), np.zeros((64, 32)))
    one[4, 3] = True
    assert log_polar(one).any()


def test_a_line_lies_at_0_and_180_degrees():
    line = np.zeros((5, 40), dtype=bool)
    line[2, 4:34] = True
    found = log_polar(line)
    along = found.sum(axis=1)
    # Beyond one pixel of the line is nothing: within 1/(0.5 unit), unit = sqrt(30 / pi).
    far = np.abs(np.sin(2 * np.pi * (np.arange(64) + 0.5) / 64)) > 1 / (0.5 * 3.09) + 0.05
    np.testing.assert_array_equal(along[far], 0.0)
    assert along[0] == pytest.approx(along[31])
    assert along[0] == pytest.approx(along.max())


def test_a_bool_mask_is_coverage_of_zero_and_one():
    np.testing.assert_array_equal(log_polar(blob()), log_polar(blob().astype(int)))


def test_input_and_the_shared_grid_are_left_alone():
    mask = blob().astype(float)
    before = mask.copy()
    first = log_polar(mask)
    first[:] = 7.0
    np.testing.assert_array_equal(mask, before)
    assert log_polar(mask).max() <= 1


@pytest.mark.parametrize(
    ("given_", "named"),
    [
        ({"mask": np.ones(4)}, "mask has shape"),
        ({"mask": np.ones((0, 4))}, "mask has shape"),
        ({"mask": np.full((4, 4), np.nan)}, "mask is nan, but must be"),
        ({"mask": np.full((4, 4), 1.5)}, "mask is 1.5, but must be"),
        ({"inner_radius": 0.0}, "inner_radius is 0.0"),
        ({"outer_radius": 0.5}, "outer_radius is 0.5"),
        ({"radii": 0}, "radii is 0"),
        ({"angles": 2.5}, "angles is 2.5"),
        ({"oversample": 0}, "oversample is 0"),
        ({"interpolation": "cubic"}, "interpolation is 'cubic'"),
    ],
)
def test_bad_input_is_named(given_, named):
    given_ = {"mask": blob()} | given_
    with pytest.raises(ValueError, match=named):
        log_polar(given_.pop("mask"), **given_)


# Cyclic similarity

maps = arrays(float, (16, 3), elements=st.floats(0, 1))


@given(maps, maps)
def test_similarity_is_the_best_over_shifts_an_eighth_apart(a, b):
    similarity, rotation = cyclic_similarity(a, b)
    assert 0 <= similarity <= 1 + 1e-15
    assert -180 <= rotation < 180
    if not (np.linalg.norm(a) > 1e-100 and np.linalg.norm(b) > 1e-100):
        return
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    finer = resample(b, 8 * 16, axis=0)  # an independent way between the angles
    cosines = [np.vdot(a, np.roll(finer, shift, axis=0)[::8]) for shift in range(8 * 16)]
    assert similarity == pytest.approx(min(max(cosines), 1.0), abs=1e-12)
    assert similarity >= np.vdot(a, b) - 1e-12
    # The reported rotation reaches it.
    assert cosines[round(rotation / 360 * 8 * 16) % (8 * 16)] == pytest.approx(similarity, abs=1e-9)


@pytest.mark.parametrize("eighths", [0, 3, 64, 100, -1, -127])
@pytest.mark.parametrize("angles", [32, 33])
def test_a_band_limited_map_is_found_between_its_angles(angles, eighths):
    turn = 2 * np.pi * np.arange(angles)[:, None] / angles
    radii = np.arange(1, 5)

    def rotated(by):
        return 2 + np.cos(turn - by) + 0.5 * np.sin(radii * (turn - by))

    angle = 360 / angles * eighths / 8
    similarity, rotation = cyclic_similarity(rotated(np.radians(angle)), rotated(0.0))
    assert similarity == pytest.approx(1.0, abs=1e-12)
    assert rotation == pytest.approx(angle, abs=1e-9)


def test_leading_axes_are_pairs():
    rng = np.random.default_rng(0)
    a, b = rng.random((5, 1, 64, 32)), rng.random((3, 64, 32))
    similarity, rotation = cyclic_similarity(a, b)
    assert similarity.shape == rotation.shape == (5, 3)
    for i in range(5):
        for j in range(3):
            one, angle = cyclic_similarity(a[i, 0], b[j])
            assert one == pytest.approx(similarity[i, j], abs=1e-12)
            assert angle == rotation[i, j]


def test_a_map_is_itself_and_zero_is_like_nothing():
    full, empty = log_polar(blob()), np.zeros((64, 32))
    assert cyclic_similarity(full, full) == (pytest.approx(1.0, abs=1e-12), 0.0)
    for pair in ((full, empty), (empty, full), (empty, empty)):
        assert cyclic_similarity(*pair) == (0.0, 0.0)


def test_bad_maps_are_named():
    with pytest.raises(ValueError, match="b has shape"):
        cyclic_similarity(np.ones((64, 32)), np.ones((64, 16)))
    with pytest.raises(ValueError, match="a has shape"):
        cyclic_similarity(np.ones(64), np.ones((64, 16)))
    with pytest.raises(ValueError, match="b is inf, but must be"):
        cyclic_similarity(np.ones((4, 2)), np.full((4, 2), np.inf))


@settings(max_examples=60, deadline=None)
@given(arrays(np.bool_, array_shapes(min_dims=3, max_dims=4, max_side=9)))
@pytest.mark.parametrize("interpolation", ["bilinear", "nearest"])
def test_a_stack_is_mapped_mask_by_mask(interpolation, masks):
    together = log_polar(masks, interpolation=interpolation, radii=5, angles=8)
    for place in np.ndindex(masks.shape[:-2]):
        alone = log_polar(masks[place], interpolation=interpolation, radii=5, angles=8)
        np.testing.assert_array_equal(together[place], alone)


@pytest.mark.parametrize("mask", [np.zeros((3, 3), bool), np.ones((3, 3), bool)])
def test_whole_numbers_may_be_floats(mask):
    found = log_polar(mask, angles=8.0, radii=4.0, oversample=2.0)
    np.testing.assert_array_equal(found, log_polar(mask, angles=8, radii=4))


@pytest.mark.parametrize("scale", [1e-200, 1e200])
def test_similarity_does_not_depend_on_the_size_of_numbers(scale):
    maps = np.random.default_rng(0).random((8, 4))
    similarity, rotation = cyclic_similarity(scale * maps, np.roll(scale * maps, -2, axis=0))
    assert similarity == pytest.approx(1.0)
    assert rotation == 90.0


def test_maps_without_angles_are_refused():
    with pytest.raises(ValueError, match=r"^a has shape \(0, 2\), but must have angles and radii$"):
        cyclic_similarity(np.ones((0, 2)), np.ones((0, 2)))

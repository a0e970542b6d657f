"""Range extents agree with closed forms, conserve area, mirror, and bound their errors."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from plates import plane

import ncti.ships
from ncti.ladar import RangeExtent, no_return, range_extent
from ncti.ladar.pixels import bin_boxes
from ncti.render import LineImage, line_image, range_image
from studies.run_time.accuracy import extent_errors


def plain_boxes(group, start, stop, area, group_count, bin_count):
    """Return the overlap of every box with every bin by the definition, one at a time."""
    out = np.zeros((group_count, bin_count))
    for g, a, b, w in zip(group, start, stop, area, strict=True):
        lo, hi = np.arange(bin_count), np.arange(bin_count) + 1
        overlap = np.clip(np.minimum(hi, b) - np.maximum(lo, a), 0, None)
        out[g] += w * overlap / (b - a)
    return out


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.01, 0.3, 1.0, 7.0, 19.0]))
def test_bin_boxes_equals_box_bin_overlaps(seed, widest):
    rng = np.random.default_rng(seed)
    group = rng.integers(0, 3, 50)
    start = rng.uniform(0, 20 - widest, 50)
    stop = start + rng.uniform(0.002, widest, 50)
    area = rng.uniform(0.1, 2, 50)
    ours = bin_boxes(group, (start + stop) / 2, (stop - start) / 2, area, 3, 20)
    # Ramps have slopes up to 1/0.002 at edges up to 20: products of 1e4, rounded at 1e-16 each.
    np.testing.assert_allclose(
        ours, plain_boxes(group, start, stop, area, 3, 20), atol=50 * 1e4 * 2e-16 * 10
    )


def test_wavefront_curvature_is_the_sagitta():
    # The plate's ends are s = 60 m off the line of sight: s^2 / 2 R0 = 0.45 m at 4 km.
    flat = plane(width=120, height=2, offset=0.01)
    near = range_extent(flat, slant_range=4e3, ifov=1e-3, bin_width=0.05)
    occupied = near.down_range[near.fraction.sum(axis=0) > 0]
    assert occupied.min() == pytest.approx(0.025, abs=1e-6)
    assert occupied.max() == pytest.approx(0.01 + 60**2 / 8e3, abs=0.05)


WHOLE = [(1.0, 0.0), (-2.0, 3.0), (0.0, 1000.0)]


def sights():
    """Return a box seen along lines, and a tilted plate seen by pixels."""
    box = trimesh.creation.box(bounds=[[-40, -9, 0], [35, 8, 14]])
    return line_image(box, aspect=40.0, depression=9.0), plane(width=71, height=13, slope=(0.9, 2))


@pytest.mark.parametrize("image", sights(), ids=["lines", "pixels"])
@pytest.mark.parametrize("whole", WHOLE)
@pytest.mark.parametrize("start", [(0.31, 0.77)])
def test_whole_ifov_shift_only_renumbers_cells(image, whole, start):
    """A thousand IFOVs away places are rounded at 1e-13, so fractions agree to 1e-10."""
    moved = (start[0] + whole[0], start[1] + whole[1])
    near, far = (range_extent(image, slant_range=1e5, shift=shift) for shift in (start, moved))
    assert (near.shift, far.shift) == (start, moved)
    np.testing.assert_array_equal(far.cell, near.cell + np.array(whole, dtype=int))
    np.testing.assert_allclose(far.fraction, near.fraction, atol=1e-10)


@pytest.mark.parametrize("image", sights(), ids=["lines", "pixels"])
@settings(max_examples=15, deadline=None)
@given(st.tuples(*[st.floats(-3, 3)] * 2))
def test_shift_preserves_the_sum_over_ifovs(image, shift):
    """The range makes wavefronts flat, as chords between borders would approximate curved ones."""
    flat = {"slant_range": 1e11, "ifov": 15 / 1e11}
    still = range_extent(image, **flat)
    moved = range_extent(image, **flat, shift=shift)
    sums = (extent.fraction.sum(axis=0) for extent in (still, moved))
    np.testing.assert_allclose(*sums, atol=1e-9)
    # Across a filled IFOV, the length of lines has four kinks of 1 / (sin cos) of their roll. The
    # rectangle rule errs by a twelfth of that at each, times d^2 (Euler and Maclaurin).
    slope = 2 / np.sin(2 * np.radians(image.roll))
    error = (image.resolution / 15) ** 2 * slope / 3 if isinstance(image, LineImage) else 0.0
    assert moved.fraction.sum(axis=1).max() < 1 + error + 1e-9


@pytest.mark.parametrize("image", sights(), ids=["lines", "pixels"])
def test_packed_extent_round_trips_bit_for_bit(image):
    plain = range_extent(image, slant_range=1e5)
    for extent in (plain, plain.mirrored(), no_return(250.0, 1.0)):
        packed = extent.packed()
        back = vars(RangeExtent.unpacked(**packed))
        for name, value in vars(extent).items():
            assert np.asarray(back[name]).tobytes() == np.asarray(value).tobytes(), name
            assert np.shape(back[name]) == np.shape(value), name
        filled = (extent.fraction > 0).any(axis=0).nonzero()[0]
        assert packed["fraction"].shape[1] == (np.ptp(filled) + 1 if filled.size else 0)


def test_mirrored_extent_equals_extent_of_mirrored_box():
    plain, mirrored = (
        trimesh.creation.box(bounds=[[-1, left, 0], [1, left + 11, 7]]) for left in (-3, -8)
    )
    there, back = (
        range_extent(
            line_image(box, aspect=0.0, depression=0.0, roll=0.0),
            slant_range=1e5,
            shift=(right, 0.2),
        )
        for box, right in ((plain, 0.3), (mirrored, -0.3))
    )
    turned = there.mirrored()
    assert turned.shift == back.shift == (-0.3, 0.2)
    np.testing.assert_array_equal(turned.cell, back.cell)
    np.testing.assert_allclose(turned.fraction, back.fraction, atol=1e-12)
    assert turned.mirrored().shift == there.shift


@pytest.mark.parametrize("spread", [0.25, 0.5, 1.0])
def test_spread_sets_the_range_covered_by_each_row(spread):
    """The outermost rows of a deck, 0.25 m high, reach half a spread row beyond their middles."""
    slope = 1 / np.tan(np.radians(3.84))
    deck = plane(width=20, height=3, slope=(0.0, slope), roll=0.0)
    fine = {"slant_range": 1e8, "ifov": 150e-9, "bin_width": 0.05, "window": 100.0}
    extent = range_extent(deck, spread=spread, **fine)
    occupied = extent.down_range[extent.fraction.sum(axis=0) > 0]
    outermost = deck.cross_range()[1][deck.hit].max()
    end = slope * (outermost + spread * deck.pixel / 2)
    np.testing.assert_allclose([occupied.min(), occupied.max()], [-end, end], rtol=0, atol=0.05)


def test_lambertian_return_scales_with_cosine_of_incidence():
    image = plane(width=20, height=20, slope=(0.75, 1.0))
    bright = range_extent(image, slant_range=1e5)
    dim = range_extent(image, slant_range=1e5, reflectance="lambertian")
    np.testing.assert_allclose(
        dim.fraction, bright.fraction / np.sqrt(1 + 0.75**2 + 1), rtol=1e-6, atol=1e-12
    )


def test_an_image_of_another_range_is_refused():
    with pytest.raises(ValueError, match="4000"):
        range_extent(plane(width=9, height=9, slant_range=4e3), slant_range=5e3)


@pytest.mark.parametrize(
    ("ship", "aspect", "slant_range", "error"),
    [("texas", 20.3, 1e3, 0.088), ("texas", 20.3, 25e3, 0.0035), ("duncan", 90.0, 4e3, 0.0038)],
)
def test_far_field_error_bound_holds_at_any_range(ship, aspect, slant_range, error):
    """Errors come from lines at the range itself; abeam, the ends across turn by s / R."""
    view, mesh = {"aspect": aspect, "depression": 3.84}, ncti.ships.load(ship)
    binning = {"slant_range": slant_range, "ifov": 1e3 / slant_range}
    approximate, exact = (
        range_extent(line_image(mesh, spacing=0.125, slant_range=drawn, **view), **binning)
        for drawn in (None, slant_range)
    )
    assert exact.far_field_error == 0
    truth = extent_errors(approximate, exact, pulse_width=30e-9)["profile_error"]
    assert truth == pytest.approx(error, rel=0.05)
    assert truth < approximate.error_after(30e-9) < 2 * truth
    assert exact.error_after(30e-9) < truth / 2
    pixels = range_extent(range_image(mesh, pixel=0.25, engine="embree", **view), **binning)
    assert pixels.far_field_error == pytest.approx(approximate.far_field_error, rel=0.02)


def test_errors_are_relative_to_the_exact_sum():
    exact = replace(no_return(20.0, 1.0), fraction=np.eye(20)[9:11], cell=np.eye(2, dtype=int))
    half = replace(exact, fraction=exact.fraction[:1], cell=exact.cell[:1])
    swapped = replace(exact, fraction=exact.fraction[::-1])
    of_half = extent_errors(half, exact, pulse_width=30e-9)
    assert of_half["extent_error"] == of_half["ifov_error"] == 0.5
    of_swapped = extent_errors(swapped, exact, pulse_width=30e-9)
    assert (
        of_swapped["extent_error"] == of_swapped["profile_error"] == 0
        and of_swapped["ifov_error"] == 2
    )

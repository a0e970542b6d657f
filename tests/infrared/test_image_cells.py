"""Compiled loops over points and pixels give what plain arrays give, bit for bit."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from ncti.infrared import coverage_of
from ncti.infrared.cells import bounding_box, places_of_bits
from ncti.infrared.scene import HALO, _draw
from ncti.render.image import Lattice

LENGTHS = st.floats(-200, 200)
SMALL_MASKS = arrays.arrays(
    bool, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.booleans()
)


@settings(deadline=None)
@given(
    st.lists(st.tuples(LENGTHS, LENGTHS), min_size=1, max_size=200),
    st.floats(0.5, 60),
    st.tuples(st.floats(0, 0.99), st.floats(0, 0.99)),
    st.integers(1, 4),
)
def test_coverage_counts_every_point_where_it_is(points, footprint, phase, cells):
    across, up = np.array(points).T
    found = coverage_of(across, up, area=2.0, footprint=footprint, phase=phase, subdivision=cells)
    plain = np.zeros(found.coverage.shape)
    at = []
    for line, part, size in zip((up, across), phase[::-1], plain.shape, strict=True):
        first = np.floor((line * (1 / footprint) + part).min()).astype(int) - 4
        cell = np.floor((line * (1 / footprint) + part) * cells).astype(int) - first * cells
        assert (cell < size).all()
        at.append(cell)
    np.add.at(plain, tuple(at), 1.0)
    np.testing.assert_array_equal(found.coverage, plain * (2.0 / (footprint / cells) ** 2))


@settings(deadline=None)
@given(
    SMALL_MASKS,
    st.floats(0.01, 10),
    st.tuples(LENGTHS, LENGTHS),
    st.sampled_from([0.0, 31.72, -31.72, 90.0]),
)
def test_places_of_bits_are_those_of_the_lattice(hit, pixel, corner, roll):
    lattice = Lattice(pixel, corner, roll)
    found = places_of_bits(np.packbits(hit), hit.shape[1], pixel, corner, lattice.turn)
    np.testing.assert_array_equal(found, lattice.cross_range_at(*np.nonzero(hit)))


@given(SMALL_MASKS)
def test_the_box_holds_the_ship_closely(mask):
    top, bottom, left, right = bounding_box(mask)
    rest = mask.copy()
    rest[top:bottom, left:right] = False
    assert not rest.any()
    if mask.any():
        part = mask[top:bottom, left:right]
        assert part[0].any() and part[-1].any() and part[:, 0].any() and part[:, -1].any()
    else:
        assert (top, bottom, left, right) == (0, 0, 0, 0)


@settings(deadline=None)
@given(SMALL_MASKS, st.integers(0, 6), st.integers(1, 3), st.integers(0, 5))
def test_normals_are_drawn_in_the_order_told(mask, rim, count, wider):
    """The ship's box, then the rest of the window, then the rest of the rim, each row by row."""
    target = np.pad(mask, wider)
    found = _draw(target, count, rim, np.random.default_rng(3))
    rng = np.random.default_rng(3)
    row, column = np.indices(found.shape[1:]) - rim
    box = np.zeros(found.shape[1:], bool)
    if target.any():
        (rows, columns) = np.nonzero(target)
        first, last = rows.min() - HALO, rows.max() + HALO
        left, right = columns.min() - HALO, columns.max() + HALO
        drawn = rng.standard_normal((count, last - first + 1, right - left + 1))
        box = (first <= row) & (row <= last) & (left <= column) & (column <= right)
        of_box = drawn[:, row[box] - first, column[box] - left]
        np.testing.assert_array_equal(found[:, box], of_box)
    inside = (row >= 0) & (row < target.shape[0]) & (column >= 0) & (column < target.shape[1])
    for part in (inside & ~box, ~inside & ~box):
        wanted = rng.standard_normal((count, np.count_nonzero(part)))
        np.testing.assert_array_equal(found[:, part], wanted)

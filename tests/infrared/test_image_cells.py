"""Compiled loops over points and pixels agree with plain arrays bit for bit."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from ncti.infrared import coverage_of

LENGTHS = st.floats(-200, 200)


@settings(deadline=None)
@given(
    st.lists(st.tuples(LENGTHS, LENGTHS), min_size=1, max_size=200),
    st.floats(0.5, 60),
    st.tuples(st.floats(0, 0.99), st.floats(0, 0.99)),
    st.integers(1, 4),
)
def test_coverage_counts_every_point_where_it_is(points, footprint, phase, cells):
    across, up = np.array(points).T
    counted = coverage_of(across, up, area=2.0, footprint=footprint, phase=phase, subdivision=cells)
    plain = np.zeros(counted.coverage.shape)
    index = []
    for line, fraction, size in zip((up, across), phase[::-1], plain.shape, strict=True):
        first = np.floor((line * (1 / footprint) + fraction).min()).astype(int) - 4
        cell = np.floor((line * (1 / footprint) + fraction) * cells).astype(int) - first * cells
        assert (cell < size).all()
        index.append(cell)
    np.add.at(plain, tuple(index), 1.0)
    np.testing.assert_array_equal(counted.coverage, plain * (2.0 / (footprint / cells) ** 2))

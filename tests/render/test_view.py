"""Axes and lattice of a view agree with their definitions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ncti.render.view import Lattice, View

angles = st.floats(-180, 180)
depressions = st.floats(0, 90)
distances = st.none() | st.floats(3, 9).map(lambda exponent: 10**exponent)
views = st.builds(View, angles, depressions, angles, distances)


def points_of(seed, count=50):
    return np.random.default_rng(seed).uniform(-90, 90, (3, count))


@given(views)
def test_axes_are_orthonormal_and_left_handed_like_opengl(view):
    assert np.allclose(view.axes @ view.axes.T, np.eye(3), rtol=0, atol=1e-15)
    column, row, away = view.axes
    assert np.allclose(np.cross(column, row), -away, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("aspect", "nearest"), [(0, (1, 0, 0)), (90, (0, 1, 0)), (180, (-1, 0, 0)), (270, (0, -1, 0))]
)
def test_aspect_is_zero_at_the_bow_and_grows_to_port(aspect, nearest):
    away = View(aspect, depression=0).axes[2]
    assert np.allclose(away, -np.array(nearest), atol=1e-15)


@given(views, st.integers(0, 10), st.floats(0.05, 5))
def test_lattice_fits_the_points_to_within_one_pixel(view, seed, pixel):
    points = points_of(seed)
    lattice = Lattice.around(points, view, pixel)
    projected = points[:2] / (1 + view.curvature * points[2])
    first = np.array(lattice.origin) - pixel / 2
    last = first + pixel * np.array([lattice.columns, lattice.rows])
    slack = 1e-9
    assert np.all(first <= projected.min(axis=1) + slack)
    assert np.all(projected.min(axis=1) < first + pixel + slack)
    assert np.all(last >= projected.max(axis=1) - slack)
    assert np.all(projected.max(axis=1) > last - pixel - slack)
    assert lattice.near < points[2].min()
    assert lattice.far > points[2].max()

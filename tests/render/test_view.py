"""Axes, lattice and clip matrix of a view agree with their definitions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ncti.render.view import Lattice, View, clip_matrix

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
def test_lattice_covers_the_points_with_less_than_a_pixel_to_spare(view, seed, pixel):
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


@given(views, st.integers(0, 10))
def test_clip_matrix_is_the_pinhole_camera(view, seed):
    """It agrees with explicit division by the distance along the line of sight."""
    points = points_of(seed)
    centre = np.array([3.0, -1.0, 5.0])
    lattice = Lattice.around(points, view, 0.25)
    vertices = view.axes.T @ points - centre[:, None]
    clip = clip_matrix(view, lattice, centre=centre) @ np.vstack([vertices, np.ones(50)])
    x, y, z = clip[:3] / clip[3]

    h, v, r = points
    scale = 1.0 if view.slant_range is None else view.slant_range / (view.slant_range + r)
    pixels = [(x + 1) / 2 * lattice.columns - 0.5, (y + 1) / 2 * lattice.rows - 0.5]
    expected = [
        (h * scale - lattice.origin[0]) / lattice.pixel,
        (v * scale - lattice.origin[1]) / lattice.pixel,
    ]
    assert np.allclose(pixels, expected, rtol=0, atol=1e-9)
    assert np.all(np.abs(z) < 1)
    assert np.all(np.diff(z[np.argsort(r)]) > 0)


@pytest.mark.parametrize("slant_range", [None, 4e3, 1e5, 1e9])
def test_float32_moves_a_vertex_by_less_than_a_snap_of_the_rasteriser(slant_range):
    """Rounding to float32 must stay below the 1/256 pixel that rasterisers snap to."""
    view = View(33.0, 4.0, slant_range=slant_range)
    points = points_of(0, 1000)
    lattice = Lattice.around(points, view, 0.25)
    exact = clip_matrix(view, lattice, centre=np.zeros(3))
    vertices = np.vstack([view.axes.T @ points, np.ones(1000)])
    sent = exact.astype(np.float32) @ vertices.astype(np.float32)
    size = np.array([[lattice.columns], [lattice.rows]])
    moved = ((exact @ vertices)[:2] / (exact @ vertices)[3] - sent[:2] / sent[3]) * size / 2
    assert np.abs(moved).max() < 1 / 512

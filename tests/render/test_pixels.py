"""Skipped facets and rays do not change an image, and its surface agrees with plain arrays."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from ncti import ships
from ncti.render import available_engines, pixels
from ncti.render.choice import start_engine
from ncti.render.solid import (
    MIN_COSINE,
    STEEP_COSINE,
    Solid,
    covered_columns,
    sampled_facets,
    surface,
)
from ncti.render.view import Lattice, View, clip_matrix

VIEWS = [(0.0, 3.84, None, 0.25), (33.3, 11.0, 4e3, 0.6), (90.0, 0.0, None, 0.25)]
Long = np.longdouble


def looked_at(mesh, aspect, depression, slant_range, pixel):
    solid, view = Solid.of(mesh), View(aspect, depression, slant_range=slant_range)
    points = solid.view_coordinates(view)
    return solid, view, Lattice.around(points, view, pixel), points


def corners(seen, faces):
    """Return x and y of the facets' corners, (2, facet, 3)."""
    return np.moveaxis(seen[faces], 2, 0)


def sides(x, y):
    return np.roll(x, -1, axis=1) - x, np.roll(y, -1, axis=1) - y


def triangles(seed, size):
    """Return random facets of any orientation, some of zero width or with corners on the grid."""
    rng = np.random.default_rng(seed)
    places = rng.normal(size=(60, 2)) * size
    places[:20] = np.round(4 * places[:20]) / 4
    places[20:30, 1] = places[20, 1]
    places[30] = places[31] + [0.0, 1e-12]
    return places, rng.integers(0, 60, (80, 3)).astype(np.int32)


@settings(max_examples=30)
@given(st.integers(0, 2**32), st.floats(-1.5, 1.2), st.floats(-4, -1))
def test_facets_left_out_have_no_centre_however_vertices_move(seed, size, margin):
    """Even with vertices moved by the margin, no skipped facet covers a pixel centre."""
    places, faces = triangles(seed, 10**size)
    margin = 10**margin
    chosen = pixels.sampled_facets(places, faces, margin)
    assert (np.diff(chosen) > 0).all()
    out = np.setdiff1d(np.arange(len(faces)), chosen)
    reach = int(np.abs(places).max() + 2)
    centre = np.arange(-reach, reach + 1.0)
    at_x, at_y = (axis.ravel() for axis in np.meshgrid(centre, centre))
    rng = np.random.default_rng(seed)
    for _ in range(8):
        # The corners of the square are the worst case.
        off = rng.choice([-1.0, 1.0, rng.uniform(-1, 1)], places.shape) * margin * (1 - 1e-9)
        x, y = corners(places + off, faces[out])
        run, rise = sides(x, y)
        inside = [
            run[:, i, None] * (at_y - y[:, i, None]) > rise[:, i, None] * (at_x - x[:, i, None])
            for i in range(3)
        ]
        assert not np.all(inside, axis=0).any()


@pytest.mark.skipif("osmesa" not in available_engines(), reason="no osmesa library here")
@pytest.mark.parametrize("view", VIEWS, ids=str)
@pytest.mark.parametrize("name", ships.names())
def test_what_is_left_out_would_not_be_seen(name, view):
    """At most a third of the facets gives the same image bit for bit as all facets."""
    solid, view, lattice, points = looked_at(ships.load(name), *view)
    engine = start_engine("osmesa")
    clip = clip_matrix(view, lattice, centre=solid.centre)
    all_facets = np.arange(len(solid.faces), dtype=np.int32)
    few = sampled_facets(solid, view, lattice, points)
    images = [
        engine._thread.submit(engine._canvas.draw, solid, facets, clip, lattice.shape).result()
        for facets in (all_facets, few)
    ]
    assert np.array_equal(*images)
    assert (images[0] >= 0).sum() > 1000
    assert len(few) < len(all_facets) / 3


def every_ray(solid, view, lattice):
    """Return the first facet behind every pixel, with a ray for each."""
    column, row, away = view.axes
    h = lattice.origin[0] + lattice.pixel * np.arange(lattice.columns)
    v = lattice.origin[1] + lattice.pixel * np.arange(lattice.rows)
    across = h[:, None] * column + (v[:, None] * row)[:, None, :]
    start = (1.0 + view.curvature * lattice.near) * across
    start += lattice.near * away - solid.centre
    direction = view.curvature * across + away
    return start_engine("embree").cast(
        solid,
        start.astype(np.float32).reshape(-1, 3),
        direction.astype(np.float32).reshape(-1, 3),
    )


@pytest.mark.parametrize("name", ships.names()[:3])
@pytest.mark.parametrize("view", VIEWS, ids=str)
def test_rays_left_out_would_miss(name, view):
    """Rays within each row's span give the same image as a ray for every pixel.

    This also holds for an open ship, whose facets are seen from behind.
    """
    mesh = ships.load(name)
    broken = trimesh.Trimesh(mesh.vertices, mesh.faces[::3], process=False)
    for ship in (mesh, broken):
        solid, seen_from, lattice, points = looked_at(ship, *view)
        expected = every_ray(solid, seen_from, lattice)
        facets = start_engine("embree").visible(solid, seen_from, lattice, points)
        assert np.array_equal(facets, expected)
        first, stop = covered_columns(solid, seen_from, lattice, points).T
        assert (stop - first).sum() < 0.65 * lattice.rows * lattice.columns


@pytest.mark.parametrize("slant_range", [None, 900.0, 1e5, 1e9])
@pytest.mark.parametrize("kind", [np.float32, np.int32])
def test_surface_is_that_of_plain_arrays(slant_range, kind):
    """Range and slope of every hit agree with the formulae in long doubles within rounding.

    The numerator of r = (s - c) / a is rounded some eight times at the size of the ship, and the
    curvature changes it by the ship's size over the slant range: 16 roundings of 100 m over a.
    """
    solid, view, lattice, points = looked_at(ships.load("duncan"), 17.0, 6.0, slant_range, 0.5)
    facet = start_engine("embree").visible(solid, view, lattice, points)
    down_range, gradient = surface(solid, view, lattice, points, facet.astype(kind))
    hit = np.flatnonzero(facet >= 0)
    assert np.array_equal(np.flatnonzero(~np.isnan(down_range)), hit)
    assert np.array_equal(~np.isnan(gradient).any(axis=2), facet.reshape(lattice.shape) >= 0)

    k, chosen = Long(view.curvature), facet[hit]
    n_h, n_v, n_r = view.axes.astype(Long) @ solid.normals[chosen].astype(Long).T
    row, column = np.divmod(hit, lattice.columns)
    h, v = (
        ((place + (first + 0.5)) * lattice.pixel).astype(Long)
        for place, first in ((column, lattice.first_column), (row, lattice.first_row))
    )
    s = n_h * h + n_v * v
    a = np.maximum(-(n_r + k * s), Long(MIN_COSINE))
    r = (s - solid.offsets[chosen]) / a
    away = points[2, solid.faces[chosen]]
    r = np.where(a < STEEP_COSINE, np.clip(r, away.min(axis=1), away.max(axis=1)), r)
    w, t = 1 + k * r, np.sqrt(1 + k**2 * (h**2 + v**2))
    expected = r + k * w * (h**2 + v**2) / (1 + t)
    slope = np.stack([t * w * n_h / a + k * w * h / t, t * w * n_v / a + k * w * v / t], axis=1)
    assert (a < STEEP_COSINE).sum() > 10 and len(hit) > 1000
    rounding = 16 * np.finfo(float).eps * 100 / a
    assert (np.abs(down_range.ravel()[hit] - expected) <= rounding).all()
    error = np.abs(gradient.reshape(-1, 2)[hit] - slope)
    assert (error <= np.finfo(np.float32).eps * np.abs(slope) + (rounding / a)[:, None]).all()

"""Skipped facets and rays do not change an image."""

import numpy as np
import pytest
import trimesh

from ncti import ships
from ncti.render import available_engines
from ncti.render.choice import start_engine
from ncti.render.solid import Solid, covered_columns, sampled_facets
from ncti.render.view import Lattice, View, clip_matrix

VIEWS = [(0.0, 3.84, None, 0.25), (33.3, 11.0, 4e3, 0.6), (90.0, 0.0, None, 0.25)]


def looked_at(mesh, aspect, depression, slant_range, pixel):
    solid, view = Solid.of(mesh), View(aspect, depression, slant_range=slant_range)
    points = solid.view_coordinates(view)
    return solid, view, Lattice.around(points, view, pixel), points


@pytest.mark.skipif("osmesa" not in available_engines(), reason="no osmesa library here")
@pytest.mark.parametrize("view", VIEWS, ids=str)
@pytest.mark.parametrize("name", ships.names())
def test_skipped_facets_do_not_change_the_image(name, view):
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
def test_skipped_rays_do_not_change_the_image(name, view):
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

"""The sampling-free reference agrees with closed forms and boolean unions.

`test_extent_of_ships.py` compares it with views of ships by other methods.
"""

from __future__ import annotations

import closed_forms
import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from studies.run_time.reference import reference_range_extent

EDGES = np.arange(-100.0, 101.0)

# The clipper works on a grid of 1e-8 m, each bin within outlines of some 100 m; twice for the
# difference of two unions.
GRID_AREA = 1e-8 * 100.0 * 2.0


def rectangle(left, right, bottom, top, away, slope=(0.0, 0.0), **view) -> trimesh.Trimesh:
    """Return a plate by its coordinates to the right and up, seen counter-clockwise."""
    corners = [(left, bottom), (right, bottom), (right, top), (left, top)]
    places = np.array([(h, v, away + slope[0] * h + slope[1] * v) for h, v in corners])
    axes = closed_forms.axes_of(**view)
    return trimesh.Trimesh(places @ axes, [(0, 1, 2), (0, 2, 3)], process=False)


VIEW = {"aspect": 33.0, "depression": 12.0}


@pytest.mark.parametrize("aspect", [0.0, 17.3, 45.0, 90.0, 211.0])
@pytest.mark.parametrize("depression", [0.0, 3.84, 37.0, 90.0])
def test_box(aspect, depression):
    extents, centre = (120.0, 14.0, 9.0), (3.1, -1.2, 4.3)
    mesh = trimesh.creation.box(extents)
    mesh.apply_translation(centre)
    expected = closed_forms.box(extents, centre, aspect=aspect, depression=depression, edges=EDGES)
    extent = reference_range_extent(mesh, aspect=aspect, depression=depression, bin_edges=EDGES)
    np.testing.assert_allclose(extent.area[0], expected, rtol=0.0, atol=GRID_AREA)


@pytest.mark.parametrize("slope", [(0.0, 0.0), (2.7, 0.0), (-1.3, 0.4), (15.0, -0.2)])
def test_tilted_plate_matches_closed_form_in_every_cell(slope):
    """A plate's range grows linearly over it, so a bin is a strip and a cell cuts it short."""
    plate = rectangle(-4.0, 3.0, -2.0, 1.0, 0.3, slope, **VIEW)
    extent = reference_range_extent(plate, **VIEW, bin_edges=EDGES, side=2.5)
    for cell, area in zip(extent.cell, extent.area, strict=True):
        (left, bottom), (right, top) = cell * 2.5, (cell + 1) * 2.5
        left, right = max(left, -4.0), min(right, 3.0)
        bottom, top = max(bottom, -2.0), min(top, 1.0)
        spans = np.abs(slope) * [right - left, top - bottom]
        middle = 0.3 + 0.5 * (slope[0] * (left + right) + slope[1] * (bottom + top))
        expected = closed_forms.parallelogram(
            middle - spans.sum() / 2, *spans, (right - left) * (top - bottom), EDGES
        )
        np.testing.assert_allclose(area, expected, rtol=0.0, atol=GRID_AREA)
    assert len(extent.cell) == 4 * 2
    assert extent.area.sum() == pytest.approx(21.0, abs=GRID_AREA)


@pytest.mark.parametrize("slant_range", [None, 1e3, 100.0])
def test_icosphere_converges_quadratically_to_sphere(slant_range):
    """Facets of side h lie h^2 below a sphere, so halving h quarters the error."""
    edges = np.arange(-11.0, 2.0)
    expected = closed_forms.sphere(10.0, edges, slant_range or np.inf)
    errors = []
    for subdivisions in (3, 4, 5):
        mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=10.0)
        extent = reference_range_extent(mesh, **VIEW, bin_edges=edges, slant_range=slant_range)
        errors.append(np.abs(extent.area[0] - expected).sum())
    ratios = np.divide(errors[:-1], errors[1:])
    assert np.all((ratios > 3.5) & (ratios < 4.5)), ratios


@pytest.mark.parametrize(("aspect", "depression"), [(20.0, 5.0), (90.0, 90.0), (140.0, 40.0)])
@pytest.mark.parametrize("slant_range", [300.0, 3e3])
def test_outline_of_a_box_at_a_finite_range(aspect, depression, slant_range):
    """A convex solid's outline is the hull of its corners projected through the pinhole."""
    mesh = trimesh.creation.box((60.0, 14.0, 9.0))
    h, v, r = closed_forms.axes_of(aspect, depression) @ mesh.vertices.T
    corners = np.stack([h, v], axis=1) / (1.0 + r[:, None] / slant_range)
    extent = reference_range_extent(
        mesh, aspect=aspect, depression=depression, bin_edges=EDGES, slant_range=slant_range
    )
    assert extent.area.sum() == pytest.approx(ConvexHull(corners).volume, abs=GRID_AREA)


@pytest.mark.parametrize(("slant_range", "width"), [(31e3, 0.003), (1e3, 0.05)])
def test_perpendicular_plate_is_binned_into_rings(slant_range, width):
    """Range grows by s^2 / 2R with the distance s from the middle, so bins are rings."""
    plate = rectangle(-30.0, 30.0, -30.0, 30.0, 0.0, **VIEW)
    edges = width * (np.arange(30) - 0.37)
    radius = np.sqrt(np.maximum((slant_range + edges) ** 2 - slant_range**2, 0.0))
    disc = np.pi * radius**2
    edges, disc = edges[radius < 30.0], disc[radius < 30.0]
    bins = np.append(edges, 2.0)
    area = reference_range_extent(plate, **VIEW, bin_edges=bins, slant_range=slant_range).area[0]
    expected = np.diff(disc, append=3600.0)
    assert np.abs(area - expected).sum() <= 1e-5 * 3600.0


def boxes_at_odds() -> list[trimesh.Trimesh]:
    rng = np.random.default_rng(5)
    solids = []
    for _ in range(12):
        turn = trimesh.transformations.random_rotation_matrix(rng.random(3))
        turn[:3, 3] = rng.uniform(-12.0, 12.0, 3)
        solids.append(trimesh.creation.box(rng.uniform(2.0, 15.0, 3), turn))
    return solids


@pytest.mark.parametrize("aspect", [10.0, 123.0])
def test_solids_that_intersect_look_like_their_union(aspect):
    """A pile of boxes and its boolean union share no facet, but have equal extents."""
    solids = boxes_at_odds()
    view = {"aspect": aspect, "depression": 20.0, "bin_edges": EDGES, "side": 5.0}
    pile = reference_range_extent(trimesh.util.concatenate(solids), **view)
    union = reference_range_extent(trimesh.boolean.union(solids, engine="manifold"), **view)
    visible = union.area.sum(axis=1) > GRID_AREA
    np.testing.assert_array_equal(pile.cell[pile.area.sum(axis=1) > GRID_AREA], union.cell[visible])
    # The union's vertices are themselves rounded, to 1e-6 of its size at worst.
    np.testing.assert_allclose(
        pile.area[pile.area.sum(axis=1) > GRID_AREA], union.area[visible], rtol=0.0, atol=1e-4
    )

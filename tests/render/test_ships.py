"""The six ships: OpenGL against ray casting, and both against rays of trimesh's own."""

import numpy as np
import pytest

from ncti import ships
from ncti.render import range_image
from ncti.render.choice import choose_engine
from ncti.render.view import View

OPENGL = choose_engine("auto")
VIEWS = [
    {"aspect": 1.7, "depression": 3.39},
    {"aspect": 37.3, "depression": 3.84, "slant_range": 1e5},
    {"aspect": 91.1, "depression": 0.3},
    {"aspect": 143.9, "depression": 15.6, "slant_range": 4e3},
    {"aspect": 201.3, "depression": 47.0, "slant_range": 1e9},
    {"aspect": 309.0, "depression": 83.3},
]


@pytest.fixture(scope="module", params=ships.names())
def ship(request):
    return ships.load(request.param)


@pytest.mark.skipif(OPENGL == "embree", reason="no OpenGL library here")
@pytest.mark.parametrize("view", VIEWS, ids=str)
def test_engines_agree(ship, view):
    """Required: median 0.1 mm, and 0.1 % of the pixels off by 1 cm, or not hit by both."""
    drawn, cast = (range_image(ship, engine=engine, **view) for engine in (OPENGL, "embree"))
    both = drawn.hit & cast.hit
    difference = np.abs(drawn.down_range - cast.down_range)[both]
    assert np.median(difference) <= 1e-4
    assert (difference > 0.01).mean() <= 1e-3
    assert (drawn.hit != cast.hit).sum() <= 1e-3 * both.sum()
    slopes = np.abs(drawn.gradient - cast.gradient)[both].max(axis=-1)
    # Of a pixel between two facets of one surface either may be told: at grazing incidence several
    # facets share a pixel, each with borders that snap to its 1/256.
    assert (slopes > 1e-3).mean() <= 0.01


@pytest.mark.parametrize("view", [VIEWS[1], VIEWS[3]], ids=str)
def test_distances_are_those_of_rays(ship, view):
    """Hit points that trimesh finds along the same lines of sight, with neither our matrices nor
    our planes: its float32 leaves some tens of micrometres on a ship of 100 m."""
    image = range_image(ship, engine=OPENGL, pixel=0.5, **view)
    right, up, away = View(view["aspect"], view["depression"], roll=0).axes
    horizontal, vertical = (c[image.hit][:, None] for c in image.cross_range())
    sensor = -image.slant_range * away
    directions = horizontal * right + vertical * up - sensor
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    before = image.slant_range - 150
    points, rays, facets = ship.ray.intersects_location(
        sensor + before * directions, directions, multiple_hits=False
    )
    assert len(rays) >= 0.999 * image.hit.sum()
    distance = np.linalg.norm(points - sensor, axis=1) - image.slant_range
    difference = np.abs(image.down_range[image.hit][rays] - distance)
    assert np.median(difference) <= 1e-4
    assert (difference > 0.01).mean() <= 5e-3
    # The gradient, from the facet's normal: distance along d to a plane is (n.p) / (n.d).
    gradient = image.gradient[image.hit][rays]
    column, row, _ = View(view["aspect"], view["depression"]).axes
    d, normal = directions[rays], ship.face_normals[facets]
    reach = np.linalg.norm(horizontal * right + vertical * up - sensor, axis=1)[rays]
    for component, axis in ((0, column), (1, row)):
        turned = axis - d * (d @ axis)[:, None]
        slope = -(distance + image.slant_range) / reach
        slope *= (normal * turned).sum(axis=1) / (normal * d).sum(axis=1)
        error = np.abs(gradient[:, component] - slope)
        assert (error > 1e-4 * (1 + np.abs(slope))).mean() <= 0.01

"""Cast rays find the right facets, at exact distances from far away."""

import numpy as np
import pytest
import trimesh
from traced_box import lines_of_sight, trace

from ncti.render import cast_rays
from ncti.render.view import View

HIGH = np.array([30.0, 4.5, 2.5])


@pytest.mark.parametrize("distance", [3e3, 1e5])
@pytest.mark.parametrize("angles", [(3.0, 6.7), (37.3, 3.39), (91.1, 20.0), (175.0, 6.7)])
def test_distances_are_exact_at_any_range(distance, angles):
    """Unit vectors rounded to 1e-16 per component meet a plane within 3 R 1e-16 / cosine.

    Embree's own float32 distance would be off by millimetres at 100 km. It places edges within
    float32 rounding of the ship, so a ray in a few hundred may meet another side.
    """
    view = View(*angles, slant_range=distance)
    across = np.random.default_rng(0).uniform(-25, 25, (2, 4000))
    expected, side = trace(view, *across, low=-HIGH, high=HIGH)
    start, direction, offset = lines_of_sight(view, *across)
    direction = direction.astype(float)
    hits = cast_rays(trimesh.creation.box(2 * HIGH), start.astype(float), direction)
    met = np.flatnonzero(~np.isnan(expected))
    assert len(np.setxor1d(hits.ray, met)) < 10 and len(met) > 200
    cosine = np.abs(direction)[hits.ray, side[hits.ray]]
    wrong = np.abs(hits.distance + offset - expected[hits.ray]).astype(float)
    exact = wrong <= 4 * np.finfo(float).eps * distance / cosine
    assert (~exact).sum() < 10 and wrong[~exact].max(initial=0) < 1e-3
    np.testing.assert_allclose(hits.cosine[exact], cosine[exact], rtol=0, atol=1e-14)


def test_rays_ignore_surfaces_behind_their_origin():
    """From between two walls each direction shows the one ahead."""
    walls = [trimesh.creation.box((1, 9, 5)).apply_translation((x, 0, 0)) for x in (-20, 20)]
    mesh = trimesh.util.concatenate(walls)
    direction = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0]])
    hits = cast_rays(mesh, np.tile([12.0, 0.5, 0.5], (3, 1)), direction)
    np.testing.assert_array_equal(hits.ray, [0, 1])
    np.testing.assert_allclose(hits.distance, [7.5, 31.5], rtol=1e-14)

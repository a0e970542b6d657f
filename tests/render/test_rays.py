"""Cast rays find the right facets, at exact distances from far away."""

import numpy as np
import pytest
import trimesh
from traced_box import Long, axes

from ncti.render import cast_rays

SHAPE = (60.0, 9.0, 5.0)
LOW, HIGH = -np.array(SHAPE) / 2, np.array(SHAPE) / 2


@pytest.fixture(scope="module")
def box():
    return trimesh.creation.box(SHAPE)


def sightlines(aspect, depression, distance, *, count, spread, seed=0):
    """Return rays from one place to points about the origin, as float64 unit vectors."""
    rng = np.random.default_rng(seed)
    right, up, towards = axes(aspect, depression)
    place = (distance * towards).astype(float)
    across = rng.uniform(-spread, spread, (2, count, 1))
    target = (across[0] * right + across[1] * up).astype(float)
    direction = target - place
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return np.broadcast_to(place, direction.shape), direction


def slabs(start, direction):
    """Return the distances at which rays enter and leave the box, and the axis of entry."""
    start, direction = start.astype(Long), direction.astype(Long)
    with np.errstate(divide="ignore"):
        cuts = np.stack([(side - start) / direction for side in (LOW, HIGH)])
    enter, leave = cuts.min(axis=0), cuts.max(axis=0)
    return enter.max(axis=1), leave.min(axis=1), enter.argmax(axis=1)


@pytest.mark.parametrize("distance", [3e3, 1e5])
@pytest.mark.parametrize("view", [(3.0, 6.7), (37.3, 3.39), (91.1, 20.0), (175.0, 6.7)])
def test_distances_are_exact_at_any_range(box, distance, view):
    """Unit vectors rounded to 1e-16 per component meet a plane within 3 R 1e-16 / cosine.

    Embree's own float32 distance would be off by millimetres at 100 km. Near misses below the
    float32 resolution of the ship, 60 m in 2^23, may hit and are left out.
    """
    start, direction = sightlines(*view, distance, count=4000, spread=25)
    enter, leave, side = slabs(start, direction)
    through = leave - enter
    hits = cast_rays(box, start, direction)
    hit = np.zeros(len(start), bool)
    hit[hits.ray] = True
    clear = np.abs(through) > 1e-3
    assert clear.sum() > 200 and clear.mean() > 0.99
    np.testing.assert_array_equal(hit[clear], through[clear] > 0)
    known = clear[hits.ray]
    cosine = np.abs(direction)[hits.ray, side[hits.ray]]
    off = np.abs(hits.distance - enter[hits.ray])
    # At an edge two sides are equally distant within rounding, and the ray may hit either.
    inner = known & (np.sort(np.abs(_cuts(start, direction)[hits.ray]), axis=1)[:, 1] > 1e-3)
    assert inner.sum() > 200
    assert (off[inner] <= 4 * np.finfo(float).eps * distance / cosine[inner]).all()
    assert off[known].max() < 1e-3  # an edge's float32 place
    np.testing.assert_allclose(hits.cosine[inner], cosine[inner], rtol=0, atol=1e-14)
    normals = np.abs(box.face_normals[hits.facet])
    assert (normals[np.arange(len(side[hits.ray]))[inner], side[hits.ray][inner]] > 0.99).all()


def _cuts(start, direction):
    """Return how much earlier than the entry a ray meets the plane of each near side."""
    with np.errstate(divide="ignore"):
        cuts = np.stack([(side - start) / direction for side in (LOW, HIGH)]).min(axis=0)
    return cuts.max(axis=1, keepdims=True) - cuts


def test_what_lies_behind_an_origin_is_not_seen():
    """From between two walls each direction shows the one ahead."""
    walls = [trimesh.creation.box((1, 9, 5)).apply_translation((x, 0, 0)) for x in (-20, 20)]
    mesh = trimesh.util.concatenate(walls)
    direction = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0]])
    hits = cast_rays(mesh, np.tile([12.0, 0.5, 0.5], (3, 1)), direction)
    np.testing.assert_array_equal(hits.ray, [0, 1])
    np.testing.assert_allclose(hits.distance, [7.5, 31.5], rtol=1e-14)

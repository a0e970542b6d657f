"""Facets that face away are invisible and let rays pass, in open and reversed meshes."""

import numpy as np
import pytest
import trimesh

from ncti.render import cast_rays, line_image, range_image

LENGTH, WIDTH, HEIGHT = 40.0, 12.0, 8.0
BELOW = np.radians(20.0)
# Places on the lattice of pixels miss a strip along an outline, half a pixel wide on average.
PIXEL = 0.1


def area(mesh, engine="embree", **view):
    image = range_image(mesh, engine=engine, pixel=PIXEL, **view)
    return np.isfinite(image.down_range).sum() * PIXEL**2


def without(mesh, *normals):
    """Return a mesh without the facets of some normals."""
    gone = np.isclose(mesh.face_normals @ np.array(normals, float).T, 1).any(axis=1)
    opened = mesh.copy()
    opened.update_faces(~gone)
    return opened


@pytest.fixture(scope="module")
def box():
    return trimesh.creation.box((LENGTH, WIDTH, HEIGHT))


@pytest.mark.parametrize("slant_range", [None, 1e5])
@pytest.mark.parametrize(
    ("gone", "seen"),
    [
        ([], WIDTH * (HEIGHT * np.cos(BELOW) + LENGTH * np.sin(BELOW))),
        # Through the open top appear the far side and the bottom, both from behind.
        ([(0, 0, 1)], WIDTH * HEIGHT * np.cos(BELOW)),
        ([(1, 0, 0)], WIDTH * LENGTH * np.sin(BELOW)),
        ([(1, 0, 0), (0, 0, 1)], 0.0),
        ([(-1, 0, 0), (0, 0, -1)], WIDTH * (HEIGHT * np.cos(BELOW) + LENGTH * np.sin(BELOW))),
    ],
)
def test_open_box_shows_only_front_faces(box, gone, seen, slant_range):
    """From the bow, 20 degrees above, areas are sums of w h cos(d) and w l sin(d)."""
    view = {"aspect": 0.0, "depression": 20.0, "slant_range": slant_range}
    mesh = without(box, *gone) if gone else box
    outline = 4 * (LENGTH + WIDTH + HEIGHT)
    assert area(mesh, **view) == pytest.approx(seen, abs=PIXEL / 4 * outline)
    lines = line_image(mesh, spacing=PIXEL, **view).area.sum()
    assert lines == pytest.approx(seen, rel=2e-3)


@pytest.mark.parametrize("seed", range(2))
def test_ray_casting_matches_brute_force_on_triangle_soups(seed):
    """Among random triangles a ray hits the nearest one that faces it."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-20, 20, (120, 1, 3)) + rng.uniform(-8, 8, (120, 3, 3))
    mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(360).reshape(-1, 3), process=False)
    direction = rng.normal(size=(400, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    origin = rng.uniform(-15, 15, (400, 3)) - 200 * direction
    hits = cast_rays(mesh, origin, direction)
    edges = np.roll(corners, -1, axis=1) - corners
    normals = np.cross(edges[:, 0], edges[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    for ray in range(400):
        cosine = -normals @ direction[ray]
        with np.errstate(all="ignore"):
            distance = np.einsum("fk,fk->f", normals, origin[ray] - corners[:, 0]) / cosine
        place = origin[ray] + distance[:, None] * direction[ray]
        inward = np.cross(normals[:, None], edges)
        clear = np.einsum("fek,fek->fe", inward, place[:, None] - corners).min(axis=1)
        met = (clear > 0) & (cosine > 0)
        distances = hits.distance[hits.ray == ray]
        if (np.abs(clear[np.abs(cosine) > 0]) < 1e-3).any() or (np.abs(cosine) < 1e-3).any():
            continue  # at a border or edge-on
        expected = distance[met].min(initial=np.inf)
        assert (distances.size == 1) == np.isfinite(expected)
        if distances.size:
            assert distances[0] == pytest.approx(expected, rel=1e-9)

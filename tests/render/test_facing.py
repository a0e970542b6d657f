"""Facets that face away are not seen, and rays pass through them: open and reversed meshes."""

import numpy as np
import pytest
import trimesh

from ncti import ships
from ncti.irar import Flight, fly, ship_heading
from ncti.render import cast_rays, line_image, range_image
from ncti.render.embree import EmbreeEngine
from ncti.render.view import View

LENGTH, WIDTH, HEIGHT = 40.0, 12.0, 8.0
BELOW = np.radians(20.0)
# Places on the lattice of pixels miss a strip along an outline, half a pixel wide on average.
PIXEL = 0.1


def area(mesh, engine="embree", **view):
    image = range_image(mesh, engine=engine, pixel=PIXEL, **view)
    return np.isfinite(image.down_range).sum() * PIXEL**2


def without(mesh, *normals):
    """A mesh without the facets of some normals."""
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
def test_an_open_box_shows_what_faces_the_sensor(box, gone, seen, slant_range):
    """From the bow, 20 degrees above: sums of w h cos(d) and w l sin(d), within the outline."""
    view = {"aspect": 0.0, "depression": 20.0, "slant_range": slant_range}
    mesh = without(box, *gone) if gone else box
    outline = 4 * (LENGTH + WIDTH + HEIGHT)
    assert area(mesh, **view) == pytest.approx(seen, abs=PIXEL / 4 * outline)
    lines = line_image(mesh, spacing=PIXEL, **view).area.sum()
    assert lines == pytest.approx(seen, rel=2e-3)


@pytest.mark.parametrize("name", ["duncan", "texas"])
def test_a_ship_with_holes_is_what_lines_and_rasters_see(name):
    """Every fifth facet is missing: images agree pixel by pixel, except at facets' borders."""
    ship = ships.load(name).copy()
    ship.update_faces(np.arange(len(ship.faces)) % 5 > 0)
    view = {"aspect": 37.0, "depression": 12.0}
    lines = line_image(ship, spacing=0.25, **view).area.sum()
    assert area(ship, **view) == pytest.approx(lines, rel=0.01)
    closed = line_image(ships.load(name), spacing=0.25, **view).area.sum()
    assert lines < 0.95 * closed  # holes show


def test_a_reversed_triangle_is_not_there():
    corners = np.array([[0.0, -5, 0], [0.0, 5, 0], [0.0, 0, 6]])
    seen, reversed_one = (trimesh.Trimesh(corners, [face]) for face in ([0, 1, 2], [0, 2, 1]))
    view = {"aspect": 0.0, "depression": 0.0}
    assert area(seen, **view) == pytest.approx(30.0, rel=0.02)
    assert area(reversed_one, **view) == 0.0


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_plate_without_thickness_is_seen_from_both_sides(order):
    """Which of two coincident facets a ray meets first is chance; that which faces it is seen."""
    corners = np.array([[0.0, -5, 0], [0.0, 5, 0], [0.0, 5, 6], [0.0, -5, 6]])
    sides = [[0, 1, 2], [0, 2, 3]], [[0, 3, 1], [1, 3, 2]]  # divided along either diagonal
    plate = trimesh.Trimesh(corners, np.concatenate([sides[k] for k in order]), process=False)
    for aspect in (0.0, 180.0, 20.0):
        view = {"aspect": aspect, "depression": 10.0}
        facing = np.cos(np.radians(10)) * abs(np.cos(np.radians(aspect)))
        assert area(plate, **view) == pytest.approx(60 * facing, rel=0.02)


def test_rays_go_on_behind_what_they_pass(box):
    """Through three walls that face away onto a fourth, at its exact distance."""
    walls = [trimesh.creation.box((1, 9, 9)).apply_translation((x, 0, 0)) for x in (0, -10, -20)]
    opened = [without(wall, (1, 0, 0)) for wall in walls]
    target = trimesh.creation.box((1, 9, 9)).apply_translation((-30, 0, 0))
    mesh = trimesh.util.concatenate([*opened, target])
    origin = np.array([[500.0, y, 1.0] for y in (-3, 0, 3, 30)])
    hits = cast_rays(mesh, origin, np.tile([-1.0, 0, 0], (4, 1)))
    np.testing.assert_array_equal(hits.ray, [0, 1, 2])
    np.testing.assert_allclose(hits.distance, 529.5, rtol=1e-14)
    np.testing.assert_array_equal(hits.cosine, 1.0)


@pytest.mark.parametrize("seed", range(4))
def test_soups_of_facets_are_seen_as_by_a_search_of_all(seed):
    """Triangles anywhere, either way round: the nearest that faces the ray, of all of them."""
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
        found = hits.distance[hits.ray == ray]
        if (np.abs(clear[np.abs(cosine) > 0]) < 1e-3).any() or (np.abs(cosine) < 1e-3).any():
            continue  # at a border or edge-on
        expected = distance[met].min(initial=np.inf)
        assert (found.size == 1) == np.isfinite(expected)
        if found.size:
            assert found[0] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("name", ships.names())
def test_closed_ships_are_drawn_by_their_first_hits(name, monkeypatch):
    """Not a bit differs from rays that stop at any facet, so that no ray is cast twice."""
    view = {"aspect": 123.0, "depression": 5.0, "pixel": 0.5, "engine": "embree"}
    ship = ships.load(name)
    found = range_image(ship, **view).down_range
    monkeypatch.setattr(EmbreeEngine, "cast", EmbreeEngine._first)
    np.testing.assert_array_equal(range_image(ship, **view).down_range, found)


def test_a_flight_sees_no_side_from_behind(box):
    """Of an open box nothing returns but what faces the aircraft: the same without the far side."""
    low = box.copy().apply_translation((0, 0, HEIGHT / 2))
    flight = Flight(
        slant_range=3e3, ship_heading=ship_heading(aspect=20, sight=5), ifov=500e-6, samples=60
    )
    away = View(20.0, flight.depression).axes[2]
    seen = [n for n in np.concatenate([np.eye(3), -np.eye(3)]) if n @ away < 0]
    hidden = [-n for n in seen]
    whole, half = (fly(mesh, flight).noiseless() for mesh in (low, without(low, *hidden)))
    np.testing.assert_array_equal(whole.intensity, half.intensity)
    assert (whole.intensity > 0).any()
    assert not (fly(without(low, *seen), flight).noiseless().intensity > 0).any()

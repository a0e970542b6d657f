"""Reading a faulty mesh either repairs each kind of fault or refuses it with a message."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import trimesh
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from manifold3d import Manifold
from shipyard import sentence, solid_of

from ncti import ships
from ncti.ships import meshes
from ncti.ships.bodies import MAX_OPEN, WELD_DISTANCE

LOOSE = 0.4 * WELD_DISTANCE  # corners of one vertex are at most twice as far apart


def block(low, high) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[low, high])


def mesh_of(solid: Manifold) -> trimesh.Trimesh:
    mesh = solid.to_mesh64()
    return trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts, process=False)


def together(*meshes: trimesh.Trimesh) -> trimesh.Trimesh:
    return trimesh.util.concatenate([mesh.copy() for mesh in meshes])


def inverted(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    mesh = mesh.copy()
    mesh.invert()
    return mesh


def opened(mesh: trimesh.Trimesh, share: float, at: tuple[float, float, float]) -> trimesh.Trimesh:
    """Return the mesh without its facets nearest to a point, up to a share of its surface."""
    order = np.argsort(np.linalg.norm(mesh.triangles_center - at, axis=1))
    gone = order[np.cumsum(mesh.area_faces[order]) <= share * mesh.area]
    mesh = mesh.copy()
    mesh.update_faces(np.isin(np.arange(len(mesh.faces)), gone, invert=True))
    return mesh


def loose(mesh: trimesh.Trimesh, distance: float) -> trimesh.Trimesh:
    """Return the mesh with separate corners for each facet, moved up to a distance."""
    rng = np.random.default_rng(3)
    corners = np.array(mesh.triangles)
    step = rng.normal(size=corners.shape)
    step *= distance * rng.random((len(corners), 3, 1)) / np.linalg.norm(step, axis=2)[..., None]
    faces = np.arange(3 * len(corners)).reshape(-1, 3)
    return trimesh.Trimesh((corners + step).reshape(-1, 3), faces, process=False)


def in_compartments(mesh: trimesh.Trimesh, *, turned: bool = False) -> trimesh.Trimesh:
    """Return the mesh cut by bulkheads and a deck into bodies, one inside out if `turned`."""
    parts = [solid_of(mesh)]
    for normal, offset in (((1, 0, 0), -20), ((1, 0, 0), 15), ((0, 0, 1), 3)):
        halves = [part.split_by_plane(normal, offset) for part in parts]
        parts = [part for pair in halves for part in pair if part.num_tri()]
    first, *rest = map(mesh_of, parts)
    return together(inverted(first) if turned else first, *rest)


def wound_at_random(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    faces = np.array(mesh.faces)
    chosen = np.random.default_rng(4).random(len(faces)) < 0.2
    faces[chosen] = faces[chosen, ::-1]
    return trimesh.Trimesh(mesh.vertices, faces, process=False)


def finer_in_places(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return the mesh with some facets cut in four, so that vertices lie within edges of others."""
    divided = np.random.default_rng(5).random(len(mesh.faces)) < 0.2
    return mesh.subdivide(face_index=np.flatnonzero(divided & (mesh.area_faces > 0.01)))


def without_bottom(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    mesh = mesh.copy()
    mesh.update_faces(mesh.triangles[:, :, 2].max(axis=1) > 1e-6)
    return mesh


def with_cavity(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    return together(mesh, inverted(block((-5, -1, 1), (5, 1, 2))))


def with_neighbour(mesh: trimesh.Trimesh, *, turned: bool = False) -> trimesh.Trimesh:
    """Return the mesh with two bodies ahead of it that touch along an edge."""
    bow = mesh.bounds[1, 0]
    ahead = block((bow + 2, 0, 0), (bow + 4, 2, 3))
    touching = block((bow + 4, 2, 0), (bow + 6, 4, 3))
    return together(mesh, ahead, inverted(touching) if turned else touching)


KINDS: dict[str, tuple[Callable[[trimesh.Trimesh], trimesh.Trimesh], str]] = {
    # the change of a ship, and a part of the message about it
    "as it is": (lambda mesh: mesh, ""),
    "inside out": (inverted, "whole surface inside out"),
    "wound at random": (wound_at_random, "wound the other way"),
    "a body inside out": (lambda mesh: with_neighbour(mesh, turned=True), "1 of 3 bodies inside"),
    "bodies that share an edge": (with_neighbour, ""),
    "bodies that share faces": (in_compartments, ""),
    "a compartment inside out": (
        lambda mesh: in_compartments(mesh, turned=True),
        "1 of 6 bodies inside out",
    ),
    "bodies given twice": (lambda mesh: together(mesh, mesh), "1 body given twice"),
    "given twice, once inside out": (lambda mesh: together(mesh, inverted(mesh)), "given twice"),
    "a cavity": (with_cavity, ""),
    "a cavity, all inside out": (
        lambda mesh: inverted(with_cavity(mesh)),
        "whole surface inside out",
    ),
    "loose vertices": (lambda mesh: loose(mesh, LOOSE * mesh.extents.max()), "vertices less"),
    "facets finer than those beside them": (finer_in_places, "on open edges of other facets"),
    "an opening of 1 %": (lambda mesh: opened(mesh, 0.01, (30, 6, 5)), "opening"),
    "an opening of 4 %": (lambda mesh: opened(mesh, 0.04, (0, 0, 20)), "opening"),
    "no bottom": (without_bottom, "opening"),
    "loose and open": (
        lambda mesh: loose(opened(mesh, 0.02, (-30, -6, 5)), LOOSE * mesh.extents.max()),
        "opening",
    ),
}


def stored(mesh: trimesh.Trimesh) -> bytes:
    return mesh.export(file_type="stl")


def read(mesh: trimesh.Trimesh, **transform) -> tuple[trimesh.Trimesh, str]:
    """Return the mesh read from a file, and the faults reported."""
    placed = meshes.read(stored(mesh), ".stl", ships.Transform(**transform), where="mesh hulk")
    result = trimesh.Trimesh(placed.vertices, placed.faces, process=False)
    assert result.is_watertight and result.is_winding_consistent
    return result, "; ".join(placed.faults)


def refused(mesh: trimesh.Trimesh, **transform) -> str:
    with pytest.raises(ships.ShipError) as caught:
        read(mesh, **transform)
    return sentence(caught.value)


@pytest.fixture(scope="module", params=["texas", "spruance"])
def hull(request) -> trimesh.Trimesh:
    mesh = ships.load(request.param)
    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    mesh.merge_vertices()
    return mesh


@pytest.mark.parametrize("kind", KINDS)
def test_faulty_mesh_is_repaired_to_intended_volume(kind, hull):
    """Closing an opening may change the volume by 5 %, other repairs only by rounding.

    A file has float32, which is 4e-6 m at 70 m, and loose vertices are moved by `LOOSE` of the
    length. The volume changes by at most the surface times these.
    """
    make, message = KINDS[kind]
    faulty = make(hull)
    if "opening" in message:
        assert "repair: true would close it" in refused(faulty)
    mended, faults = read(faulty, repair="opening" in message)
    assert message in faults and bool(message) == bool(faults)
    moved = (LOOSE * hull.extents.max() if "loose" in kind else 0) + 1e-5
    meant = {"a cavity": -20.0, "bodies that share an edge": 24.0, "a body inside out": 24.0}
    volume = hull.volume + meant.get(kind.partition(",")[0], 0.0)
    gone = 0.05 * hull.volume if "opening" in kind or "open" in kind.split() else 0.0
    assert mended.volume == pytest.approx(volume, rel=0, abs=moved * hull.area + gone)


BOXES = st.lists(
    st.tuples(*[st.tuples(st.integers(0, 5), st.integers(1, 4))] * 3), min_size=1, max_size=5
)


@settings(max_examples=100, deadline=None)
@given(boxes=BOXES)
def test_touching_or_overlapping_bodies_are_united(boxes):
    """Bodies may share facets, parts of them, edges or corners, overlap or be the same."""
    cubes, parts = np.zeros((10, 10, 10), dtype=bool), []
    for spans in boxes:
        low, high = [low for low, _ in spans], [low + size for low, size in spans]
        cubes[tuple(map(slice, low, high))] = True
        parts.append(block(low, high))
    assert read(together(*parts))[0].volume == pytest.approx(cubes.sum(), rel=1e-6)


@settings(max_examples=25, deadline=None)
@given(
    share=st.floats(0.001, 0.2),
    at=st.tuples(st.floats(-60, 60), st.sampled_from([-6.0, 6.0]), st.floats(0, 20)),
)
def test_openings_are_closed_up_to_max_area_fraction(share, at):
    """A ball of 5 m without a cap is closed by a plane, which is smaller than the cap."""
    ball = trimesh.creation.icosphere(3, 5.0)
    ball.apply_translation((0, 0, 6))
    cut = opened(ball, share, at)
    assume(len(cut.faces) < len(ball.faces))
    assert "is open along" in refused(cut)
    try:
        mended, faults = read(cut, repair=True)
    except ships.ShipError as error:
        assert share > MAX_OPEN and "closes at most 5 %" in str(error)
        return
    assert "opening" in faults
    # The plane is at least 1 - share of the cap, and cuts off at most that share of the diameter.
    assert ball.area * (1 - share) < mended.area < ball.area
    assert ball.volume * (1 - share) < mended.volume < ball.volume


def test_opening_message_has_edges_area_and_place():
    """The message has edges, area and place in the file's coordinates, millimetres with y up."""
    box = block((-50, -6, 0), (50, 6, 8))
    gone = (box.triangles[:, :, 0] > 49).all(axis=1)
    box.update_faces(~gone)
    box.apply_transform(np.diag([1000, 1000, 1000, 1]))
    box.vertices = box.vertices @ ships.Transform(up="y").axes
    message = refused(box, up="y", scale=0.001)
    assert "open along 4 edges in 1 opening" in message and "the largest is 96.00 m2" in message
    assert "at (50000, 4000, 0) of the file" in message
    assert "repair: true would close it" in message  # 96 of 4,096 m2


def test_larger_openings_are_refused():
    box = block((-50, -6, 0), (50, 6, 8))
    box.update_faces(box.triangles[:, :, 2].min(axis=1) < 8)
    assert "closes at most 5 %" in refused(box) and "closes at most 5 %" in refused(
        box, repair=True
    )


def test_triangle_soup_is_refused_without_attempting_repair():
    corners = np.random.default_rng(6).uniform(0, 100, (12_000, 3, 3))
    faces = np.arange(corners.size // 3).reshape(-1, 3)
    message = refused(trimesh.Trimesh(corners.reshape(-1, 3), faces, process=False), repair=True)
    assert "open along 36,000 edges in 12,000 openings" in message


def test_one_sided_surface_is_refused_with_its_location():
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    out, up = np.cos(turn / 2), np.sin(turn / 2)
    ring = 20 * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(24)])
    half = np.column_stack([out * np.cos(turn), out * np.sin(turn), up])
    vertices = np.concatenate([ring + half, ring - half]) + np.array([0, 0, 5])
    faces = []
    for k in range(24):
        a, b = (k, (k + 1) % 24)
        near, far = (b, b + 24) if b else (24, 0)
        faces += [[a, near, a + 24], [near, far, a + 24]]
    message = refused(trimesh.Trimesh(vertices, faces, process=False))
    assert "facets wound both ways at (" in message


def test_zero_thickness_plates_are_kept():
    """A plate with front and back keeps its area beside a hull; alone it is refused."""
    plate = trimesh.Trimesh([[0, 3, 9], [9, 3, 9], [9, 3, 12], [0, 3, 12]], [[0, 1, 2], [0, 2, 3]])
    plate = together(plate, inverted(plate))
    hull = block((-50, -6, 0), (50, 6, 8))
    mended, _ = read(together(hull, plate))
    assert mended.area == pytest.approx(hull.area + 2 * 27)
    assert mended.volume == pytest.approx(hull.volume)
    assert "no inside" in refused(plate)
    assert not ships.is_symmetric(mended)


def test_check_closed_refuses_an_inverted_body():
    ship = together(block((-50, -6, 0), (50, 6, 8)), inverted(block((0, -2, 9), (8, 2, 12))))
    with pytest.raises(ships.ShipError, match=r"1 of 2 bodies inside out .*at \(4, 0, 10.5\)"):
        meshes.check_closed(ship, "ship")


def test_repair_is_in_the_digest(tmp_path):
    path = tmp_path / "hulk.stl"
    path.write_bytes(stored(block((-50, -6, 0), (50, 6, 8))))
    assert ships.digest(path) != ships.digest(path, repair=True)
    assert ships.load(path, repair=True).metadata["faults"] == ()
    with pytest.raises(ships.ShipError, match="repair is 1, but must be True or False"):
        ships.load(path, repair=1)

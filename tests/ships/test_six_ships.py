"""The six ships are closed solids wound outward, of the right size, orientation and details."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
import yaml
from manifold3d import Manifold
from shipyard import packaged_text, solid_of
from trimesh.ray.ray_pyembree import RayMeshIntersector

from ncti import ships


@pytest.fixture(params=ships.names())
def name(request: pytest.FixtureRequest) -> str:
    return request.param


def is_solid_at(mesh: trimesh.Trimesh, point: tuple[float, float, float]) -> bool:
    probe = Manifold.cube((0.1, 0.1, 0.1), True).translate(point)
    return (solid_of(mesh) ^ probe).volume() > 0


def stern_ranges(mesh: trimesh.Trimesh, *, depression: float = 3.84, pixel: float = 0.12):
    """Return the ranges [m] seen from astern, from the nearest point on, by rays."""
    d = np.radians(depression)
    toward = np.array([-np.cos(d), 0, np.sin(d)])
    right, up = np.array([0, -1.0, 0]), np.array([np.sin(d), 0, np.cos(d)])
    across, above = mesh.vertices @ right, mesh.vertices @ up
    grid = np.meshgrid(
        np.arange(across.min(), across.max(), pixel), np.arange(above.min(), above.max(), pixel)
    )
    origins = grid[0].reshape(-1, 1) * right + grid[1].reshape(-1, 1) * up + 300 * toward
    directions = np.broadcast_to(-toward, origins.shape)
    hits, *_ = RayMeshIntersector(mesh).intersects_location(
        origins, directions, multiple_hits=False
    )
    ranges = -(hits @ toward)
    return ranges - ranges.min()


def test_is_one_closed_solid_wound_outward(name) -> None:
    mesh = ships.load(name)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    assert mesh.body_count == 1


def test_ship_ends_in_a_flat_face_at_the_waterline(name) -> None:
    mesh = ships.load(name)
    assert mesh.vertices[:, 2].min() == 0
    flat = (mesh.triangles[:, :, 2] == 0).all(axis=1)
    assert (mesh.face_normals[flat, 2] < -0.999).all()
    assert mesh.area_faces[flat].sum() > 0.5 * np.prod(mesh.extents[:2])


def test_dimensions_match_the_sheet(name) -> None:
    """Both agree within the project's tolerance of 0.1 m, as nothing overhangs the hull."""
    mesh, principal = ships.load(name), yaml.safe_load(packaged_text(name))["principal"]
    for length in (mesh.extents[0], mesh.metadata["loa"]):
        assert length == pytest.approx(principal["LOA"], abs=0.1)
    for beam in (mesh.extents[1], mesh.metadata["beam"]):
        assert beam == pytest.approx(principal["beam_max"], abs=0.1)
    assert mesh.bounds[1, 0] == pytest.approx(-mesh.bounds[0, 0], abs=1e-6)
    assert mesh.bounds[1, 2] == pytest.approx(principal["mast_top_z"], abs=0.6)


@pytest.mark.parametrize(
    ("name", "what", "aft", "port", "up"),
    [
        ("spruance", "forward funnel to port", 74.5, 3.9, 16.0),
        ("spruance", "after funnel to starboard", 103.2, -4.1, 18.0),
        ("spruance", "forward exhaust to port", 72.0, 3.8, 21.0),
        ("horne", "Phalanx to starboard", 108.2, -6.3, 12.5),
        ("duncan", "vent house B to starboard", 64.9, -1.1, 12.0),
        ("duncan", "helicopter control to port", 108.5, 2.2, 11.0),
        ("roberts", "stern capstan to port", 136.2, 1.8, 4.0),
    ],
)
def test_asymmetric_parts_are_on_the_correct_side(name, what, aft, port, up) -> None:
    mesh = ships.load(name)
    x = mesh.metadata["loa"] / 2 - aft
    assert is_solid_at(mesh, (x, port, up)), what
    assert not is_solid_at(mesh, (x, -port, up)), what


@pytest.mark.parametrize(("name", "angle"), [("duncan", 11), ("roberts", 45), ("spruance", 10)])
def test_transom_rake_matches_the_sheet(name, angle) -> None:
    """Transom facets are one plane at the sheet's angle, and nearly all of the stern."""
    mesh = ships.load(name)
    outward = -np.array([np.cos(np.radians(angle)), 0, np.sin(np.radians(angle))])
    stern = mesh.triangles_center[:, 0] < 4 - mesh.extents[0] / 2
    facing = stern & (mesh.face_normals @ outward > np.cos(np.radians(0.1)))
    corners = mesh.triangles[facing].reshape(-1, 3)
    assert np.ptp(corners @ outward) < 1e-3  # slivers go by moving surfaces 0.1 mm at most
    assert corners[:, 0].min() == pytest.approx(-mesh.metadata["loa"] / 2, abs=0.01)
    # The transom consists of the stern facets that face aft within 60 degrees of the horizon.
    aft = stern & (mesh.face_normals[:, 0] < -0.5) & (mesh.triangles_center[:, 2] < 3.5)
    assert mesh.area_faces[facing & aft].sum() > 0.9 * mesh.area_faces[aft].sum() > 20.0


@pytest.mark.parametrize(
    ("name", "distance"), [("duncan", 26.5), ("roberts", 29), ("spruance", 56.5), ("horne", 45)]
)
def test_hangar_is_the_tallest_peak_from_astern(name, distance) -> None:
    """Distances of rough models of the same sheets agree within half a bin and half a metre."""
    ranges = stern_ranges(ships.load(name))
    share = np.bincount(np.floor(ranges).astype(int)) / len(ranges)
    assert np.argmax(share) + 0.5 == pytest.approx(distance, abs=1.0)
    assert share.max() > 0.12

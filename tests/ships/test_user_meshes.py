"""Users' STL, OBJ and GLB files load as closed solids above water, or are refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from shipyard import refusal

from ncti import ships

KINDS = ("stl", "obj", "glb")


def block(*, length=100.0, width=14.0, height=20.0, at=(0.0, 0.0, 10.0)) -> trimesh.Trimesh:
    return trimesh.creation.box((length, width, height)).apply_translation(at)


def saved(geometry: trimesh.Trimesh | trimesh.Scene, path: Path) -> Path:
    with np.errstate(invalid="ignore"):  # some are broken on purpose
        geometry.export(path)
    return path


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> str:
    return request.param


def test_closed_mesh_loads_unchanged(kind, tmp_path) -> None:
    mesh = ships.load(saved(block(), tmp_path / f"hulk.{kind}"))
    assert mesh.is_volume
    assert mesh.volume == pytest.approx(100 * 14 * 20)
    np.testing.assert_allclose(mesh.bounds, [[-50, -7, 0], [50, 7, 20]])
    assert mesh.metadata["name"] == "hulk"
    assert mesh.metadata["loa"] == pytest.approx(100)
    assert mesh.metadata["beam"] == pytest.approx(14)


def test_mesh_is_clipped_and_capped_at_the_waterline(kind, tmp_path) -> None:
    mesh = ships.load(saved(block(at=(0, 0, 4)), tmp_path / f"hulk.{kind}"))
    assert mesh.is_volume
    assert mesh.bounds[0, 2] == 0
    assert mesh.volume == pytest.approx(100 * 14 * 14)


def test_several_closed_geometries_are_united(tmp_path) -> None:
    house = block(length=20, width=10, height=10, at=(0, 0, 24))  # 1 m of it inside the hull
    mesh = ships.load(saved(trimesh.Scene([block(), house]), tmp_path / "hulk.glb"))
    assert mesh.is_volume
    assert mesh.body_count == 1
    assert mesh.volume == pytest.approx(100 * 14 * 20 + 20 * 10 * 9)


def broken() -> dict[str, trimesh.Trimesh]:
    """Return meshes that are no ship, by a part of their refusal."""
    lid_off = block()
    lid_off.update_faces(np.arange(12) > 0)
    return {
        "is open": lid_off,
        "100000 across": block().apply_scale(1000),
        "under water": block(at=(0, 0, -10)),
    }


@pytest.mark.parametrize("said", broken())
def test_broken_mesh_is_refused(said, kind, tmp_path) -> None:
    assert said in refusal(saved(broken()[said], tmp_path / f"hulk.{kind}"))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_non_finite_vertices_are_refused(bad, kind, tmp_path) -> None:
    mesh = block()
    vertices = np.array(mesh.vertices)
    vertices[3, 1] = bad
    broken = trimesh.Trimesh(vertices, mesh.faces, process=False)
    assert "NaN or infinite" in refusal(saved(broken, tmp_path / f"hulk.{kind}"))


def test_point_cloud_is_refused(tmp_path) -> None:
    cloud = trimesh.PointCloud(np.random.default_rng(0).random((50, 3)))
    assert "empty" in refusal(saved(trimesh.Scene(cloud), tmp_path / "hulk.glb"))


def test_truncated_file_is_refused(kind, tmp_path) -> None:
    path = saved(block(), tmp_path / f"hulk.{kind}")
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    refusal(path)


@settings(
    max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(content=st.binary(max_size=400))
@example(content=b"")
@example(content=b"solid nothing\nendsolid nothing\n")
@example(content=b"# only a comment\n")
def test_any_bytes_are_refused_in_one_sentence(content, kind, tmp_path) -> None:
    path = tmp_path / f"noise.{kind}"
    path.write_bytes(content)
    refusal(path)

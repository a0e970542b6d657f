"""Keys of results of a user's ship depend on its mesh and on its transform."""

import numpy as np
import pytest
import trimesh
from range_channel import choose

import ncti.ships
from sweeps.engine.declare.stage import value_token
from sweeps.stages import meshes, views
from sweeps.stages.ships import ship_name
from sweeps.stages.views import Grid


def ship(**given):
    [name] = choose(grid__ship=given)[Grid.ship]
    return name


def test_a_transform_counts_in_the_key_of_results(tmp_path, monkeypatch):
    """The ship is a floating box, in a file in millimetres with y up."""
    mesh = trimesh.creation.box((60, 10, 21)).apply_translation((0, 0, 10.5))
    axes = ncti.ships.Transform(up="y", scale=0.001).axes
    turned = trimesh.Trimesh(mesh.vertices @ axes * 1000, mesh.faces, process=False)
    turned.export(tmp_path / "hull.stl")
    monkeypatch.chdir(tmp_path)
    turned, same, other = (
        views.mesh_source(ship(path="hull.stl", up=up, scale=0.001)) for up in ("y", "y", "-y")
    )
    assert value_token(turned) == value_token(same) != value_token(other)
    plain = ncti.ships.digest("duncan")
    assert (
        views.mesh_source(ship(path="duncan")).digest
        == views.mesh_source(ship_name("duncan")).digest
        == plain
    )
    np.testing.assert_allclose(meshes.read_mesh(turned).extents, (60, 10, 21), atol=1e-5)
    assert meshes.description(turned).length == pytest.approx(60)

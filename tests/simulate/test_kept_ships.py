"""Cached ships of simulations do not share meshes with callers."""

import numpy as np
import trimesh

import ncti.ships
from ncti import simulate


def barge(length):
    box = trimesh.creation.box((length, 8.0, 6.0))
    box.apply_translation((0.0, 0.0, 3.0))
    return box


def profile(ship):
    return simulate.range_profile(ship, aspect=30.0, frames=1, target_free_ifovs=0)


def test_no_mesh_of_a_caller_is_kept(tmp_path):
    """Changing a loaded or given mesh afterwards does not change the cached ship."""
    path = tmp_path / "barge.stl"
    barge(40.0).export(path)
    first = profile(path)
    mine = ncti.ships.load(path)
    mine.apply_scale(2.0)
    np.testing.assert_array_equal(profile(path), first)
    mesh = barge(40.0)
    before = profile(mesh)
    mesh.apply_scale(1.5)
    assert not np.array_equal(profile(mesh), before)

"""A user's mesh is swept from the command line, described in the store, and repaired."""

import numpy as np
import pytest
import trimesh
from commands import FAST, opened, ran

import ncti.ships
from ncti.ships import Transform
from sweeps.engine.store.writing import read_attributes

MILLIMETRES = "grid.ship={path: hull.stl, up: y, scale: 0.001}"
BOTH = "grid.ship=[{path: hull.stl, up: y, scale: 0.001}, duncan]"


@pytest.fixture
def mesh(folder):
    """Write Connole to a file in millimetres with y up, and return its mesh."""
    ship = ncti.ships.load("connole")
    vertices = ship.vertices @ Transform(up="y").axes * 1000
    trimesh.Trimesh(vertices, ship.faces, process=False).export(folder / "hull.stl")
    return ship


def test_user_mesh_is_independent_of_other_ships(mesh, folder, results, capsys):
    common = (*FAST, "grid.aspect=[30,60]", "grid.frame_count=4", "store=s.zarr")
    assert ran(MILLIMETRES, *common, f"cache={results}") == 0, capsys.readouterr().err
    assert "hull  133.5 x 14.2 x 36.9 m, 28,860 facets\n" in capsys.readouterr().err
    reference = opened(folder / "s.zarr", "ships")
    assert ran(BOTH, *common, f"cache={results}") == 0
    assert "warning" not in capsys.readouterr().err
    ships = opened(folder / "s.zarr", "ships")
    assert ships.ship.values.tolist() == ["duncan", "hull"]
    assert ships.sel(ship=["hull"]).drop_vars("ship").equals(reference.drop_vars("ship"))
    hull = ships.sel(ship="hull")
    # STL is single precision.
    measured = [float(hull[name]) for name in ("length", "beam", "height")]
    assert measured == pytest.approx(mesh.extents, abs=1e-4)
    assert hull.facets == len(mesh.faces) and hull.warning == ""
    assert hull.picture.shape == (80, 200) and 1000 < hull.picture.count() < 12_000

    attributes = read_attributes(folder / "s.zarr")
    assert attributes["mesh_transforms"] == {"hull": "up: y, scale: 0.001"}
    digest = ncti.ships.digest(folder / "hull.stl", up="y", scale=0.001)
    assert attributes["mesh_digests"]["hull"] == digest


def test_mesh_repairs_are_reported(mesh, folder, capsys):
    """The ship is inside out, and its largest deck facets are missing besides."""
    path = folder / "hull.stl"
    broken = trimesh.load(path)
    broken.update_faces(broken.area_faces < np.partition(broken.area_faces, -4)[-4])
    broken.invert()
    broken.export(path)
    assert ran(MILLIMETRES, "dry_run=true") == 2
    assert "repair: true would close it" in capsys.readouterr().err
    assert ran(MILLIMETRES.replace("}", ", repair: true}"), "dry_run=true") == 0
    message = capsys.readouterr().err
    assert "opening" in message and "inside out, which are corrected\n" in message

"""`is_symmetric` detects from the mesh whether a ship is its own mirror image."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from trimesh.creation import box

import ncti.ships
from ncti.ships import symmetry
from ncti.ships.symmetry import MIN_THICKNESS


def placed(solid, *at, turn=0.0):
    """Return the solid, turned about its upright axis [deg] and moved."""
    solid.apply_transform(trimesh.transformations.rotation_matrix(np.radians(turn), [0, 0, 1]))
    return solid.apply_translation(at)


def barge(*more):
    """Return the union of a hull, a house on it and the given solids."""
    hull, house = placed(box((100, 12, 6)), 0, 0, 3), placed(box((20, 8, 6)), 5, 0, 8)
    return trimesh.boolean.union([hull, house, *more], engine="manifold")


def test_symmetry_does_not_depend_on_triangulation():
    plain = barge()
    port = np.flatnonzero(plain.triangles_center[:, 1] > 0)
    # A vertex in the middle of each facet of one side.
    middle = np.arange(len(port)) + len(plain.vertices)
    a, b, c = plain.faces[port].T
    thirds = [np.column_stack([*pair, middle]) for pair in ((a, b), (b, c), (c, a))]
    faces = np.concatenate([np.delete(plain.faces, port, axis=0), *thirds])
    vertices = np.concatenate([plain.vertices, plain.triangles_center[port]])
    finer = trimesh.Trimesh(vertices, faces, process=False)
    assert finer.is_watertight
    sides = [(finer.triangles_center[:, 1] * side > 0).sum() for side in (1, -1)]
    assert sides[0] > 2 * sides[1]
    assert ncti.ships.is_symmetric(finer)


def test_equal_moments_do_not_imply_symmetry():
    """A box to port and the same one turned to starboard have equal mass and products."""
    port, starboard = (
        placed(box((2, 2, 2)), -30, 4, 6.5),
        placed(box((2, 2, 2)), -30, -4, 6.5, turn=45),
    )
    ship = barge(port, starboard)
    assert abs(ship.center_mass[1]) < 1e-9
    assert not ncti.ships.is_symmetric(ship)


@settings(max_examples=20, deadline=None)
@given(exponent=st.floats(-2, 2), length=st.floats(1, 30))
def test_plates_break_symmetry_only_above_min_thickness(exponent, length):
    """Twice a plate's volume over its surface is its thickness, except for the rim."""
    thick = MIN_THICKNESS * 10**exponent
    ship = barge(placed(box((length, thick, 3)), -20, 6 + thick / 2, 3))
    thick = ship.bounds[1, 1] - 6  # the union rounds to single precision, 0.2 um there
    mean = thick / (1 + thick * (1 / length + 1 / 3))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(symmetry, "MAX_IMBALANCE", np.inf)
        assert ncti.ships.is_symmetric(ship) == (mean <= MIN_THICKNESS)


@pytest.mark.parametrize("name", ncti.ships.names())
def test_no_packaged_ship_is_symmetric(name):
    """Launchers, funnels and torpedo tubes make the packaged ships asymmetric."""
    assert not ncti.ships.is_symmetric(ncti.ships.load(name))

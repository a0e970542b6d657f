"""Facets whose gain is an input: which they are, and that nothing else changes."""

import numpy as np
import pytest

from ncti import ships
from ncti.irar import reflectivity
from ncti.irar.materials import masts, transom


@pytest.mark.parametrize("name", ["roberts", "duncan", "connole"])
def test_a_transom_is_the_low_plate_that_closes_the_stern(name):
    mesh = ships.load(name)
    found = transom(mesh)
    assert found.any()
    assert mesh.triangles_center[found, 0].max() < mesh.bounds[0, 0] + 6
    # seen from astern it fills the hull's width there, within the deck's height
    area = (mesh.area_faces * -mesh.face_normals[:, 0])[found].sum()
    width = np.ptp(mesh.triangles[found][..., 1])
    assert 0.5 * width * 2 < area < width * np.ptp(mesh.triangles[found][..., 2])


def test_gains_touch_their_facets_only():
    mesh = ships.load("roberts")
    found = reflectivity(mesh, transom_gain=0.25, mast_gain=3)
    assert set(np.unique(found)) == {0.25, 1, 3}
    assert np.array_equal(found == 0.25, transom(mesh))
    assert np.array_equal(found == 3, masts(mesh))
    assert (reflectivity(mesh) == 1).all()

"""Transom facets are selected correctly, and input gains change only their own facets."""

import numpy as np
import pytest

from ncti import ships
from ncti.irar import reflectivity


@pytest.mark.parametrize("name", ["roberts", "duncan", "connole"])
def test_transom_gain_selects_the_low_stern_plate(name):
    mesh = ships.load(name)
    facets = reflectivity(mesh, transom_gain=0.25, mast_gain=3.0) == 0.25
    assert facets.any()
    assert mesh.triangles_center[facets, 0].max() < mesh.bounds[0, 0] + 6
    # seen from astern it fills the hull's width there, within the deck's height
    area = (mesh.area_faces * -mesh.face_normals[:, 0])[facets].sum()
    width = np.ptp(mesh.triangles[facets][..., 1])
    assert 0.5 * width * 2 < area < width * np.ptp(mesh.triangles[facets][..., 2])

"""Rendered range extents of box, plate and sphere against their closed forms."""

from __future__ import annotations

from itertools import product

import closed_forms
import numpy as np
import pytest
import trimesh
from metric import EDGES, MEDIAN, PULSE, SLOPE, WORST, areas, error, far_extent, slope

ASPECTS = (0.0, 7.0, 33.0, 47.0, 81.0, 90.0)
DEPRESSIONS = (3.84, 15.6)

HULL = ((140.0, 14.0, 8.0), (0.3, 0.2, 4.0))
PLATE = ((0.02, 30.0, 20.0), (0.4, 0.0, 10.0))


def box_errors(extents, centre, pulse_width, *, aspects, pixel):
    mesh = trimesh.creation.box(extents)
    mesh.apply_translation(centre)
    errors = []
    for aspect, depression in product(aspects, DEPRESSIONS):
        view = {"aspect": aspect, "depression": depression}
        found = areas(far_extent(mesh, **view, pixel=pixel)).sum(axis=0)
        truth = closed_forms.box(extents, centre, **view, edges=EDGES)
        errors.append(error(found, truth, pulse_width))
    return errors


@pytest.mark.parametrize(
    ("solid", "aspects"), [(HULL, ASPECTS), (PLATE, ASPECTS[:4])], ids=["box", "plate"]
)
def test_flat_faces(solid, aspects):
    errors = box_errors(*solid, PULSE, aspects=aspects, pixel=0.25)
    assert np.median(errors) < MEDIAN
    assert max(errors) < WORST


def test_sphere():
    # Facets of this mesh lie 6 mm below the sphere: 0.06 % of its area.
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=20.0)
    found = areas(far_extent(mesh, aspect=33.0)).sum(axis=0)
    assert error(found, closed_forms.sphere(20.0, EDGES), PULSE) < MEDIAN


@pytest.mark.parametrize("pulse_width", [0.0, PULSE])
def test_error_of_a_box_falls_with_the_pixel(pulse_width):
    pixels = [1.0, 0.5, 0.25, 0.125]
    errors = [
        np.mean(box_errors(*HULL, pulse_width, aspects=ASPECTS, pixel=pixel)) for pixel in pixels
    ]
    assert slope(pixels, errors) > SLOPE

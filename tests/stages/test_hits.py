"""Hits kept as arrays have the coverage of the view by pixels or lines."""

import numpy as np
import pytest
import trimesh

from ncti.infrared import Hits, silhouette
from ncti.render import line_image, range_image
from sweeps.stages.arguments import restore

VIEW = {"aspect": 25.0, "depression": 3.84}
PLACE = (0.3, 0.8)


def ship():
    """Return a hull with a house that is far aft and to port."""
    hull = trimesh.creation.box((100.0, 12.0, 8.0)).apply_translation((0.0, 0.0, 4.0))
    house = trimesh.creation.box((20.0, 5.0, 9.0)).apply_translation((-30.0, 2.0, 12.0))
    return trimesh.util.concatenate([hull, house])


def images():
    """Return images of the ship by pixels and by lines."""
    pixels = range_image(ship(), pixel=0.5, engine="embree", **VIEW)
    return {"pixels": pixels, "lines": line_image(ship(), spacing=0.5, **VIEW)}


@pytest.fixture(params=("pixels", "lines"))
def image(request):
    return images()[request.param]


def test_restored_patches_have_the_coverage_of_the_view(image):
    hits = Hits.of(image)
    hits_restored = restore(Hits, {name: np.asarray(array) for name, array in vars(hits).items()})
    assert type(hits_restored.columns) is int
    patches = hits_restored.patches()
    raster = patches.covering(15.0, PLACE)
    expected = silhouette(image, footprint=15.0, phase=PLACE, extent=patches.extent)
    np.testing.assert_array_equal(raster.coverage, expected.coverage)
    assert raster.origin == expected.origin

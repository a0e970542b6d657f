"""Hits kept as arrays have the coverage of the view by pixels or lines, also mirrored."""

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


def test_patches_cover_what_the_view_does(image):
    hits = Hits.of(image)
    hits_restored = restore(Hits, {name: np.asarray(array) for name, array in vars(hits).items()})
    assert type(hits_restored.columns) is int
    patches = hits_restored.patches()
    raster = patches.covering(15.0, PLACE)
    expected = silhouette(image, footprint=15.0, phase=PLACE, extent=patches.extent)
    np.testing.assert_array_equal(raster.coverage, expected.coverage)
    assert raster.origin == expected.origin


def test_a_mirrored_ship_covers_the_mirrored_pixels(image):
    """With the ship's origin in the middle of a pixel, columns change places and nothing else."""
    drawn, mirrored = (shares(Hits.of(image).patches(mirrored=flag)) for flag in (False, True))
    assert drawn.keys() == {-column for column in mirrored}
    for column, share in drawn.items():
        np.testing.assert_allclose(mirrored[-column], share, atol=1e-9)
    assert any(abs(share - drawn[-column]).max() > 0.5 for column, share in drawn.items())


def shares(patches):
    """Return the coverage of each column that shows the ship, by its number from the origin."""
    raster = patches.covering(3.75, (0.5, 0.5))
    columns = np.rint(raster.origin[0] / 3.75).astype(int) + np.arange(raster.coverage.shape[1])
    return {c: raster.coverage[:, k] for k, c in enumerate(columns) if raster.coverage[:, k].any()}

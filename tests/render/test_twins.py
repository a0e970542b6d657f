"""A mirrored ship seen from the other side gives mirrored lines and range extents."""

from functools import cache

import numpy as np
import pytest
import trimesh

import ncti.ships
from ncti.ladar import range_extent
from ncti.render import line_image, range_image
from ncti.render.view import ROLL

ship = cache(ncti.ships.load)
PORT = {"aspect": 40.0, "depression": 3.84, "roll": ROLL}
STARBOARD = {"aspect": 320.0, "depression": 3.84, "roll": -ROLL}
SIGHT = {"slant_range": 50e3, "ifov": 150e-6}


@cache
def swapped(name):
    """Return a ship with port and starboard swapped and its facets outward."""
    mesh = ship(name)
    return trimesh.Trimesh(mesh.vertices * [1, -1, 1], mesh.faces[:, ::-1], process=False)


@pytest.mark.parametrize("name", ["horne", "spruance"])
@pytest.mark.parametrize("slant_range", [None, 50e3])
def test_lines_are_mirrored(name, slant_range):
    """Line by line, area and the first two moments of range agree up to rounding."""
    port = line_image(ship(name), **PORT, slant_range=slant_range)
    starboard = line_image(swapped(name), **STARBOARD, slant_range=slant_range)
    # Ties may resolve differently and split a piece in two, so areas are compared.
    for weight in (np.ones_like, lambda r: r, np.square):
        sums = [
            np.bincount(
                lines.line - port.line[0], lines.area * weight(lines.down_range.mean(axis=1))
            )
            for lines in (port, starboard)
        ]
        np.testing.assert_allclose(*sums, atol=1e-7 * np.abs(sums[0]).max())


@pytest.mark.parametrize("name", ["horne", "spruance"])
def test_extents_by_lines_are_mirrored(name):
    port = range_extent(line_image(ship(name), **PORT), **SIGHT).mirrored()
    starboard = range_extent(line_image(swapped(name), **STARBOARD), **SIGHT)
    np.testing.assert_array_equal(port.cell, starboard.cell)
    np.testing.assert_allclose(port.fraction, starboard.fraction, atol=1e-8)
    np.testing.assert_allclose(port.strands, starboard.strands, atol=1e-8)


@pytest.mark.parametrize("reflectance", ["projected_area", "lambertian"])
def test_extents_by_pixels_are_mirrored(reflectance):
    """They agree except for pixels whose centre is within float32 rounding, 1e-5 m, of an edge.

    With some 10 km of visible edges these are 0.1 m^2, two pixels among 40,000.
    """
    engine = {"engine": "embree", "pixel": 0.25}
    images = (
        range_image(ship("horne"), **PORT, **engine),
        range_image(swapped("horne"), **STARBOARD, **engine),
    )
    hit = images[0].hit[:, ::-1], images[1].hit
    assert np.count_nonzero(hit[0] != hit[1]) < 1e-4 * np.count_nonzero(hit[0])
    port, starboard = (range_extent(image, **SIGHT, reflectance=reflectance) for image in images)
    port = port.mirrored()
    np.testing.assert_array_equal(port.cell, starboard.cell)
    wrong = np.abs(port.fraction - starboard.fraction).sum()
    assert wrong < 1e-3 * port.fraction.sum()

"""Maps of silhouettes and of templates are equal to the library's by hand."""

from itertools import product

import numpy as np
import pytest
from infrared_channel import HITS, PATCHES, WAYS, view_from

from ncti import features
from ncti.infrared import coverage_of, pixel_sigma
from ncti.ladar.places import PLASTIC
from sweeps.stages.infrared import log_polar, silhouettes, template_log_polar

METHODS = ("matched", "otsu")
RADII, BETWEEN = (0.5, 0.75), ("bilinear", "nearest")
FRAMES = (1, 16)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("slant_range", [25.0, 50.0])
def test_cell_matches_direct_library_calls(way, slant_range):
    view = view_from(slant_range)
    phases = (0, 1)
    masks = [silhouettes(view, way, method, phases, FRAMES) for method in METHODS]
    maps = {
        (m, r, b): log_polar(masks[m], RADII[r], BETWEEN[b])
        for m, r, b in product(range(2), range(2), range(2))
    }
    assert maps[0, 0, 0].dtype == np.uint8
    for p, f in product(phases, range(2)):
        image = view.images(way, (p,), FRAMES)[0, f]
        known = {
            name: pixel_sigma(spread, frame_count=FRAMES[f], nedt=0.3, super_resolution=way)
            for name, spread in (("target_sigma", 0.15), ("sea_sigma", 0.08))
        }
        cut = (
            features.segment(image, method="matched", contrast=view.contrast, **known),
            features.segment(image, method="otsu"),
        )
        for m, r, b in product(range(2), range(2), range(2)):
            cells = features.log_polar(cut[m], inner_radius=RADII[r], interpolation=BETWEEN[b])
            np.testing.assert_array_equal(maps[m, r, b][p, f], np.rint(255 * cells))


def test_templates_have_evenly_spread_subpixel_offsets():
    """Their places on the detector spread evenly over a pixel, the first at its corner."""
    phases = tuple(range(64))
    head_on, imager = (0.0, 0.0), (25e3, 150e-6, 0.4)
    options = {"inner_radius": 0.5, "interpolation": "nearest"}
    maps = template_log_polar(HITS, *head_on, *imager, **options, subpixel_offsets=phases)
    places = np.outer(phases, PLASTIC) % 1
    assert not places[0].any()
    for phase in (0, 1, 5):
        silhouette = coverage_of(
            PATCHES.horizontal,
            PATCHES.vertical,
            area=PATCHES.area,
            footprint=3.75,
            phase=tuple(places[phase]),
        )
        cells = features.log_polar(silhouette.target(0.4), **options)
        np.testing.assert_array_equal(maps[phase], np.rint(255 * cells))
    # Each of 16 squares has four places, up to two more or less; chance has such a spread.
    counts, *_ = np.histogram2d(*places.T, bins=4, range=[[0, 1], [0, 1]])
    assert np.abs(counts - 4).max() <= 2

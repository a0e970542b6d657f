"""Silhouettes: masks as bits, and their maps, against the library by hand."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from hypothesis.extra.numpy import arrays
from infrared_channel import HITS, PATCHES, WAYS, look_from

from ncti import features
from ncti.infrared import coverage_of, pixel_sigma
from sweeps.stages.places import PLASTIC
from sweeps.stages.silhouettes import (
    log_polar,
    map_cells,
    maps_of,
    silhouettes,
    template_log_polar,
)

HEAD_ON = (0.0, 0.0)  # aspect, and that of what is drawn
METHODS = ("matched", "otsu")
RADII, BETWEEN = (0.5, 0.75), ("bilinear", "nearest")
FRAMES = (1, 16)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("slant_range", [25.0, 50.0])
def test_a_cell_is_the_library_done_by_hand(way, slant_range):
    look = look_from(slant_range)
    phases = (0, 1)
    masks = silhouettes(look, way, METHODS, phases, FRAMES)
    maps = log_polar(masks, METHODS, RADII, BETWEEN, phases, FRAMES)
    assert maps.dtype == np.uint8
    for p, f in product(phases, range(2)):
        image = look.images(way, (p,), FRAMES)[0, f]
        known = {
            name: pixel_sigma(spread, frame_count=FRAMES[f], nedt=0.3, super_resolution=way)
            for name, spread in (("target_sigma", 0.15), ("sea_sigma", 0.08))
        }
        cut = (
            features.segment(image, method="matched", contrast=look.contrast, **known),
            features.segment(image, method="otsu"),
        )
        for m, r, b in product(range(2), range(2), range(2)):
            cells = features.log_polar(cut[m], inner_radius=RADII[r], interpolation=BETWEEN[b])
            np.testing.assert_array_equal(maps[m, r, b, p, f], np.rint(255 * cells))


@settings(max_examples=40, deadline=None)
@given(arrays(bool, some.tuples(some.integers(1, 9), some.integers(1, 19))))
def test_masks_are_mapped_as_if_they_were_never_packed(mask):
    bits = np.packbits(mask, axis=-1)
    found = log_polar(bits[None, None, None], ("otsu",), RADII, BETWEEN, (0,), (16,))
    np.testing.assert_array_equal(found[0, :, :, 0, 0], maps_of(mask, RADII, BETWEEN))


@settings(max_examples=20, deadline=None)
@given(
    method=some.sampled_from(METHODS),
    phase=some.integers(0, 2),
    frames=some.sampled_from(FRAMES),
    radius=some.sampled_from(RADII),
    between=some.sampled_from(BETWEEN),
    way=some.sampled_from(WAYS),
)
def test_a_value_does_not_depend_on_its_company(method, phase, frames, radius, between, way):
    """Alone, from a look that has seen nothing else, to the last bit."""
    phases = (0, 1, 2)
    whole = silhouettes(look_from(50.0), way, METHODS, phases, FRAMES)
    alone = silhouettes(look_from(50.0), way, (method,), (phase,), (frames,))
    at = METHODS.index(method), phase, FRAMES.index(frames)
    np.testing.assert_array_equal(alone[0, 0, 0], whole[at])
    mapped = log_polar(whole, METHODS, RADII, BETWEEN, phases, FRAMES)
    found = log_polar(alone, (method,), (radius,), (between,), (phase,), (frames,))
    at = (at[0], RADII.index(radius), BETWEEN.index(between), *at[1:])
    np.testing.assert_array_equal(found[0, 0, 0, 0, 0], mapped[at])
    every = template_log_polar(HITS, *HEAD_ON, 25.0, 150.0, 0.25, RADII, BETWEEN, phases)
    one = template_log_polar(HITS, *HEAD_ON, 25.0, 150.0, 0.25, (radius,), (between,), (phase,))
    np.testing.assert_array_equal(one[0, 0, 0], every[at[1], at[2], phase])


def test_templates_are_the_pixels_that_the_ship_fills():
    """At places on the detector that spread evenly over a pixel, the first at its corner."""
    phases = tuple(range(64))
    found = template_log_polar(HITS, *HEAD_ON, 25.0, 150.0, 0.4, (0.5,), ("nearest",), phases)[0, 0]
    places = np.outer(phases, PLASTIC) % 1
    assert not places[0].any()
    for phase in (0, 1, 5):
        seen = coverage_of(
            PATCHES.horizontal,
            PATCHES.vertical,
            area=PATCHES.area,
            footprint=3.75,
            phase=tuple(places[phase]),
        )
        cells = features.log_polar(seen.target(0.4), inner_radius=0.5, interpolation="nearest")
        np.testing.assert_array_equal(found[phase], np.rint(255 * cells))
    # Four places in each of 16 squares, up to two more or less; chance has a spread of that.
    counts, *_ = np.histogram2d(*places.T, bins=4, range=[[0, 1], [0, 1]])
    assert np.abs(counts - 4).max() <= 2


@pytest.mark.parametrize("way", WAYS)
def test_nothing_is_cut_out_where_nothing_tells_ship_from_sea(way):
    masks = silhouettes(look_from(25.0, contrast_at_zero=0.0), way, METHODS, (0, 1), FRAMES)
    assert not masks[0].any()  # matched knows that there is no contrast
    assert masks[1].any()  # a threshold cuts out something, come what may
    maps = log_polar(masks, METHODS, RADII, BETWEEN, (0, 1), FRAMES)
    assert not maps[0].any()


def test_cells_lie_in_the_middle_of_their_steps():
    found = map_cells()
    edges = np.linspace(0, 360, 65), np.linspace(0, 1, 33)
    for name, edge in zip(("angle", "radius"), edges, strict=True):
        np.testing.assert_allclose(found[name], (edge[1:] + edge[:-1]) / 2)

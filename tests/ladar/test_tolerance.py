"""Extents to a tolerance equal those of the lines, and bound their error."""

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh

import ncti.ships
from ncti.ladar import Beam, extent_within, lines_within, range_extent
from ncti.ladar.sampling import sampling_error
from ncti.ladar.tolerance import MIN_SPACING
from ncti.render import View


@pytest.mark.parametrize("pulse_width", [0.0, 30e-9])
@pytest.mark.parametrize("slant_range", [2e3, 80e3])
def test_extent_within_equals_extent_of_lines_within(pulse_width, slant_range):
    ship = ncti.ships.load("texas")
    view = View(33.0, 3.84, slant_range=slant_range)
    options = {"tolerance": 0.002, "pulse_width": pulse_width, "spacing": 0.3}
    lines = lines_within(ship, view, bin_width=0.5, **options)
    expected = range_extent(lines, slant_range=slant_range, bin_width=0.5)
    extent = extent_within(ship, view, beam=Beam(bin_width=0.5), **options)
    assert extent.line_count == expected.line_count == lines.count
    np.testing.assert_array_equal(extent.cell, expected.cell)
    np.testing.assert_array_equal(extent.fraction, expected.fraction)
    np.testing.assert_array_equal(extent.strands, expected.strands)
    assert extent.error_after(pulse_width) <= 0.002


@pytest.mark.parametrize("tolerance", [0.01, 0.001])
def test_bounds_are_within_seven_tenths_of_the_tolerance(tolerance):
    """The remaining margin covers the few errors that exceed their bound."""
    options = {"pulse_width": 20e-9, "tolerance": tolerance}
    for aspect in range(5, 365, 30):
        view = View(aspect, depression=4, slant_range=20e3)
        extent = extent_within(ncti.ships.load("horne"), view, **options)
        assert extent.error_after(20e-9) <= 0.7 * tolerance


def test_error_bound_ignores_scale_and_padding():
    strands = np.random.default_rng(1).uniform(1, 2, (16, 40))
    bound = sampling_error(strands, 400, 20e-9, bin_width=1.0)
    assert 0 < bound < 1
    assert sampling_error(7.0 * strands, 400, 20e-9, bin_width=1.0) == pytest.approx(bound)
    padded = np.pad(strands, ((0, 0), (30, 50)))
    assert sampling_error(padded, 400, 20e-9, bin_width=1.0) == pytest.approx(bound)


def test_unreachable_tolerance_uses_the_finest_spacing():
    box = trimesh.creation.box((2.0, 1.0, 1.0))
    view, options = View(33.0, 3.84), {"pulse_width": 0.0, "tolerance": 5e-324}
    assert lines_within(box, view, **options).spacing == pytest.approx(MIN_SPACING, rel=0.2)
    extent = extent_within(box, replace(view, slant_range=20e3), **options)
    assert extent.error_after(0.0) > 5e-324


def test_sampling_error_of_equal_and_empty_strands():
    assert sampling_error(np.ones((16, 5)), 100, 0.0, bin_width=1.0) == pytest.approx(0, abs=1e-12)
    for strands in (np.zeros((16, 5)), np.eye(16)):
        assert math.isnan(sampling_error(strands, 0, 10e-9, bin_width=1.0))


NEAR = View(33.0, 3.84, slant_range=20e3)


@pytest.mark.parametrize(
    ("function", "given", "said"),
    [
        (lines_within, {"view": (33.0, 3.84)}, "view is .* must be an ncti.render.View"),
        (extent_within, {"view": None}, "view is None, but must be an ncti.render.View"),
        (extent_within, {"view": View(33.0, 3.84)}, "view is of the far field"),
        (extent_within, {"view": replace(NEAR, aspect=361.0)}, "aspect is 361.0 deg"),
        (extent_within, {"beam": 150e-6}, "beam is 0.00015, but must be an ncti.ladar.Beam"),
        (extent_within, {"beam": Beam(ifov=0.0)}, "ifov is 0.0 rad"),
        (extent_within, {"beam": Beam(window=-1.0)}, "window is -1.0 m"),
    ],
)
def test_invalid_views_and_beams_are_refused(function, given, said):
    box = trimesh.creation.box((2.0, 1.0, 1.0))
    with pytest.raises(ValueError, match=said):
        function(box, **{"view": NEAR, "tolerance": 0.01, "pulse_width": 30e-9, **given})

"""Extents to a tolerance: the same by lines and piece by piece, and the bound on their error."""

import math

import numpy as np
import pytest
import trimesh

import ncti.ships
from ncti.ladar import extent_within, lines_within, range_extent
from ncti.ladar.sampling import sampling_error
from ncti.ladar.tolerance import FINEST

VIEW = {"aspect": 33.0, "depression": 3.84, "tolerance": 0.002, "bin_width": 0.5}


@pytest.mark.parametrize("pulse_width", [0.0, 30e-9])
@pytest.mark.parametrize("slant_range", [2e3, 80e3])
def test_an_extent_drawn_in_parts_is_that_of_all_lines(pulse_width, slant_range):
    """At 2 km an IFOV is narrower than the lines drawn first are apart."""
    ship = ncti.ships.load("texas")
    spacing = min(0.75, 150e-6 * slant_range)
    how = VIEW | {"pulse_width": pulse_width, "slant_range": slant_range, "spacing": spacing}
    lines = lines_within(ship, **how)
    whole = range_extent(lines, slant_range=slant_range, bin_width=0.5)
    found = extent_within(ship, **how)
    assert found.line_count == whole.line_count == lines.count
    np.testing.assert_allclose(found.strands, whole.strands, atol=1e-9)
    # a cell of which rounding alone saw some may be in one of them only
    seen = whole.fraction.sum(axis=1) > 1e-6
    assert found.fraction.sum() == pytest.approx(whole.fraction.sum(), rel=1e-12)
    rows = {tuple(cell): row for cell, row in zip(found.cell, found.fraction, strict=True)}
    for cell, row in zip(whole.cell[seen], whole.fraction[seen], strict=True):
        np.testing.assert_allclose(rows[tuple(cell)], row, atol=1e-9)
    order = np.lexsort(found.cell.T)
    np.testing.assert_array_equal(order, np.arange(len(order)))  # by rows, as of one image
    assert found.error_after(pulse_width) == pytest.approx(whole.error_after(pulse_width), rel=1e-9)
    assert found.error_after(pulse_width) <= 0.002


def test_no_line_is_drawn_twice(monkeypatch):
    import ncti.ladar.tolerance as tolerance

    drawn = []
    for name in ("line_image", "between"):
        draw = getattr(tolerance, name)
        monkeypatch.setattr(
            tolerance, name, lambda *a, draw=draw, **k: drawn.append(draw(*a, **k)) or drawn[-1]
        )
    lines = lines_within(ncti.ships.load("duncan"), pulse_width=10e-9, **VIEW)
    assert len(drawn) > 1
    assert sum(len(image.line) for image in drawn) == len(lines.line)
    heights = np.concatenate([(i.line + i.phase) * i.spacing for i in drawn])
    assert np.allclose(np.sort(heights), (lines.line + lines.phase) * lines.spacing, atol=1e-9)


def test_the_bound_is_of_shares_not_of_areas():
    strands = np.random.default_rng(1).uniform(1, 2, (16, 40))
    bound = sampling_error(strands, 400, 20e-9, bin_width=1.0)
    assert 0 < bound < 1
    assert sampling_error(7.0 * strands, 400, 20e-9, bin_width=1.0) == pytest.approx(bound)
    padded = np.pad(strands, ((0, 0), (30, 50)))
    assert sampling_error(padded, 400, 20e-9, bin_width=1.0) == pytest.approx(bound)


@pytest.mark.parametrize("tolerance", [5e-324, 1e-300])
def test_a_tolerance_that_no_lines_meet_takes_the_finest(tolerance):
    box = trimesh.creation.box((2.0, 1.0, 1.0))
    view = {"aspect": 33.0, "depression": 3.84, "pulse_width": 0.0, "tolerance": tolerance}
    assert lines_within(box, **view).spacing == pytest.approx(FINEST, rel=0.2)
    found = extent_within(box, slant_range=20e3, **view)
    assert found.error_after(0.0) > tolerance


def test_strands_that_agree_have_no_error_and_none_an_unknown_one():
    assert sampling_error(np.ones((16, 5)), 100, 0.0, bin_width=1.0) == pytest.approx(0, abs=1e-12)
    assert math.isnan(sampling_error(np.zeros((16, 5)), 0, 0.0, bin_width=1.0))

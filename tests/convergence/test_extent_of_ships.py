"""Range extents of the six ships converge to the sampling-free reference as stated."""

from __future__ import annotations

from functools import cache

import metric
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom

import ncti.ships
from ncti.ladar import Beam, extent_within, lines_within, range_extent
from ncti.ladar.pulse import Pulse, target_response
from ncti.render import View, line_image, range_image
from studies.run_time.reference import reference_range_extent

ship = cache(ncti.ships.load)
SHIPS = ncti.ships.names()
# Bow to beam at the article's altitude.
GRID = [
    (name, float(aspect), metric.DEPRESSION) for name in SHIPS for aspect in (0, 24, 48, 72, 90)
]
# Random views, for bounds that must hold in all of them.
ANY = [
    (name, aspect, depression)
    for number, name in enumerate(SHIPS)
    for aspect, depression in np.random.default_rng(number).uniform((0, 0.3), (180, 12.7), (4, 2))
]


@cache
def truth(name, aspect, depression):
    """Return the reference extent, which takes a quarter of a second."""
    mesh, view = ship(name), {"aspect": aspect, "depression": depression}
    return reference_range_extent(mesh, **view, bin_edges=metric.EDGES, side=metric.SIDE)


@cache
def by_pixels(name, aspect, depression, pixel=0.25):
    mesh, view = ship(name), {"aspect": aspect, "depression": depression}
    return far_extent(range_image(mesh, **view, pixel=pixel, engine="auto"))


@cache
def by_lines(name, aspect, depression, spacing=0.25):
    mesh, view = ship(name), {"aspect": aspect, "depression": depression}
    return far_extent(line_image(mesh, **view, spacing=spacing))


def far_extent(image, **options):
    """Return the range extent from so far away that the view is orthographic."""
    return range_extent(image, slant_range=metric.FAR, ifov=metric.SIDE / metric.FAR, **options)


def ship_errors(extent, views, pulse_width, *sampling):
    """Return the error of the ship's extent, summed over IFOVs, in every view."""
    errors = []
    for view in views:
        area, exact = metric.areas(extent(*view, *sampling)), truth(*view).area
        errors.append(metric.error(area.sum(axis=0), exact.sum(axis=0), pulse_width))
    return np.array(errors)


def ifov_errors(extent, views, pulse_width):
    """Return the error of the extents of the single IFOVs, in every view."""
    errors = []
    for view in views:
        computed, exact = extent(*view), truth(*view)
        cells = sorted({tuple(cell) for cell in (*computed.cell, *exact.cell)})
        area = on_cells(computed.cell, metric.areas(computed), cells)
        errors.append(metric.error(area, on_cells(exact.cell, exact.area, cells), pulse_width))
    return np.array(errors)


def on_cells(cell, area, cells):
    """Return areas arranged by a given list of cells."""
    rows = {tuple(key): row for key, row in zip(cell, area, strict=True)}
    return np.array([rows.get(key, np.zeros(area.shape[1])) for key in cells])


def test_pixel_errors_meet_the_requirement():
    """The error of single IFOVs is at most twice the bounds for the whole ship.

    IFOVs cut the ship into some four pieces a bin, whose errors are independent.
    """
    errors = ship_errors(by_pixels, GRID, metric.PULSE)
    assert np.median(errors) < metric.MEDIAN
    assert errors.max() < metric.WORST
    single = ifov_errors(by_pixels, GRID, metric.PULSE)
    assert np.median(single) < 2.0 * metric.MEDIAN
    assert single.max() < 2.0 * metric.WORST


def test_median_line_error_is_below_one_thousandth():
    """With pulse and 0.25 m spacing the ship's median error is below 0.001, of IFOVs 0.0017."""
    errors = ship_errors(by_lines, GRID + ANY, metric.PULSE)
    assert np.median(errors) < 0.001
    assert errors.max() < 0.005
    single = ifov_errors(by_lines, GRID + ANY, metric.PULSE)
    assert np.median(single) < 0.0017
    assert single.max() < 0.009


@pytest.mark.parametrize("pulse_width", [0.0, metric.PULSE])
@pytest.mark.parametrize(
    ("extent", "steps", "least"),
    [(by_pixels, (0.5, 0.25, 0.125), metric.SLOPE), (by_lines, (1.0, 0.5, 0.25), 1.4)],
)
def test_error_converges_with_sample_spacing(extent, steps, least, pulse_width):
    """An outline of length L meets L/d lines at independent phases, so d^2 sqrt(L/d)."""
    errors = [ship_errors(extent, GRID, pulse_width, step).mean() for step in steps]
    assert metric.slope(steps, errors) > least


@pytest.mark.parametrize("spacing", [1.0, 0.5, 0.25])
@pytest.mark.parametrize("pulse_width", [0.0, 10e-9, metric.PULSE])
def test_line_error_estimate_bounds_the_true_error(spacing, pulse_width):
    """The estimate bounds at least 95 % of errors, and is within three times them in the median.

    Three ships at the article's depression are tested, which is rare among the views that the
    estimate's constants were fitted to.
    """
    views = [view for view in GRID + ANY if view[0] in ("duncan", "roberts", "texas")]
    errors = ship_errors(by_lines, views, pulse_width, spacing)
    bars = np.array([by_lines(*view, spacing).error_after(pulse_width) for view in views])
    assert np.mean(errors <= bars) >= 0.95
    assert np.median(bars / errors) <= 3


TOLERANCES = [1e-2, 1e-3, 2.2e-4]

COVERED = 0.97
"""Share of views in which a bound is stated to hold."""


def most_misses(count, level=1e-3):
    """Return the largest number of failures expected in so many views, at a level."""
    return int(binom.isf(level, count, 1 - COVERED))


@pytest.mark.parametrize("tolerance", TOLERANCES)
def test_tolerance_bounds_the_error_without_excess_lines(tolerance):
    """Stopping once the bound is small enough does not make the bound less reliable."""
    rng = np.random.default_rng(round(1e5 * tolerance))
    results = []
    for name, aspect, depression in ANY:
        pulse_width = rng.choice([0.0, 10e-9, metric.PULSE, 60e-9])
        bins = int(rng.choice([1, 2]))
        options = {"pulse_width": pulse_width, "bin_width": float(bins)}
        lines = lines_within(ship(name), View(aspect, depression), tolerance=tolerance, **options)
        extent = far_extent(lines, bin_width=float(bins))
        exact = truth(name, aspect, depression).area.sum(axis=0).reshape(-1, bins).sum(axis=1)
        p, q = metric.areas(extent).sum(axis=0), exact
        if pulse_width:
            response = target_response(Pulse(pulse_width, float(bins))) ** 2
            p, q = np.convolve(p, response), np.convolve(q, response)
        results.append((np.abs(p - q).sum() / q.sum(), extent.error_after(pulse_width)))
    errors, bars = np.array(results).T
    assert np.all(bars <= tolerance)
    assert np.sum(errors > bars) <= most_misses(len(ANY))
    assert np.sum(errors > tolerance) <= most_misses(len(ANY))
    assert np.median(bars / errors) < 2.4  # 2.0 of many views; a median of 24 scatters by 0.2
    assert np.median(bars) > tolerance / 3


@pytest.mark.parametrize("tolerance", [2e-3, 2e-4])
def test_tolerance_holds_at_finite_range(tolerance):
    """Compare each ship once with the reference at a finite range."""
    rng = np.random.default_rng(round(1e5 * tolerance))
    misses = 0
    for name in SHIPS:
        view = {"aspect": rng.uniform(0, 360), "depression": rng.uniform(0.5, 60)}
        view["slant_range"] = 10 ** rng.uniform(3.7, 5.3)
        options = {"tolerance": tolerance, "pulse_width": metric.PULSE}
        extent = extent_within(ship(name), View(**view), **options)
        exact = reference_range_extent(ship(name), bin_edges=metric.EDGES, **view).area[0]
        true = metric.error(metric.areas(extent).sum(axis=0), exact, metric.PULSE)
        assert extent.error_after(metric.PULSE) <= tolerance
        misses += true > extent.error_after(metric.PULSE)
    assert misses <= most_misses(6)


@settings(deadline=None, max_examples=40)
@given(
    st.tuples(*[st.floats(1, 20)] * 3), st.floats(0, 180), st.floats(0, 12.7), st.floats(2e-3, 2e-2)
)
def test_small_bodies_are_within_the_tolerance(size, aspect, depression, tolerance):
    """Compare with a box's area in closed form, as few lines may agree by chance."""
    body = trimesh.creation.box(size)
    view = View(aspect, depression)
    lines = lines_within(body, view, tolerance=tolerance, pulse_width=metric.PULSE)
    a, d = np.radians([aspect, depression])
    faces = np.prod(size) / np.array(size)
    exact = faces @ np.abs([np.cos(d) * np.cos(a), np.cos(d) * np.sin(a), np.sin(d)])
    assert lines.area.sum() == pytest.approx(exact, rel=2 * tolerance)


@pytest.mark.parametrize(("aspect", "tolerance"), [(181.07, 1e-4), (90.3, 2e-4)])
def test_perpendicular_faces_meet_tolerance_with_curved_wavefront(aspect, tolerance):
    """A wavefront bends by less than 1/1000 bin over a transom, but this affects all its area.

    There is no pulse, because it would blur out area in the wrong one of two bins.
    """
    view = {"aspect": aspect, "depression": 0.0, "slant_range": 31e3}
    mesh = ship("duncan")
    options = {"pulse_width": 0.0, "tolerance": tolerance}
    extent = extent_within(mesh, View(**view), beam=Beam(ifov=0.03, bin_width=2.0), **options)
    edges = np.append(extent.down_range, extent.down_range[-1] + 2.0) - 1.0
    exact = reference_range_extent(mesh, bin_edges=edges, **view).area.sum(0)
    area = extent.fraction.sum(axis=0) * (extent.ifov * extent.slant_range) ** 2
    assert np.abs(area - exact).sum() / exact.sum() <= extent.error < tolerance

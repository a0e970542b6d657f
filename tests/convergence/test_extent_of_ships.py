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

# Bow to beam at the article's altitude; the stern of its missions, and a view from near by.
GRID = [
    (name, float(aspect), metric.DEPRESSION)
    for name in ncti.ships.names()
    for aspect in range(0, 91, 18)
]
OTHERS = [
    (name, *(((175.0, 6.7), (301.0, 15.6))[number % 2]))
    for number, name in enumerate(ncti.ships.names())
]


# Random views, for bounds that must hold in all of them.
ANY = [
    (name, aspect, depression)
    for number, name in enumerate(ncti.ships.names())
    for aspect, depression in np.random.default_rng(number).uniform((0, 0.3), (180, 12.7), (4, 2))
]


@cache
def ship(name):
    return ncti.ships.load(name)


@cache
def truth(name, aspect, depression):
    """Return the reference extent, which takes a quarter of a second."""
    return reference_range_extent(
        ship(name), aspect=aspect, depression=depression, bin_edges=metric.EDGES, side=metric.SIDE
    )


@cache
def rendered(name, aspect, depression, pixel=0.25):
    view = {"aspect": aspect, "depression": depression}
    return far_extent(range_image(ship(name), **view, pixel=pixel, engine="auto"))


@cache
def lined(name, aspect, depression, spacing=0.25):
    view = {"aspect": aspect, "depression": depression}
    return far_extent(line_image(ship(name), **view, spacing=spacing))


def far_extent(image, **options):
    """Return the range extent from so far away that the view is orthographic."""
    return range_extent(image, slant_range=metric.FAR, ifov=metric.SIDE / metric.FAR, **options)


def ship_errors(views, pulse_width, *, extent=rendered, **rendering):
    """Return the error of the ship's extent, summed over IFOVs, in every view."""
    return np.array(
        [
            metric.error(
                metric.areas(extent(*view, **rendering)).sum(axis=0),
                truth(*view).area.sum(axis=0),
                pulse_width,
            )
            for view in views
        ]
    )


def ifov_errors(views, pulse_width, *, extent=rendered):
    """Return the error of the extents of the single IFOVs, in every view."""
    errors = []
    for view in views:
        computed, exact = extent(*view), truth(*view)
        cells = sorted({tuple(cell) for cell in (*computed.cell, *exact.cell)})
        errors.append(
            metric.error(
                on_cells(computed.cell, metric.areas(computed), cells),
                on_cells(exact.cell, exact.area, cells),
                pulse_width,
            )
        )
    return np.array(errors)


def on_cells(cell, area, cells):
    """Return areas arranged by a given list of cells."""
    rows = {tuple(key): row for key, row in zip(cell, area, strict=True)}
    return np.array([rows.get(key, np.zeros(area.shape[1])) for key in cells])


def test_accuracy_after_the_pulse():
    errors = ship_errors(GRID, metric.PULSE)
    assert np.median(errors) < metric.MEDIAN
    assert errors.max() < metric.WORST
    assert ship_errors(OTHERS, metric.PULSE).max() < metric.WORST


def test_accuracy_of_single_ifovs():
    """The error of single IFOVs is at most twice the bounds for the whole ship.

    IFOVs cut the ship into some four pieces a bin, whose errors are independent.
    """
    errors = ifov_errors(GRID, metric.PULSE)
    assert np.median(errors) < 2.0 * metric.MEDIAN
    assert errors.max() < 2.0 * metric.WORST


@pytest.mark.parametrize("pulse_width", [0.0, metric.PULSE])
def test_error_falls_with_the_pixel(pulse_width):
    pixels = [0.5, 0.25, 0.125]
    errors = [ship_errors(GRID, pulse_width, pixel=pixel).mean() for pixel in pixels]
    assert metric.slope(pixels, errors) > metric.SLOPE


def test_lines_err_by_less_than_a_thousandth():
    """With pulse and 0.25 m spacing the ship's median error is below 0.001, of IFOVs 0.0017."""
    views = GRID + ANY
    summed = ship_errors(views, metric.PULSE, extent=lined)
    assert np.median(summed) < 0.001
    assert summed.max() < 0.005
    single = ifov_errors(views, metric.PULSE, extent=lined)
    assert np.median(single) < 0.0017
    assert single.max() < 0.009


@pytest.mark.parametrize("pulse_width", [0.0, metric.PULSE])
def test_error_falls_with_the_spacing_of_lines(pulse_width):
    """An outline of length L meets L/d lines at independent phases, so d^2 sqrt(L/d)."""
    spacings = [1.0, 0.5, 0.25]
    errors = [
        ship_errors(GRID + ANY, pulse_width, extent=lined, spacing=d).mean() for d in spacings
    ]
    assert metric.slope(spacings, errors) > 1.4


@pytest.mark.parametrize("spacing", [1.0, 0.5, 0.25])
@pytest.mark.parametrize("pulse_width", [0.0, 10e-9, metric.PULSE])
def test_lines_know_their_error(spacing, pulse_width):
    """The estimate bounds at least 95 % of errors, and is within three times them in the median.

    Three ships at the article's depression are tested, which is rare among the views that the
    estimate's constants were fitted to.
    """
    views = [view for view in GRID + ANY if view[0] in ("duncan", "roberts", "texas")]
    errors = ship_errors(views, pulse_width, extent=lined, spacing=spacing)
    bars = np.array([lined(*view, spacing=spacing).error_after(pulse_width) for view in views])
    assert np.mean(errors <= bars) >= 0.95
    assert np.median(bars / errors) <= 3


TOLERANCES = [1e-2, 1e-3, 2.2e-4]

COVERED = 0.97
"""Share of views in which a bound is stated to hold."""


def most_misses(count, level=1e-3):
    """Return the largest number of failures expected in so many views, at a level."""
    return int(binom.isf(level, count, 1 - COVERED))


@pytest.mark.parametrize("tolerance", TOLERANCES)
def test_a_tolerance_bounds_the_error_and_costs_no_more_lines_than_it_must(tolerance):
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
def test_a_tolerance_holds_at_the_range_of_the_sensor(tolerance):
    """Compare each ship once with the reference at a finite range."""
    rng = np.random.default_rng(round(1e5 * tolerance))
    misses = 0
    for name in ncti.ships.names():
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
def test_faces_across_the_sight_keep_a_tolerance_that_their_wavefront_bends(aspect, tolerance):
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

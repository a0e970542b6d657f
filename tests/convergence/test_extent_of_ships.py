"""Rendered range extents of the six ships against the sampling-free reference."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from metric import (
    DEPRESSION,
    EDGES,
    FAR,
    MEDIAN,
    PULSE,
    SIDE,
    SLOPE,
    WORST,
    areas,
    error,
    far_extent,
    slope,
)
from reference import reference_range_extent

import ncti.ships
from ncti.ladar import range_extent
from ncti.render import range_image

# Bow to beam at the article's altitude; the stern of its missions, and a view from near by.
GRID = [
    (name, float(aspect), DEPRESSION) for name in ncti.ships.names() for aspect in range(0, 91, 9)
]
OTHERS = [
    (name, aspect, depression)
    for name in ncti.ships.names()
    for aspect, depression in [(175.0, 6.7), (301.0, 15.6)]
]


@cache
def ship(name):
    return ncti.ships.load(name)


@cache
def truth(name, aspect, depression):
    """The reference extent: a quarter of a second."""
    return reference_range_extent(
        ship(name), aspect=aspect, depression=depression, bin_edges=EDGES, side=SIDE
    )


@cache
def rendered(name, aspect, depression, **rendering):
    return far_extent(ship(name), aspect=aspect, depression=depression, **rendering)


def ship_errors(views, pulse_width, **rendering):
    """Error of the ship's whole extent, all IFOVs together, in every view."""
    return np.array(
        [
            error(
                areas(rendered(*view, **rendering)).sum(axis=0),
                truth(*view).area.sum(axis=0),
                pulse_width,
            )
            for view in views
        ]
    )


def ifov_errors(views, pulse_width):
    """Error of the extents of the single IFOVs, in every view."""
    errors = []
    for view in views:
        found, exact = rendered(*view), truth(*view)
        cells = sorted({tuple(cell) for cell in (*found.cell, *exact.cell)})
        errors.append(
            error(
                on_cells(found.cell, areas(found), cells),
                on_cells(exact.cell, exact.area, cells),
                pulse_width,
            )
        )
    return np.array(errors)


def on_cells(cell, area, cells):
    """Areas laid out over a given list of cells."""
    rows = {tuple(key): row for key, row in zip(cell, area, strict=True)}
    return np.array([rows.get(key, np.zeros(area.shape[1])) for key in cells])


def test_accuracy_after_the_pulse():
    errors = ship_errors(GRID, PULSE)
    assert np.median(errors) < MEDIAN
    assert errors.max() < WORST
    assert ship_errors(OTHERS, PULSE).max() < WORST


def test_accuracy_of_single_ifovs():
    """IFOVs cut the ship into some four pieces a bin, whose errors are independent: twice the
    error of the whole."""
    errors = ifov_errors(GRID, PULSE)
    assert np.median(errors) < 2.0 * MEDIAN
    assert errors.max() < 2.0 * WORST


@pytest.mark.parametrize("pulse_width", [0.0, PULSE])
def test_error_falls_with_the_pixel(pulse_width):
    pixels = [0.5, 0.25, 0.125]
    errors = [ship_errors(GRID, pulse_width, pixel=pixel).mean() for pixel in pixels]
    assert slope(pixels, errors) > SLOPE


def test_a_rolled_lattice_samples_ships_more_evenly():
    """A ship's edges are level and upright: along a level lattice their errors add up."""
    level, rolled = ship_errors(GRID, PULSE, roll=0.0), ship_errors(GRID, PULSE)
    assert np.median(rolled) < np.median(level) / 2.0
    assert rolled.max() < level.max() / 2.0


def test_half_a_pixels_extent_is_the_best_spread():
    """Less leaves a deck's pixels a comb of ranges, more leaks past the deck's ends."""
    points, half, whole = (
        np.median(ship_errors(GRID, 0.0, spread=spread)) for spread in (0.0, 0.5, 1.0)
    )
    assert half < points
    assert half < whole


@pytest.mark.parametrize("side", [0.25, 5.0, 15.0, 400.0])
@pytest.mark.parametrize("bin_width", [0.25, 1.0, 2.5])
def test_area_is_conserved(side, bin_width):
    """However area is sorted into IFOVs and bins, it is that of the pixels that see the ship."""
    image = range_image(ship("texas"), aspect=17.0, depression=DEPRESSION, engine="auto")
    extent = range_extent(image, slant_range=FAR, ifov=side / FAR, bin_width=bin_width)
    seen = np.count_nonzero(image.hit) * image.pixel**2
    assert math.isclose(areas(extent).sum(), seen, rel_tol=1e-6)

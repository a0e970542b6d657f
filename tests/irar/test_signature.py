"""Measured images gathered into wider beams keep area and range, and give the same profiles."""

import numpy as np
import pytest
from flown import CLEAN, flight

from ncti import ships
from ncti.irar import Snapshot, Window, correct, fly, measured_extent, segmented, ship_window
from ncti.ladar import expected_profile, range_extent
from ncti.render import range_image


def plate(flown, *, rows, columns, distance, intensity, spacing):
    """Return a snapshot whose pixels are all equal."""
    row = np.arange(round(rows / spacing)) * spacing
    shape = len(row), columns
    return Snapshot(
        Window(0, 0, rows, columns),
        row,
        np.arange(columns, dtype=float),
        np.full(shape, float(intensity)),
        np.full(shape, flown.slant_range + distance),
        np.zeros(shape),
        np.ones(shape, dtype=int),
    )


@pytest.mark.parametrize("spacing", [1.0, 0.1])
def test_a_plate_keeps_its_area_in_its_bin(spacing):
    flown = flight(cnr=100.0)
    image = plate(flown, rows=40, columns=30, distance=7.3, intensity=50, spacing=spacing)
    extent = measured_extent(image, flown, slant_range=100e3)
    # half the intensity of a filled IFOV: half the area of 40 by 30 pixels
    area = extent.fraction.sum() * 15.0**2
    assert area == pytest.approx(0.5 * 40 * 30 * flown.pixel**2)
    filled = extent.fraction.any(axis=0)
    assert extent.down_range[filled] == pytest.approx([7.5])
    assert (extent.fraction <= 1).all()


def test_measured_extent_profile_matches_range_profiler():
    mesh = ships.load("roberts")
    flown = fly(mesh, flight(aspect=90, samples=300, pulse_rate=36e3))
    planned = flown.plan.flight
    scan = flown.record(np.random.default_rng(3))
    window = ship_window(mesh, planned)
    image = segmented(correct(scan, window=window, overscanned=True), planned)
    measured = measured_extent(image, planned, slant_range=100e3)
    drawn = range_image(mesh, aspect=planned.aspect, depression=planned.depression, engine="embree")
    learned = range_extent(drawn, slant_range=100e3)
    profiles = [
        expected_profile(extent, pulse_width=30e-9, cnr=CLEAN, target_free_ifovs=0)
        for extent in (measured, learned)
    ]
    assert np.corrcoef(*profiles)[0, 1] > 0.99

"""The calibration of the bound on the sampling error of lines."""

from types import SimpleNamespace

import numpy as np
import pytest

import ncti.ships
from benchmarks import calibration
from ncti.ladar import range_extent
from ncti.ladar.sampling import FACTOR, ROUGHNESS, STEEPNESS
from ncti.render import line_image

VIEW = {"aspect": 50.0, "depression": 10.0}
IN_USE = FACTOR, STEEPNESS, ROUGHNESS


def test_the_calibrated_bound_is_that_of_range_extents(monkeypatch):
    """By every eighth of fine lines, from the third on, as by those lines alone."""
    asked = SimpleNamespace(ship="duncan", pulse_width=20e-9, bin_width=1.0, **VIEW)
    monkeypatch.setattr(calibration, "random_views", lambda views, seed: [asked])
    monkeypatch.setattr(calibration, "TRUTH", 1 / 16)
    monkeypatch.setattr(calibration, "STEPS", (8,))
    errors = np.array(list(calibration._errors(1, 5)))
    (bound,) = calibration._bound(errors, *IN_USE)
    rng = np.random.default_rng(5)
    phase, first = float(rng.uniform(0, 1)), int(rng.integers(8))
    mesh = ncti.ships.load("duncan")
    some = line_image(mesh, spacing=0.5, phase=(phase + first) / 8, **VIEW)
    extent = range_extent(some, slant_range=1e12, ifov=1e-9)
    assert errors[0, 3] == extent.line_count
    assert bound == pytest.approx(extent.error_after(20e-9) - extent.far_field_error, rel=1e-6)
    assert errors[0, 0] < bound

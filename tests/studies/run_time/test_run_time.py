"""Errors in the study of run times are the library's errors against the exact reference."""

from __future__ import annotations

import numpy as np
import pytest
from commands import opened, swept
from metric import areas

import ncti.ships
from ncti.ladar import range_extent
from ncti.ladar.pulse import Pulse, target_kernel
from ncti.render import line_image, range_image
from studies.run_time.reference import reference_range_extent

SMALL = (
    *("sensor=run_time", "grid.ship=texas", "grid.aspect=60", "render.samples=0"),
    *("grid.pulse_width=30", "grid.frame_count=16", "render.engine=[embree,lines]"),
    *("render.pixel=1", "render.roll=31.7", "ladar.spread=[0,0.5]", "run_time.repeats=1"),
)
SINGLE = ("range", "frame_count", "bin_width")
EDGES = np.arange(-125.0, 126.0)
VIEW = {"aspect": 60.0, "depression": 3.84}
PLACE = {"ship": "texas"}


def test_errors_match_the_library_relative_to_the_reference(tmp_path):
    assert not swept(tmp_path / "s.zarr", tmp_path / "cache", *SMALL).failures
    measured = opened(tmp_path / "s.zarr", "run_time").squeeze(SINGLE)
    ship = ncti.ships.load("texas")
    sight = {"slant_range": 100e3}
    exact = reference_range_extent(ship, **VIEW, **sight, bin_edges=EDGES, side=15.0)
    image = range_image(ship, **VIEW, **sight, pixel=1.0, roll=31.7, engine="embree")
    lines = line_image(ship, **VIEW, **sight, spacing=1.0, roll=31.7)
    kernel = target_kernel(Pulse(30e-9, 1.0), 250) ** 2
    for engine, drawing, spread in (
        ("embree", image, 0.5),
        ("embree", image, 0.0),
        ("lines", lines, 0),
    ):
        extent = range_extent(drawing, spread=spread, **sight)
        row = measured.sel(PLACE | {"engine": engine, "spread": spread})
        p, q = areas(extent).sum(axis=0), exact.area.sum(axis=0)
        assert row.extent_error == pytest.approx(np.abs(p - q).sum() / q.sum(), rel=1e-5)
        error = np.abs(kernel @ (p - q)).sum() / (kernel @ q).sum()
        assert row.profile_error.sel(pulse_width=30) == pytest.approx(error, rel=1e-5)

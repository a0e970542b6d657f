"""Sweeps of small flights: coarse pixels and few lines, in a tenth of a second each."""

from pathlib import Path

import numpy as np
from once import sharing_ships

from sweeps.engine.declare.settings import read_choices
from sweeps.engine.resolve.plan import Plan
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.run.schedule import Callbacks
from sweeps.engine.sweeping import RunOptions, sweep
from sweeps.experiment import EXPERIMENT
from sweeps.stages import flights, measured

SMALL = {"ifov": 500.0, "samples": 60, "line_rate": 60.0, "detectors": 3, "pulse_rate": 4000.0}
GIVEN = {
    "sensor": "irar",
    "grid.ship": "roberts",
    "grid.aspect": 175,
    "grid.pulse_width": 30,
    "render.engine": "embree",
    "render.pixel": 0.5,
    "irar.range": 3,
    **{f"irar.{name}": value for name, value in SMALL.items()},
}

ROOT = ("sensor", "seed")


def read(**given):
    """Choices of small flights; keys have __ for dots, and no group where that is irar."""
    keys = {
        key.replace("__", ".") if "__" in key or key in ROOT else f"irar.{key}": value
        for key, value in given.items()
    }
    return read_choices(EXPERIMENT.declared, GIVEN | keys)


def checked(**given):
    """The same, checked."""
    return measured.check(flights.check(read(**given)))


def flown(folder, name="s", **given):
    """Path of the store of a sweep of small flights; finished cells are kept in the folder."""
    inline = ClusterChoice(kind="inline")
    options = RunOptions(Path(folder) / f"{name}.zarr", sharing_ships(folder / "cache"), inline)
    summary = sweep(Plan(EXPERIMENT, checked(**given)), options, Callbacks(lambda text: None))
    assert not summary.failures
    return options.store


def at(found, **values):
    """One flight past one ship; the first on every other axis."""
    errors = list(
        zip(np.atleast_1d(found.error_parameter), np.atleast_1d(found.error_value), strict=True)
    )
    indices = {"error": errors.index(values.pop("error"))} if "error" in values else {}
    flight = found.isel(indices).sel(values)
    dims = {"source", "down_range", "row", "column", "pulse_width", "kind"}
    return flight.isel({name: 0 for name in flight.dims if name not in dims})


def in_window(found, name, window):
    """An image within its cell's own window; there must be nothing outside."""
    rows = slice(window.bottom, window.bottom + window.rows - 1)
    columns = slice(window.left, window.left + window.columns - 1)
    inside = found[name].sel(row=rows, column=columns)
    assert np.isfinite(found[name]).sum() == np.isfinite(inside).sum()
    return inside.values

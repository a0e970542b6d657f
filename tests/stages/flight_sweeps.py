"""Helpers that sweep small flights: coarse pixels and few lines, a tenth of a second each."""

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
    """Return choices of small flights; keys have __ for dots, and need no group for irar."""
    keys = {
        key.replace("__", ".") if "__" in key or key in ROOT else f"irar.{key}": value
        for key, value in given.items()
    }
    return read_choices(EXPERIMENT.declared, GIVEN | keys)


def checked(**given):
    """Return the same choices, checked."""
    choices = read(**given)
    flights.check(choices)
    return measured.check(choices) or choices


def flown(folder, name="s", **given):
    """Sweep small flights and return the path of the store; the folder keeps finished cells."""
    inline = ClusterChoice(kind="inline")
    options = RunOptions(Path(folder) / f"{name}.zarr", sharing_ships(folder / "cache"), inline)
    summary = sweep(Plan(EXPERIMENT, checked(**given)), options, Callbacks(lambda text: None))
    assert not summary.failures
    return options.store


def at(found, **values):
    """Return one flight past one ship, the first on every axis without a given value."""
    errors = list(
        zip(np.atleast_1d(found.error_parameter), np.atleast_1d(found.error_value), strict=True)
    )
    indices = {"error": errors.index(values.pop("error"))} if "error" in values else {}
    flight = found.isel(indices).sel(values)
    dims = {"source", "down_range", "row", "column", "pulse_width", "kind"}
    return flight.isel({name: 0 for name in flight.dims if name not in dims})


def in_window(found, name, window):
    """Return an image within its cell's window, and assert that it is empty outside."""
    rows = slice(window.bottom, window.bottom + window.rows - 1)
    columns = slice(window.left, window.left + window.columns - 1)
    inside = found[name].sel(row=rows, column=columns)
    assert np.isfinite(found[name]).sum() == np.isfinite(inside).sum()
    return inside.values

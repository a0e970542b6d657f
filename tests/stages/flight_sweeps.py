"""Sweeps of small flights: coarse pixels and few lines, in a tenth of a second each."""

from pathlib import Path

import xarray as xr

from sweeps.engine.cluster import ClusterChoice
from sweeps.engine.run import Place, sweep
from sweeps.engine.schedule import Watch
from sweeps.engine.settings import read_choices
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
    place = Place(Path(folder) / f"{name}.zarr", folder / "cache", ClusterChoice(kind="inline"))
    found = sweep(EXPERIMENT, checked(**given), place, Watch(lambda text: None))
    assert not found.failures
    return place.store


def opened(path, group="validation"):
    """A group of a store."""
    return xr.open_zarr(path, group=group).load()

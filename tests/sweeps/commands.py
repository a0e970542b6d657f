"""Helpers that compose sweeps as the command does, and run them in this process."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr
from once import sharing_ships

from sweeps.app import main, make_command
from sweeps.engine.declare.settings import Choices
from sweeps.engine.resolve.overrides import read_jobs
from sweeps.engine.resolve.plan import Plan
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.run.schedule import Callbacks
from sweeps.engine.run.tasks import drop_objects
from sweeps.engine.sweeping import RunOptions, SweepOutcome, sweep
from sweeps.experiment import EXPERIMENT

COMMAND = make_command()

FAST = ("render.pixel=1", "render.samples=0", "render.engine=embree")
"""Coarse images, for tests that need no exact ones."""


def prepared(*arguments: str) -> list[tuple[Choices, Path]]:
    """Return checked choices and stores of the sweeps of a command line, with `-m` or without."""
    overrides = [argument for argument in arguments if argument != "-m"]
    jobs = read_jobs(EXPERIMENT, overrides, several=len(overrides) < len(arguments))
    return [(plan.choices, options.store) for plan, options in COMMAND.prepare(jobs)]


def chosen(*overrides: str) -> Choices:
    """Return the checked choices of a command line of one sweep."""
    [(choices, _)] = prepared(*overrides)
    return choices


def swept(store: Path, cache: Path, *overrides: str, experiment=EXPERIMENT) -> SweepOutcome:
    """Run one sweep, which writes a store with tables, but no report."""
    drop_objects()  # as a new process would
    choices = chosen(f"store={store}", f"cache={cache}", *overrides)
    options = RunOptions(store, sharing_ships(cache), ClusterChoice(kind="inline"))
    return sweep(Plan(experiment, choices), options, Callbacks(lambda sentence: None))


def ran(*arguments: str, modules=()) -> int:
    """Run the whole command inline in this process, and return its exit status."""
    drop_objects()
    try:
        inline = [] if arguments[0].startswith("--") else ["cluster=inline"]
        main([*arguments, *inline], *modules)
    except SystemExit as status:
        return int(status.code or 0)
    raise AssertionError("the command returned")


def opened(store: Path, group: str) -> xr.Dataset:
    """Return a group of a store, opened as users do, in memory."""
    return xr.open_zarr(store, group=group).load()


def groups_of(store: Path) -> dict[str, xr.Dataset]:
    """Return all groups that have variables, by path."""
    tree = xr.open_datatree(store, engine="zarr", chunks=None)
    return {node.path[1:]: node.to_dataset().load() for node in tree.subtree if node.data_vars}


def assert_slice(store: Path, reference: Path, **place: object) -> set[str]:
    """Assert that a slice of a store equals the store of a sweep of that value, bit for bit.

    Returns the names of all dimensions along which a variable was sliced.
    """
    axes, single = set(), groups_of(reference)
    groups = groups_of(store)
    assert set(groups) == set(single)
    for group, dataset in single.items():
        for name, expected in dataset.data_vars.items():
            array = groups[group][name]
            labels = {dim: value for dim, value in place.items() if dim in array.dims}
            axes |= set(labels)
            sliced = array.sel(labels).squeeze(
                [dim for dim in labels if dim in array.sel(labels).dims]
            )
            sliced = sliced.transpose(*expected.dims)
            # A variable is as large as its largest cell, so that smaller cells are padded.
            sliced = sliced.isel({dim: slice(size) for dim, size in expected.sizes.items()})
            assert sliced.dtype == expected.dtype, (group, name)
            equal = np.array_equal(sliced, expected, equal_nan=array.dtype.kind == "f")
            assert equal, (group, name)
    return axes

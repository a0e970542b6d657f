"""Sweeps of the experiment from this process, and the groups of their stores."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import xarray as xr

from benchmarks.commands import CORES, complete_sweep
from sweeps.engine.declare.settings import Choices
from sweeps.engine.resolve.overrides import read_jobs
from sweeps.engine.resolve.plan import Plan
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.sweeping import RunOptions
from sweeps.experiment import EXPERIMENT
from sweeps.stages.meshes import cache_folder

WORKERS = ClusterChoice("local", workers=CORES)


def choices_of(overrides: Sequence[str]) -> Choices:
    """Return the checked choices of a command line of `ncti-sweep`; builds the ships."""
    [job] = read_jobs(EXPERIMENT, overrides, several=False)
    return EXPERIMENT.check(job.choices)


def sweep_groups(
    overrides: Sequence[str],
    groups: Sequence[str],
    *,
    label: str = "",
    workers: ClusterChoice = WORKERS,
) -> dict[str, xr.Dataset]:
    """Return groups of the store of a sweep by name, read into memory.

    Parameters
    ----------
    overrides : sequence of str
        Arguments of `ncti-sweep`. Results are kept in the user's cache.
    groups : sequence of str
        Names of the groups.
    label : str
        If given, it is printed with the time of the sweep.
    workers : ClusterChoice
        Where cells are computed.

    Raises
    ------
    RuntimeError
        If a cell fails.
    """
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder, "sweep.zarr")
        plan = Plan(EXPERIMENT, choices_of(overrides))
        complete_sweep(plan, RunOptions(store, cache_folder(), workers))
        datasets = {name: xr.open_zarr(store, group=name).load() for name in groups}
    if label:
        print(f"{label}: {time.perf_counter() - start:.0f} s", flush=True)
    return datasets

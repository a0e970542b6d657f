"""Runs of the command `ncti-sweep`: time, memory and work; and sweeps in this process."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.processes import Run, watch
from sweeps.engine.resolve.plan import Plan
from sweeps.engine.run.schedule import Callbacks
from sweeps.engine.sweeping import RunOptions
from sweeps.engine.sweeping import sweep as sweep_plan
from sweeps.stages.meshes import cache_folder

PROGRAM = ("-m", "sweeps.app")
CORES = 2

SUMMARY = re.compile(r"(?P<done>[\d,]+) cells computed, .*; work (?P<work>[\d.]+) s")
"""Of `sweeps.engine.run.progress.summary`."""


@dataclass(frozen=True)
class SweepCost:
    """Time, memory and work of a command.

    Attributes
    ----------
    run : Run
        Time and memory.
    made : int
        Number of cells computed.
    work : float
        Time that all calls of stages took, those of all workers added [s].
    """

    run: Run
    made: int
    work: float

    @property
    def efficiency(self) -> float:
        """Work over cores times wall time, start of the command included."""
        return self.work / (CORES * self.run.seconds)


def new_folder(folder: Path) -> Path:
    """Make a folder for sweeps whose cache holds only the built ships."""
    meshes = cache_folder() / "meshes"
    meshes.mkdir(parents=True, exist_ok=True)
    cache = folder / "cache"
    cache.mkdir(parents=True)
    (cache / "meshes").symlink_to(meshes.absolute(), target_is_directory=True)
    return folder


def sweep(overrides: Sequence[str], folder: Path) -> SweepCost:
    """Run `ncti-sweep` with its cache and the store `sweep.zarr` in a folder.

    Parameters
    ----------
    overrides : sequence of str
        Its other arguments.
    folder : Path
        See `new_folder`.

    Returns
    -------
    SweepCost

    Raises
    ------
    RuntimeError
        If it fails, or prints no summary.
    """
    arguments = [*overrides, f"cache={folder / 'cache'}", f"store={folder / 'sweep.zarr'}"]
    run = watch([sys.executable, *PROGRAM, *arguments], cores=CORES)
    match = SUMMARY.search(run.output)
    if match is None:
        raise RuntimeError(f"`{' '.join([*PROGRAM, *arguments])}` printed no summary of a sweep")
    return SweepCost(run, int(match["done"].replace(",", "")), float(match["work"]))


def complete_sweep(plan: Plan, options: RunOptions) -> None:
    """Sweep a plan in this process silently.

    Raises
    ------
    RuntimeError
        If a cell fails.
    """
    for cell, reason in sweep_plan(plan, options, Callbacks(lambda sentence: None)).failures:
        raise RuntimeError(f"{cell}: {reason}")

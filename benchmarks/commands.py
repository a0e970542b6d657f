"""Runs of the command `ncti-sweep`: time, memory and work; and sweeps in this process."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.processes import Run, watch
from sweeps.engine.resolve.plan import Plan
from sweeps.engine.run.schedule import Watch
from sweeps.engine.store.sweeping import RunOptions
from sweeps.engine.store.sweeping import sweep as sweep_plan
from sweeps.stages.views import cache_folder

PROGRAM = ("-m", "sweeps.app")
CORES = 2

SUMMARY = re.compile(
    r"(?P<done>[\d,]+) cells computed, (?P<reused>[\d,]+) reused, .*; work (?P<work>[\d.]+) s"
)


@dataclass(frozen=True)
class Swept:
    """Time, memory and work of a command.

    Attributes
    ----------
    run : Run
        Time and memory.
    made, reused : int
        Cells that it made, and found.
    work : float
        Time that all calls of stages took, those of all workers added [s].
    """

    run: Run
    made: int
    reused: int
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


def sweep(overrides: Sequence[str], folder: Path) -> Swept:
    """Run `ncti-sweep` with its cache in a folder.

    Parameters
    ----------
    overrides : sequence of str
        Its arguments. With a launcher of Hydra's among them, every job has a store in Hydra's
        folder, else the store is `sweep.zarr` in the folder.
    folder : Path
        See `new_folder`.

    Returns
    -------
    Swept

    Raises
    ------
    RuntimeError
        If it fails, or does not say what it did.
    """
    keys = {"cache": folder / "cache"}
    if any(override.startswith("hydra/") for override in overrides):
        keys["hydra.sweep.dir"] = folder / "hydra"
    else:
        keys["store"] = folder / "sweep.zarr"
    arguments = [*overrides, *(f"{key}={value}" for key, value in keys.items())]
    run = watch([sys.executable, *PROGRAM, *arguments], cores=CORES)
    rows = list(sweeps_printed(run.output))
    if not rows:
        raise RuntimeError(f"`{' '.join([*PROGRAM, *arguments])}` printed no summary of a sweep")
    done, reused, work = (sum(values) for values in zip(*rows, strict=True))
    return Swept(run, int(done), int(reused), work)


def sweeps_printed(output: str) -> Iterator[tuple[int, int, float]]:
    """Yield cells computed, cells reused and work [s] of every sweep of which a command printed.

    The sentences are those of `sweeps.engine.run.progress.summary`.
    """
    for found in SUMMARY.finditer(output):
        done, reused = (int(found[name].replace(",", "")) for name in ("done", "reused"))
        yield done, reused, float(found["work"])


def completed(plan: Plan, options: RunOptions) -> None:
    """Sweep a plan from this process, without a word.

    Raises
    ------
    RuntimeError
        If a cell fails.
    """
    for cell, reason in sweep_plan(plan, options, Watch(lambda sentence: None)).failures:
        raise RuntimeError(f"{cell}: {reason}")

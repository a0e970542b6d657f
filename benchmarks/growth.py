"""Growth of the time of a sweep with its number of cells: at most in proportion."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from benchmarks import toy
from benchmarks.commands import CORES, new_folder, sweep
from benchmarks.phases import timed
from benchmarks.reports import Column, Report, Sample
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.store.sweeping import RunOptions

TOY, SHIPS = "toy", "range profiles"
TOYS = tuple((4, 25, times, 4, 3) for times in (1, 4, 16, 64))  # 1,200 cells, and times that
VIEWS = (2, 8, 32, 128)
"""Numbers of aspects of one ship."""

COLUMNS = (
    Column("grid", "grid"),
    Column("cells", "cells", "d"),
    Column("wall_s", "time [s]", ".2f"),
    Column("cell_ms", "ms a cell", ".3f"),
    Column("slope", "slope", ".2f"),
)


def measure(
    *, repeats: int, toys: Sequence[Sequence[int]] = TOYS, views: Sequence[int] = VIEWS
) -> Report:
    """Time sweeps of 1, 4, 16 and 64 times the cells.

    Parameters
    ----------
    repeats : int
        How often.
    toys : sequence of sequence of int
        Number of values on each axis of a toy that does nothing, see `benchmarks.toy.choices`.
    views : sequence of int
        Numbers of aspects of a ship whose range profiles are swept by the command.

    Returns
    -------
    Report
        One row per grid, the largest of each kind with the slope over all of them.
    """
    kinds: dict[str, list[tuple[int, Callable[[], float]]]] = {
        TOY: [(math.prod(grid), lambda grid=grid: _toy(grid)) for grid in toys],  # type: ignore[misc]
        SHIPS: [(3 * count, lambda count=count: _ships(count)) for count in views],  # type: ignore[misc]
    }
    rows = []
    for kind, grids in kinds.items():
        found: list[list[float]] = [[] for _ in grids]
        for _ in range(repeats):
            for times, (_, run) in zip(found, grids, strict=True):
                times.append(run())
        samples = [Sample.of(times) for times in found]
        cells = [count for count, _ in grids]
        for count, sample in zip(cells, samples, strict=True):
            cell = 1e3 * sample.median / count
            rows.append({"grid": kind, "cells": count, "wall_s": sample, "cell_ms": cell})
        rows[-1]["slope"] = slope(cells, [sample.median for sample in samples])
    return Report(
        f"Time of a sweep by number of cells, {repeats} times",
        COLUMNS,
        rows,
        [
            "Slope: of the logarithm of time against that of cells, least squares; below 1 where "
            "the start counts. Goal: at most 1. Toy: a stage that does nothing, in one process, "
            f"from the engine's start. Range profiles: the command on {CORES} cores, one ship at "
            "three pulse widths, a cell for every aspect and pulse width."
        ],
    )


def slope(cells: Sequence[float], seconds: Sequence[float]) -> float:
    """Return the exponent of the power of the number of cells that fits the time best."""
    return float(np.polyfit(np.log(cells), np.log(seconds), 1)[0])


def _toy(grid: Sequence[int]) -> float:
    with tempfile.TemporaryDirectory() as folder:
        place = RunOptions(
            Path(folder, "sweep.zarr"), Path(folder, "cache"), ClusterChoice("inline")
        )
        return timed(toy.NOTHING, toy.choices(toy.NOTHING, grid), place).total


def _ships(count: int) -> float:
    aspects = ",".join(f"{aspect:.10g}" for aspect in np.linspace(0, 90, count))
    grid = ["grid.ship=[duncan]", "grid.pulse_width=[10,30,50]", f"grid.aspect=[{aspects}]"]
    with tempfile.TemporaryDirectory() as parent:
        return sweep(grid, new_folder(Path(parent, "cold"))).run.seconds

"""The article's grid at three ranges, 22,320 cells: as one job, by `-m`, and Hydra's launcher."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from benchmarks.commands import CORES, Swept, new_folder, sweep
from benchmarks.reports import Column, Report, Sample

Values = Mapping[str, Sequence[str | float]]

GRID: Values = {
    "ship": ("duncan", "horne", "spruance", "texas"),
    "aspect": tuple(range(0, 91, 3)),
    "pulse_width": (10, 30, 50),
    "frame_count": (4, 8, 16, 32),
    "range": (25, 50, 100),
    "vigilance": (0.80, 0.85, 0.90, 0.95, 0.99),
}
HUNDREDTH: Values = {
    **GRID,
    "ship": ("duncan", "horne"),
    "aspect": (0, 45, 90),
    "vigilance": (0.95,),
}
"""216 of its cells, one of 103."""

BASIC_LAUNCHER = ("hydra/launcher=basic", "cluster=inline")
ONE_JOB, MULTIRUN, BASIC = "one job", "-m", "-m hydra/launcher=basic"

COLUMNS = (
    Column("way", "way"),
    Column("cells", "cells", "d"),
    Column("wall_s", "time [s]", ".1f"),
    Column("cell_ms", "ms a cell", ".2f"),
    Column("whole_s", "whole grid [s]", ".0f"),
    Column("ratio", "x one job", ".1f"),
    Column("efficiency", "efficiency", ".2f"),
)


def cells(grid: Values) -> int:
    """Return the number of cells of a grid."""
    return math.prod(map(len, grid.values()))


def listed(grid: Values) -> list[str]:
    """Return overrides that give every axis a list: one job of Hydra's."""
    return [f"grid.{name}=[{','.join(map(str, values))}]" for name, values in grid.items()]


def swept(grid: Values) -> list[str]:
    """Return overrides that sweep every axis: a job of Hydra's for every cell."""
    return [f"grid.{name}={','.join(map(str, values))}" for name, values in grid.items()]


def measure(*, repeats: int, grid: Values = GRID, part: Values = HUNDREDTH) -> Report:
    """Run a grid as one job and as `-m`, and a part of it by Hydra's basic launcher.

    Parameters
    ----------
    repeats : int
        How often.
    grid, part : mapping of str to sequence
        Values by axis, of the whole and of what the basic launcher runs.

    Returns
    -------
    Report
        One row per way.
    """
    ways = {
        ONE_JOB: (grid, listed(grid)),
        MULTIRUN: (grid, ["-m", *swept(grid)]),
        BASIC: (part, ["-m", *BASIC_LAUNCHER, *swept(part)]),
    }
    found: dict[str, list[Swept]] = {way: [] for way in ways}
    for _ in range(repeats):
        for way, (_, overrides) in ways.items():
            with tempfile.TemporaryDirectory() as parent:
                found[way].append(sweep(overrides, new_folder(Path(parent, "cold"))))
    rows = []
    for way, (values, _) in ways.items():
        seconds = [one.run.seconds for one in found[way]]
        whole = [cells(grid) * second / cells(values) for second in seconds]
        alone = zip(whole, found[ONE_JOB], strict=True)
        rows.append(
            {
                "way": way,
                "cells": cells(values),
                "wall_s": Sample.of(seconds),
                "cell_ms": Sample.of(1e3 * second / cells(values) for second in seconds),
                "whole_s": Sample.of(whole),
                "ratio": Sample.of(one / first.run.seconds for one, first in alone),
                "efficiency": Sample.of(one.efficiency for one in found[way]),
            }
        )
    return Report(
        f"A grid of {cells(grid):,} cells on {CORES} cores, {repeats} times",
        COLUMNS,
        rows,
        [
            "A cell is one value of each of the six axes, named by the clustering network. From "
            "start to exit of the command, ships built and nothing else in the cache.",
            f"The basic launcher starts a job a cell, one after the other in one process, with a "
            f"store each and one cache for all; it runs {cells(part)} of them, and the whole grid "
            "counts as the time of as many as it has cells. That favours it: a job has one view "
            "to learn and name, where the others learn all views of all ships, and its workers "
            "need not be started (cluster=inline). It has one core, the others have "
            f"{CORES}.",
        ],
    )

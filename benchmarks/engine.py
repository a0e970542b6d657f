"""Overhead of the sweep engine: time per cell, and memory by number of cells."""

from __future__ import annotations

import math
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks import toy
from benchmarks.phases import timed
from benchmarks.processes import peak_memory, watch
from benchmarks.reports import Column, Report, Sample
from sweeps.engine.declare.settings import Choices
from sweeps.engine.resolve.plan import Plan
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.store.sweeping import RunOptions, preview

GOAL = 0.2  # ms a cell
GRIDS = ((4, 31, 3, 4, 3, 5), (4, 50, 10, 4, 5, 5))  # 22,320 cells, as the article's, and 200,000
CELLS = (4_000, 16_000, 64_000)
WHOLE = "total"
PARTS = ("resolve", "execute", "write")  # of the whole
PHASES = ("plan", *PARTS, WHOLE, "again")
FEW, MANY = 100_000, 10_000_000  # cells of a sweep by worker processes
VIGILANCES = 5  # of it
STEPS = ("dry", "sweep", "again", "more")


def measure(*, repeats: int, grids: Sequence[Sequence[int]] = GRIDS) -> Report:
    """Time sweeps of a stage that does nothing, in one process.

    Parameters
    ----------
    repeats : int
        How often.
    grids : sequence of sequence of int
        Number of values on each axis, see `benchmarks.toy.choices`.

    Returns
    -------
    Report
        One row per grid: time a cell by phase.
    """
    rows: list[dict[str, Any]] = []
    for grid in grids:
        chosen, cells = toy.choices(toy.NOTHING, grid), math.prod(grid)
        _keys(chosen)  # reads the code behind the stage, once a process
        taken: dict[str, list[float]] = {phase: [] for phase in PHASES}
        for _ in range(repeats):
            for phase, seconds in _once(chosen).items():
                taken[phase].append(1e3 * seconds / cells)
        samples = {phase: Sample.of(values) for phase, values in taken.items()}
        rows.append(
            {"cells": cells}
            | {f"{phase}_ms": sample.median for phase, sample in samples.items()}
            | {f"{WHOLE}_ms": samples[WHOLE]}
        )
    return Report(
        f"Engine, a stage that does nothing, in one process, {repeats} times",
        (
            Column("cells", "cells", "d"),
            *(Column(f"{phase}_ms", f"{phase} [ms]", ".3f") for phase in PHASES),
        ),
        rows,
        [
            f"A cell, median (lowest–highest). Goal: a total of {GOAL:g} ms. Resolve: what comes "
            "before the first call; plan: what keys of all cells take of it, timed on a plan of "
            "their own; write: the store. Again: the same sweep, all cells reused. The code behind "
            "the stage, which a process reads once, is read before."
        ],
    )


def _once(chosen: Choices) -> dict[str, float]:
    """Return the seconds of every phase of one sweep, and of its repetition."""
    plan = _keys(chosen)
    with tempfile.TemporaryDirectory() as folder:
        place = _inline(Path(folder))
        first, again = (timed(toy.NOTHING, chosen, place) for _ in range(2))
    return {
        "plan": plan,
        "resolve": first.resolved,
        "execute": first.executed,
        "write": first.written,
        WHOLE: first.total,
        "again": again.total,
    }


def _keys(chosen: Choices) -> float:
    """Return the seconds that a plan and the keys of its cells take."""
    start = time.perf_counter()
    plan = Plan(toy.NOTHING, chosen)
    for bound in plan.targets:
        plan.keys(bound)
    return time.perf_counter() - start


def _inline(folder: Path) -> RunOptions:
    return RunOptions(folder / "sweep.zarr", folder / "cache", ClusterChoice("inline"))


def measure_memory(*, repeats: int, cells: Sequence[int] = CELLS) -> Report:
    """Measure the memory of a process that runs a sweep of 1,000 floats a cell.

    Parameters
    ----------
    repeats : int
        How often.
    cells : sequence of int
        Numbers of cells.

    Returns
    -------
    Report
        One row per number of cells: peak of the process, and what a further cell adds to it.
    """
    rows, base = [], 0.0
    for count in cells:
        found = [_in_new_process(count) for _ in range(repeats)]
        peak = Sample.of(after for _, after in found)
        base = base or peak.median
        row = {
            "cells": count,
            "results_mib": 4 * toy.LENGTH * count / 2**20,
            "before_mib": Sample.of(before for before, _ in found),
            "peak_mib": peak,
        }
        if count > cells[0]:
            row["bytes_a_cell"] = (peak.median - base) * 2**20 / (count - cells[0])
        rows.append(row)
    return Report(
        f"Memory of a sweep with {toy.LENGTH:,} floats a cell, in one process, {repeats} times",
        (
            Column("cells", "cells", "d"),
            Column("results_mib", "results [MiB]", ".0f"),
            Column("before_mib", "before it [MiB]", ".0f"),
            Column("peak_mib", "peak [MiB]", ".0f"),
            Column("bytes_a_cell", "a further cell [B]", ".0f"),
        ),
        rows,
        [
            "Peak of the resident memory of a new process, everything imported before; it makes "
            "the cells and writes the store. A further cell: over the first row. Expected: far "
            f"below the {4 * toy.LENGTH:,} B of its result, which is kept on disk."
        ],
    )


def _in_new_process(cells: int) -> tuple[float, float]:
    code = f"from benchmarks.engine import peaks; print(*peaks({cells}))"
    before, after = watch([sys.executable, "-c", code], cores=1).output.split()
    return float(before), float(after)


def peaks(cells: int) -> tuple[float, float]:
    """Return the peak memory of this process before and after a sweep of some cells [MiB]."""
    chosen = toy.choices(toy.PROFILES, (1, cells))
    before = peak_memory()
    with tempfile.TemporaryDirectory() as folder:
        timed(toy.PROFILES, chosen, _inline(Path(folder)))
    return before, peak_memory()


def measure_cells(*, most: int = MANY) -> Report:
    """Time sweeps of a stage that does nothing on two worker processes, each in a new process.

    Parameters
    ----------
    most : int
        Largest number of cells, from 100,000 on in steps of ten.

    Returns
    -------
    Report
        One row per number of cells: times of a dry run, the sweep, the same again, and with one
        more value on an axis, and the peak memory of each.
    """
    rows: list[dict[str, Any]] = []
    while (cells := FEW * 10 ** len(rows)) <= most:
        with tempfile.TemporaryDirectory() as folder:
            row: dict[str, Any] = {"cells": cells}
            for step in STEPS:
                call = f"many({cells}, {step!r}, {folder!r})"
                code = f"from benchmarks.engine import many; print(*{call})"
                run = watch([sys.executable, "-c", code], cores=2)
                seconds, peak = map(float, run.output.split())
                row |= {step: seconds, f"{step}_mib": peak}
        row["sweep_ms"] = 1e3 * row["sweep"] / cells
        row["more_ms"] = 1e3 * row["more"] / (cells / VIGILANCES)
        rows.append(row)
    return Report(
        "Sweeps of a stage that does nothing, on two worker processes",
        (
            Column("cells", "cells", ",d"),
            Column("dry", "dry run [s]", ".1f"),
            Column("sweep_ms", "time a cell [ms]", ".4f"),
            Column("again", "again [s]", ".1f"),
            Column("more_ms", "time a further cell [ms]", ".4f"),
            *(Column(f"{step}_mib", f"{step} [MiB]", ".0f") for step in STEPS),
        ),
        rows,
        [
            "Each once, in a process of its own. Time a cell: with start of workers and store. "
            "Again: the same sweep, whose store has everything. A further cell: of one more value "
            "on an axis of five. Memory is that of the command."
        ],
    )


def many(cells: int, step: str, folder: str) -> tuple[float, float]:
    """Return the seconds of a step of a sweep in a folder, and the peak memory [MiB]."""
    # Four ships, and five values of each other axis but the aspects.
    vigilances = VIGILANCES + (step == "more")
    chosen = toy.choices(toy.NOTHING, (4, cells // 2500, 5, 5, 5, vigilances))
    place = RunOptions(Path(folder, "s.zarr"), Path(folder, "cache"), ClusterChoice("local", 2))
    start = time.perf_counter()
    if step == "dry":
        preview(Plan(toy.NOTHING, chosen), place)
    else:
        timed(toy.NOTHING, chosen, place)
    return time.perf_counter() - start, peak_memory()

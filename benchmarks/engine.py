"""Overhead of the sweep engine: time and memory of sweeps whose stage does nothing."""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks import toy
from benchmarks.commands import complete_sweep
from benchmarks.processes import peak_memory, watch
from benchmarks.reports import Column, Report
from sweeps.engine.resolve.plan import Plan
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.sweeping import RunOptions, preview

FEW, MANY = 100_000, 10_000_000  # cells
VIGILANCES = 5
STEPS = ("dry", "sweep", "again", "more")


def measure(*, most: int = MANY) -> Report:
    """Time sweeps of a stage that does nothing on two worker processes, each in a new process.

    Parameters
    ----------
    most : int
        Largest number of cells; the numbers grow from 100,000 by factors of ten.

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
                call = f"time_sweep({cells}, {step!r}, {folder!r})"
                code = f"from benchmarks.engine import time_sweep; print(*{call})"
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


def time_sweep(cells: int, step: str, folder: str) -> tuple[float, float]:
    """Return the seconds of a step of a sweep in a folder, and the peak memory [MiB]."""
    # Four ships, and five values of each other axis but the aspects.
    vigilances = VIGILANCES + (step == "more")
    chosen = toy.choices(toy.NOTHING, (4, cells // 2500, 5, 5, 5, vigilances))
    options = RunOptions(Path(folder, "s.zarr"), Path(folder, "cache"), ClusterChoice("local", 2))
    start = time.perf_counter()
    plan = Plan(toy.NOTHING, chosen)
    if step == "dry":
        preview(plan, options)
    else:
        complete_sweep(plan, options)
    return time.perf_counter() - start, peak_memory()

"""The article's whole experiment by its command: cold, again, and with one more value."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from benchmarks.commands import CORES, SweepCost, new_folder, sweep
from benchmarks.reports import Column, Report, Sample

COLD, BUSY, AGAIN = "cold, ships built", "cold, beside a busy process", "again"
EXPERIMENT = ("+experiment=paper",)
MORE = {
    "one more vigilance": "grid.vigilance=[0.80,0.85,0.90,0.95,0.97,0.99]",
    "one more aspect": f"grid.aspect=[{','.join(map(str, (*range(0, 91, 3), 91)))}]",
    "one more pulse width": "grid.pulse_width=[10,20,30,50]",
}
"""Additions to the finished store: overrides that include the experiment's values."""

COLUMNS = (
    Column("step", "step"),
    Column("cells", "made", "d"),
    Column("wall_s", "time [s]", ".1f"),
    Column("ratio", "x cold", ".2f"),
    Column("work_s", "work [s]", ".1f"),
    Column("efficiency", "efficiency", ".2f"),
    Column("cpu_s", "of processors", ".1f"),
    Column("together_mib", "all [MiB]", ".0f"),
    Column("largest_mib", "largest", ".0f"),
)


def measure(
    *, repeats: int, experiment: Sequence[str] = EXPERIMENT, more: Mapping[str, str] = MORE
) -> Report:
    """Run an experiment with ships built, the same again, and with one value more on an axis.

    Parameters
    ----------
    repeats : int
        How often to do all of it.
    experiment : sequence of str
        Arguments of the command.
    more : mapping of str to str
        Further argument by name of the step. Each is added to its own copy of the finished store.

    Returns
    -------
    Report
        One row per step.
    """
    steps: dict[str, list[SweepCost]] = {step: [] for step in (COLD, BUSY, AGAIN, *more)}
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as parent:
            folder = new_folder(Path(parent, "cold"))
            steps[COLD].append(sweep(experiment, folder))
            with _keep_busy():
                steps[BUSY].append(sweep(experiment, new_folder(Path(parent, "busy"))))
            steps[AGAIN].append(sweep(experiment, folder))
            for step, override in more.items():
                copy = Path(shutil.copytree(folder, Path(parent, "more"), symlinks=True))
                steps[step].append(sweep([*experiment, override], copy))
                shutil.rmtree(copy)
    rows = []
    for step, runs in steps.items():
        cold = zip(runs, steps[COLD], strict=True)
        rows.append(
            {
                "step": step,
                "cells": runs[0].made,
                "wall_s": Sample.of(swept.run.seconds for swept in runs),
                "ratio": Sample.of(swept.run.seconds / first.run.seconds for swept, first in cold),
                "work_s": Sample.of(swept.work for swept in runs).median,
                "efficiency": Sample.of(swept.efficiency for swept in runs).median,
                "cpu_s": Sample.of(swept.run.cpu for swept in runs).median,
                "together_mib": Sample.of(swept.run.together for swept in runs).median,
                "largest_mib": Sample.of(swept.run.largest for swept in runs).median,
            }
        )
    return Report(
        f"`ncti-sweep {' '.join(experiment)}` on {CORES} cores, {repeats} times",
        COLUMNS,
        rows,
        [
            "From start to exit of the command, workers started and tables printed. Again: the "
            "same command, all reused. One more: added to the finished store and its cache. Busy: "
            "another process computes all the time, so that a core less is left. "
            "Work: time of all calls of stages, as the command prints it to 0.1 s; a worker's "
            f"first call of a stage imports it. Efficiency: work over {CORES} times the time. "
            "Expected: under 30 s cold, under 2 GiB.",
            "Memory of all processes together, pages that they share counted once, and of the "
            "largest alone: highest of some twenty looks a second.",
        ],
    )


@contextmanager
def _keep_busy() -> Iterator[None]:
    """Keep a process computing meanwhile."""
    busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        yield
    finally:
        busy.kill()
        busy.wait()

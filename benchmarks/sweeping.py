"""Parts of the experiment, swept from this process and reported by stage and phase."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.phases import Timed
from benchmarks.reports import Column, Report, Sample
from sweeps.engine.declare.settings import Choices
from sweeps.engine.resolve.overrides import read_jobs
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.store.sweeping import RunOptions
from sweeps.experiment import EXPERIMENT

CORES = 2
WHOLE = "all together"

COLUMNS = (
    Column("part", "part"),
    Column("cells", "cells", "d"),
    Column("work_s", "work [s]", ".2f"),
    Column("wall_s", "time [s]", ".2f"),
    Column("efficiency", "efficiency", ".2f"),
)


def choices_of(overrides: Sequence[str]) -> Choices:
    """Return the checked choices of a command line of `ncti-sweep`; builds the ships."""
    [job] = read_jobs(EXPERIMENT, overrides, several=False)
    return EXPERIMENT.check(job.choices)


def on_workers(folder: Path, store: str) -> RunOptions:
    """Return the place of a sweep on `CORES` worker processes, its cache in a folder."""
    return RunOptions(folder / store, folder / "cache", ClusterChoice("local", workers=CORES))


def by_stage(title: str, runs: Sequence[Timed], stages: Iterable[str], notes: list[str]) -> Report:
    """Return the report of some sweeps: work of each stage, then time of each phase.

    Parameters
    ----------
    title : str
        Title.
    runs : sequence of Timed
        Repetitions of one sweep.
    stages : iterable of str
        Names of the stages that it ran.
    notes : list of str
        Further notes.
    """
    cells = {name: runs[0].progress[name].done for name in stages}
    rows: list[dict[str, Any]] = [
        {
            "part": name,
            "cells": count,
            "work_s": Sample.of(run.progress[name].seconds for run in runs),
        }
        for name, count in cells.items()
        if count
    ]
    phases: dict[str, Callable[[Timed], float]] = {
        "look up": lambda run: run.resolved,
        "workers and calls": lambda run: run.executed,
        "store and tables": lambda run: run.written,
    }
    for name, phase in phases.items():
        rows.append({"part": name, "wall_s": Sample.of(map(phase, runs))})
    rows.append(
        {
            "part": WHOLE,
            "cells": sum(cells.values()),
            "work_s": Sample.of(run.work for run in runs),
            "wall_s": Sample.of(run.total for run in runs),
            "efficiency": Sample.of(run.work / (CORES * run.total) for run in runs),
        }
    )
    return Report(
        f"{title}, {CORES} workers, {len(runs)} times",
        COLUMNS,
        rows,
        [
            "Median (lowest–highest). Work: time of all calls of a stage, workers added. Time: "
            "from the engine's start, workers started and the store written. Efficiency: work "
            f"over {CORES} times the time.",
            *notes,
        ],
    )

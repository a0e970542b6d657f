"""Wall times of a command's steps, measured by its parent process [s]."""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

from benchmarks.commands import CORES, PROGRAM
from benchmarks.reports import Column, Report, Sample

SMOKE, PAPER = ("+experiment=smoke",), ("+experiment=paper",)
REFUSED = ("grid.aspect=-1",)
PROFILE = "import ncti; ncti.simulate.range_profile('duncan', aspect=37)"
PLANNED, DONE = "cells to compute", "cells computed"
ROOT = Path(__file__).resolve().parent.parent


@dataclass(frozen=True)
class WaitingTime:
    """Times of a command from its start [s]; NaN for steps that it lacks.

    `planned` and `done` are the times of these messages; `work` is the time of all calls of stages.
    """

    end: float
    planned: float = math.nan
    done: float = math.nan
    work: float = math.nan


COLUMNS = (
    Column("step", "step"),
    Column("planned", "planned [s]", ".1f"),
    Column("done", "cells done", ".1f"),
    Column("ideal", f"work on {CORES} cores", ".1f"),
    Column("report", "report, exit", ".1f"),
    Column("end", "end", ".1f"),
    Column("ratio", "ratio", ".2f"),
)


def measure(*, repeats: int, against: Path | None = None) -> Report:
    """Time the waits of a user in this checkout, or in it and another in turn.

    Parameters
    ----------
    repeats : int
        How often.
    against : Path, optional
        Another checkout: the last column has the median of ratios of pairs.

    Returns
    -------
    Report
        One row per step.
    """
    checkouts = [ROOT] if against is None else [ROOT, against]
    times: list[defaultdict[str, list[WaitingTime]]] = [defaultdict(list) for _ in checkouts]
    for _ in range(repeats):
        for checkout, by_step in zip(checkouts, times, strict=True):
            for step, waited in steps(checkout):
                by_step[step].append(waited)
    rows = []
    for step, ours in times[0].items():
        sample = {
            field.name: Sample.of(getattr(waited, field.name) for waited in ours).median
            for field in fields(WaitingTime)
        }
        row = {
            "step": step,
            "ideal": sample["work"] / CORES,
            "report": sample["end"] - sample["done"],
            "end": Sample.of(waited.end for waited in ours),
        }
        if against is not None:
            pairs = zip(ours, times[1][step], strict=True)
            row["ratio"] = Sample.of(waited.end / other.end for waited, other in pairs)
        # Leave out NaN, which differs from itself.
        rows.append({name: value for name, value in (sample | row).items() if value == value})
    return Report(
        f"What a user waits for, on {CORES} cores, {repeats} times",
        COLUMNS,
        rows,
        [
            "Seconds from the start of the command to the line that says so. Compiled: the "
            "loops are, and neither ships nor cells are there. Ratio: to another checkout, "
            "in pairs (`--against PATH`)."
        ],
    )


def steps(checkout: Path) -> list[tuple[str, WaitingTime]]:
    """Return the steps of a new user of a checkout, in order, with their times."""
    with tempfile.TemporaryDirectory() as parent:
        home = Path(parent)
        environment = os.environ | {"PYTHONPATH": str(checkout), "XDG_CACHE_HOME": str(home)}
        environment |= {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
        for name in ("SWEEP_CACHE", "NUMBA_CACHE_DIR"):  # would come first
            environment.pop(name, None)

        def command_run(*arguments: str, status: int = 0) -> Callable[[], WaitingTime]:
            def run() -> WaitingTime:
                return time_command([*PROGRAM, *arguments], home, environment, status)

            return run

        def uncached_run(*arguments: str) -> Callable[[], WaitingTime]:
            def run() -> WaitingTime:
                shutil.rmtree(home / "cells", ignore_errors=True)
                return command_run(*arguments, f"cache={home}/cells")()

            return run

        def run_profile() -> WaitingTime:
            return time_command(["-c", PROFILE], home, environment, 0)

        runs = {
            "--help": command_run("--help"),
            "refusal": command_run(*REFUSED, status=2),
            "range profile, first": run_profile,
            "range profile, again": run_profile,
            "smoke, first": uncached_run(*SMOKE, f"store={home}/first.zarr"),
            "smoke, compiled": uncached_run(*SMOKE, f"store={home}/smoke.zarr"),
            "paper, compiled": uncached_run(*PAPER, f"store={home}/paper.zarr"),
            "paper, again": command_run(*PAPER, f"store={home}/paper.zarr", f"cache={home}/cells"),
        }
        return [(step, run()) for step, run in runs.items()]


def time_command(
    arguments: Sequence[str], folder: Path, environment: Mapping[str, str], status: int
) -> WaitingTime:
    """Return the times of a command in a folder; RuntimeError if its exit status differs."""
    start = time.perf_counter()
    seconds: dict[str, float] = {}
    work = math.nan
    command = [sys.executable, *arguments]
    with subprocess.Popen(
        command,
        cwd=folder,
        env=dict(environment),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stderr is not None
        for line in process.stderr:
            now = time.perf_counter() - start
            for phrase in (PLANNED, DONE):
                if phrase in line:
                    seconds[phrase] = now
            if match := re.search(r"work ([\d.]+) s", line):
                work = float(match[1])
    if process.returncode != status:
        raise RuntimeError(f"`{' '.join(command)}` exited with {process.returncode}")
    end = time.perf_counter() - start
    return WaitingTime(
        end,
        seconds.get(PLANNED, math.nan),
        seconds.get(DONE, math.nan),
        work,
    )

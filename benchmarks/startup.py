"""Time of the command with little to do: its help, and a sweep that is already finished."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.commands import CORES, PROGRAM, new_folder, sweep
from benchmarks.processes import watch
from benchmarks.reports import Column, Report, Sample

HELP, AGAIN, WORDS = "--help", "nothing to do", "first words"
EXPERIMENT = ("+experiment=smoke",)

COLUMNS = (
    Column("step", "step"),
    Column("wall_s", "time [s]", ".2f"),
    Column("cpu_s", "of processors [s]", ".2f"),
)


def measure(*, repeats: int, experiment: Sequence[str] = EXPERIMENT) -> Report:
    """Time the start of the command.

    Parameters
    ----------
    repeats : int
        How often.
    experiment : sequence of str
        Arguments of the sweep that has nothing to do.

    Returns
    -------
    Report
        One row per step: time, and time of processors where the command runs to its end.
    """
    with tempfile.TemporaryDirectory() as parent:
        folder = new_folder(Path(parent, "done"))
        sweep(experiment, folder)  # what there is then

        def help_text() -> tuple[float, float | None]:
            run = watch([sys.executable, *PROGRAM, "--help"], cores=CORES)
            return run.seconds, run.cpu

        def again() -> tuple[float, float | None]:
            run = sweep(experiment, folder).run
            return run.seconds, run.cpu

        def words() -> tuple[float, float | None]:
            return first_words(
                [*experiment, f"cache={parent}/new", f"store={parent}/new.zarr"]
            ), None

        steps: dict[str, Callable[[], tuple[float, float | None]]] = {
            HELP: help_text,
            AGAIN: again,
            WORDS: words,
        }
        taken: dict[str, list[tuple[float, float | None]]] = {step: [] for step in steps}
        for _ in range(repeats):
            for step, run in steps.items():
                taken[step].append(run())
    rows: list[dict[str, Any]] = []
    for step, found in taken.items():
        cpu = [one for _, one in found if one is not None]
        row = {"step": step, "wall_s": Sample.of(seconds for seconds, _ in found)}
        rows.append({**row, "cpu_s": Sample.of(cpu).median} if cpu else row)
    return Report(
        f"Start of `ncti-sweep` on {CORES} cores, {repeats} times",
        COLUMNS,
        rows,
        [
            f"Nothing to do: `{' '.join(experiment)}` when its store is whole, tables printed. "
            "First words: the same without store and cache, until the first output. "
            "Goal: --help in at most 1.2 s."
        ],
    )


def first_words(arguments: Sequence[str]) -> float:
    """Return the time until the command prints anything [s]; it is stopped then.

    Raises
    ------
    RuntimeError
        If it prints nothing.
    """
    start = time.perf_counter()
    command = [sys.executable, *PROGRAM, *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        seconds = time.perf_counter() - start
        process.terminate()
        process.stdout.read()
    if not line:
        raise RuntimeError(f"`{' '.join(command)}` printed nothing")
    return seconds

"""The source's whole experiment, as one types it: time and memory."""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

from sweeps.benchmark.processes import Run, watch
from sweeps.benchmark.reports import Column, Report, Sample

CORES = 2
NOTHING, SHIPS, ALL = "nothing", "the ships", "everything"
"""What a run finds in its cache."""

COLUMNS = (
    Column("at_hand", "at hand"),
    Column("wall_s", "time [s]", ".1f"),
    Column("cpu_s", "of processor [s]", ".1f"),
    Column("together_mib", "memory [MiB]", ".0f"),
    Column("largest_mib", "its largest process", ".0f"),
)


def measure(*, repeats: int, experiment: str = "paper") -> Report:
    """Run an experiment with an empty cache, with ships in it, and with everything.

    Parameters
    ----------
    repeats : int
        How often to do all three.
    experiment : str
        Its name.

    Returns
    -------
    Report
        One row for each state of the cache.
    """
    runs: dict[str, list[Run]] = {NOTHING: [], SHIPS: [], ALL: []}
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as folder:
            empty, built = Path(folder, "empty"), Path(folder, "built")
            runs[NOTHING].append(_sweep(experiment, empty))
            shutil.copytree(empty / "meshes", built / "meshes")
            runs[SHIPS].append(_sweep(experiment, built))
            runs[ALL].append(_sweep(experiment, built))
    rows = [
        {
            "at_hand": at_hand,
            "wall_s": Sample.of(run.seconds for run in found),
            "cpu_s": Sample.of(run.cpu for run in found),
            "together_mib": Sample.of(run.together for run in found),
            "largest_mib": Sample.of(run.largest for run in found),
        }
        for at_hand, found in runs.items()
    ]
    return Report(
        f"`ncti-sweep +experiment={experiment}` on {CORES} cores, {repeats} times",
        COLUMNS,
        rows,
        [
            "From start to exit of the command, workers started and tables printed. Expected: "
            "under 30 s with the ships at hand, under 2 GiB.",
            "Memory of all processes together, pages that they share counted once, and of the "
            "largest alone: highest of some twenty looks a second.",
        ],
    )


def _sweep(experiment: str, cache: Path) -> Run:
    """Run a sweep into a new store, which is removed."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "sweeps.app", f"+experiment={experiment}"]
        keys = {
            "cache": cache,
            "store": Path(folder, "sweep.zarr"),
            "hydra.run.dir": Path(folder, "hydra"),
        }
        return watch([*command, *(f"{key}={value}" for key, value in keys.items())], cores=CORES)

"""Cost of a view by number of views: time, memory, files and bytes of one sweep that grows."""

from __future__ import annotations

import csv
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from benchmarks import processes
from benchmarks.commands import CORES, new_folder, sweep
from benchmarks.reports import Column, Report
from sweeps.engine.declare.settings import Run
from sweeps.stages.classifier import draw_aspects
from sweeps.stages.views import Grid

SHIPS = ("connole", "duncan", "horne", "roberts", "spruance", "texas")
SCENE = (
    "sensor=range",
    "classifier.name=[correlation]",
    "render.engine=lines",
    "grid.pulse_width=30",
    "grid.frame_count=16",
)
LAST_ASPECT = 90.0  # last aspect [deg]
STEPS = (0.45, 0.15, 0.05, 0.025)
"""Steps of the aspects [deg] where all views are learned, so that each is compared with all."""

SPACING = 1.5  # of the aspects learned, where others are drawn at random [deg]
RANDOM_COUNTS = (50, 200, 600, 1200)
"""Numbers of random aspects in every 30 degrees, which are tested and not learned."""

RANGES = (25, 50, 75, 100, 150, 200, 250, 300, 400, 500)
"""Ranges [km] of the largest sweeps: as aspects drawn are rounded, a million views need several."""

RANDOM_COUNTS_AT_RANGES = (35, 541, 6140)
"""Numbers of random aspects in every 30 degrees there, for some 10^4, 10^5 and 10^6 views."""

LEARNED, RANDOM = "all learned", f"every {SPACING}° learned"
AT_RANGES = f"{RANDOM}, {len(RANGES)} ranges"
MAX_VIEWS = 12_000  # views of a sweep, unless asked otherwise
MIN_VIEWS = 1_300  # so that there is a sweep of each kind

# Columns of stages; all others share one.
STAGES = {"offset_extent": "extent", "averaged": "averages", "correlation": "matching"}

COLUMNS = (
    Column("kind", "views"),
    Column("views", "number", ",d"),
    Column("wall_s", "time [s]", ".0f"),
    Column("cpu_ms", "processor [ms a view]", ".2f"),
    Column("extent", "image and extent [%]", ".0f"),
    Column("averages", "averages [%]", ".0f"),
    Column("matching", "matching [%]", ".0f"),
    Column("others", "other stages [%]", ".0f"),
    Column("driver_mib", "command [MiB]", ".0f"),
    Column("worker_mib", "largest worker [MiB]", ".0f"),
    Column("tables_s", "tables [s]", ".1f"),
    Column("tables_mib", "tables [MiB]", ".0f"),
    Column("page_s", "page [s]", ".1f"),
    Column("page_mib", "page [MiB]", ".0f"),
    Column("files", "files", "d"),
    Column("store_mb", "store [MB]", ".1f"),
    Column("cache_mb", "cache [MB]", ".0f"),
)


def measure(*, max_views: int = MAX_VIEWS, scene: Sequence[str] = SCENE) -> Report:
    """Measure sweeps of six ships by the laser radar at growing numbers of views.

    Parameters
    ----------
    max_views : int
        Largest number of views of a sweep.
    scene : sequence of str
        Further arguments of the command.

    Returns
    -------
    Report
        One row per sweep, each measured once.
    """
    sweeps = [(kind, views, aspects) for kind, views, aspects in grids() if views <= max_views]
    return Report(
        f"Cost of a view of `ncti-sweep {' '.join(scene)}`, {len(SHIPS)} ships, {CORES} cores",
        COLUMNS,
        [_row(kind, views, [*scene, *aspects]) for kind, views, aspects in sweeps],
        [
            "Processor time is that of all processes from the start of the command to its end; "
            "percentages are shares of the time of all calls of stages. Memory is the most that "
            "the command's own process held, and the largest of its workers. Files are those of "
            "the store, and the cache begins empty. Tables are those of `ncti-report`, the page "
            "that of `ncti-report --html`, with their processor time. Every sweep is measured once."
        ],
    )


def grids() -> list[tuple[str, int, tuple[str, ...]]]:
    """Return kind, number of views, and aspects as arguments, of all sweeps of the report."""

    def grid(
        kind: str, step: float, drawn: int, ranges: Sequence[float] = (Grid.range.default,)
    ) -> tuple[str, int, tuple[str, ...]]:
        arguments = (
            f"grid.aspect={{start: 0, stop: {LAST_ASPECT:g}, step: {step:g}}}",
            f"grid.random_aspects={drawn}",
            f"grid.range=[{','.join(map(str, ranges))}]",
        )
        # Aspects drawn are rounded: some are drawn twice, or are in the grid.
        aspects = {round(k * step, 3) for k in range(round(LAST_ASPECT / step) + 1)}
        aspects |= {*draw_aspects(0.0, LAST_ASPECT, drawn, int(Run.seed.default))}
        return kind, len(SHIPS) * len(aspects) * len(ranges), arguments

    sweeps = [grid(LEARNED, step, 0) for step in STEPS]
    sweeps += [grid(RANDOM, SPACING, drawn) for drawn in RANDOM_COUNTS]
    return sweeps + [grid(AT_RANGES, SPACING, drawn, RANGES) for drawn in RANDOM_COUNTS_AT_RANGES]


def _row(kind: str, views: int, arguments: Sequence[str]) -> dict[str, object]:
    """Return the figures of one sweep."""
    with tempfile.TemporaryDirectory() as parent:
        folder = new_folder(Path(parent, "cold"))
        run = sweep([*arguments, f"grid.ship=[{','.join(SHIPS)}]"], folder).run
        files = _sizes(folder / "sweep.zarr")
        tables, page = (report(folder / "sweep.zarr", *options) for options in ((), ("--html",)))
        return {
            "kind": kind,
            "views": views,
            "wall_s": run.seconds,
            "cpu_ms": 1e3 * run.cpu / views,
            **shares(folder / "sweep-tables" / "stages.csv"),
            "driver_mib": run.driver,
            "worker_mib": run.worker,
            "tables_s": tables.cpu,
            "tables_mib": tables.driver,
            "page_s": page.cpu,
            "page_mib": page.driver,
            "files": len(files),
            "store_mb": sum(files) / 1e6,
            "cache_mb": sum(_sizes(folder / "cache" / "cells")) / 1e6,
        }


def report(store: Path, *how: str) -> processes.Run:
    """Return the cost of `ncti-report` on a store."""
    code = "from sweeps.report.command import main; main()"
    return processes.watch([sys.executable, "-c", code, str(store), *how], cores=CORES)


def _sizes(folder: Path) -> list[int]:
    """Return the bytes of all files in a folder."""
    return [path.stat().st_size for path in folder.rglob("*") if path.is_file()]


def shares(table: Path) -> Mapping[str, float]:
    """Return shares of the time of calls [%] by column of the report, from a sweep's table."""
    seconds_of = dict.fromkeys([*STAGES.values(), "others"], 0.0)
    with table.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            seconds_of[STAGES.get(row["stage"], "others")] += float(row["work_s"])
    total = sum(seconds_of.values())
    return {name: 100 * seconds / total for name, seconds in seconds_of.items()}

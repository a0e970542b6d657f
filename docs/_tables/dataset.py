"""Rows of a data set a second, by sensor and rows of a view."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from typing import Any

import ncti
from benchmarks.reports import Column, Report

SHIPS = ["duncan", "horne", "spruance", "texas"]
CORES = WORKERS = 2
ROW_RATIO = 10  # of the first case to others

CASES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("profiles, 25 rows a view", {}),
    ("profiles, 1 row a view", {"rows_per_view": 1}),
    ("profiles at 25 km, 25 rows a view", {"slant_range": 25e3}),
    ("the same, 4 frames", {"slant_range": 25e3, "frames": 4}),
    ("silhouettes", {"sensor": "infrared"}),
    ("both", {"sensor": "both"}),
)
COLUMNS = (
    Column("case", "rows of four ships at random aspects, 100 km, 16 frames"),
    Column("rows", "rows", ",d"),
    Column("cpu_ms", "processor [ms a row]", ".2f"),
    Column("a_second", "rows a second of that on two cores", ",.0f"),
)


def measure(*, rows: int = 100_000, workers: int = WORKERS) -> Report:
    """Measure the processor time of `ncti.dataset`, start of its processes included.

    Parameters
    ----------
    rows : int
        Rows of the first case; others have a tenth.
    workers : int
        Processes.

    Returns
    -------
    Report
        A row for each case.
    """
    return Report(
        f"Rows of `ncti.dataset`: 30 ns, 16 frames, lines at 0.25 m, {workers} processes",
        COLUMNS,
        [*_rows(rows, workers)],
    )


def _rows(rows: int, workers: int) -> Iterator[dict[str, Any]]:
    ncti.dataset(SHIPS, 25, seed=0, sensor="both")  # compiles what is not compiled
    for case, options in CASES:
        count = rows if not options else max(1, rows // ROW_RATIO)
        start = _processor_time()
        ncti.dataset(SHIPS, count, seed=0, workers=workers, **options)
        seconds = _processor_time() - start
        yield {
            "case": case,
            "rows": count,
            "cpu_ms": 1e3 * seconds / count,
            "a_second": CORES * count / seconds,
        }


def _processor_time() -> float:
    """Return the processor time of this process and of those that have ended [s]."""
    usages = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)

"""Tables of measurements, printed on the screen and written as JSON."""

from __future__ import annotations

import json
import os
import platform
import statistics
import timeit
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table


@dataclass(frozen=True)
class Sample:
    """Repeated measurements of one quantity."""

    median: float
    low: float
    high: float
    n: int

    @classmethod
    def of(cls, values: Iterable[float]) -> Sample:
        """Return median, lowest and highest of at least one value."""
        values = list(values)
        return cls(statistics.median(values), min(values), max(values), len(values))


@dataclass(frozen=True)
class Column:
    """A column of a report: its key in rows and JSON, its heading, and the format of numbers."""

    key: str
    heading: str
    spec: str = "s"


@dataclass(frozen=True)
class Report:
    """A table of measurements.

    Attributes
    ----------
    title : str
        Subject and conditions of the measurement.
    columns : tuple of Column
        In the order shown.
    rows : list of dict
        A text, a number, a Sample, or nothing for each column.
    notes : list of str
        Remarks below the table.
    """

    title: str
    columns: tuple[Column, ...]
    rows: list[dict[str, Any]]
    notes: list[str] = field(default_factory=list)


def describe_machine() -> dict[str, str]:
    """Return a description of the machine, and its load at the start."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {
        "cpu": _cpu(),
        "cores": str(cores),
        "load": f"{os.getloadavg()[0]:.1f}",
        "python": platform.python_version(),
        **{name: version(name) for name in ("numpy", "pyrender", "embreex", "trimesh")},
    }


def cache_size() -> str:
    """Return the size of the largest cache of the processor, as Linux states it."""
    sizes = Path("/sys/devices/system/cpu/cpu0/cache").glob("index*/size")
    kilobytes = [int(path.read_text().strip().removesuffix("K")) for path in sizes]
    return f"{max(kilobytes) / 1024:g} MiB" if kilobytes else "an unknown size"


def copy_rate() -> float:
    """Return the rate at which one core reads and writes uncached memory [GB/s]."""
    source = np.ones(2**25)
    copy = np.empty_like(source)
    seconds = min(timeit.repeat(lambda: np.copyto(copy, source), number=1, repeat=5))
    return 2e-9 * source.nbytes / seconds


def show(report: Report, console: Console) -> None:
    """Print a report."""
    table = Table(title=escape(report.title), title_justify="left")
    headings, *rows = cells(report)
    for column, heading in zip(report.columns, headings, strict=True):
        text = column.spec == "s"
        table.add_column(escape(heading), justify="left" if text else "right", no_wrap=True)
    for row in rows:
        table.add_row(*map(escape, row))
    wide = console.options.update(max_width=1000)
    console.width = max(console.width, 100, console.measure(table, options=wide).maximum)
    console.print(table)
    for note in report.notes:
        console.print(note, style="dim", highlight=False, markup=False)


def write_json(path: Path, where: Mapping[str, str], reports: Mapping[str, Report]) -> None:
    """Write reports with the description of their machine."""
    content = {"machine": dict(where)} | {name: asdict(report) for name, report in reports.items()}
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def cells(report: Report) -> Iterator[list[str]]:
    """Yield the headings, then the text of each row."""
    yield [column.heading for column in report.columns]
    for row in report.rows:
        yield [_format_value(row.get(column.key), column.spec) for column in report.columns]


def _format_value(value: Any, spec: str) -> str:
    if value is None:
        return ""
    if isinstance(value, Sample):
        ends = f" ({value.low:{spec}}–{value.high:{spec}})" if value.n > 1 else ""
        return f"{value.median:{spec}}{ends}"
    return f"{value:{spec}}" if spec != "s" else str(value)


def _cpu() -> str:
    """Return the model of the processor, if known."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(models, platform.machine())

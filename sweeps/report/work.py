"""Run time of a sweep by stage, kept beside its tables, since a store holds no times."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Protocol

from rich.console import Console

from sweeps.report.layout import sheet, show
from sweeps.report.own import OwnFiles
from sweeps.report.places import tables_folder
from sweeps.report.rows import Row
from sweeps.report.screen import neutral

FILE = "stages.csv"
COLUMNS = ("stage", "done", "reused", "failed", "work_s")


class Progress(Protocol):
    """Cells of a stage, and the time [s] that they took."""

    done: int
    reused: int
    failed: int
    seconds: float


@dataclass(frozen=True)
class Work:
    """Cells of a stage by outcome, and the time [s] of those computed."""

    stage: str
    done: int
    reused: int
    failed: int
    seconds: float


def write_work(store: Path, stages: Mapping[str, Progress]) -> list[Path]:
    """Write the work of a sweep beside the tables of its store.

    Returns the paths at which other files are in the way. Raises OSError if it cannot.
    """
    rows = [
        Work(name, one.done, one.reused, one.failed, round(one.seconds, 3))
        for name, one in stages.items()
    ]
    text = io.StringIO(newline="")
    csv.writer(text).writerows([COLUMNS, *([*map(neutral, astuple(one))] for one in rows)])
    files = OwnFiles(tables_folder(store))
    files.put(FILE, text.getvalue().encode())
    return files.kept


def read_work(store: Path) -> list[Work]:
    """Return the work of the sweep that last wrote a store; empty if unknown."""
    try:
        with (tables_folder(store) / FILE).open(newline="", encoding="utf-8") as file:
            rows = list(csv.reader(file))[1:]
        return [Work(row[0], *map(int, row[1:4]), float(row[4])) for row in rows]  # type: ignore[call-arg]
    except (OSError, ValueError, IndexError):
        return []


def print_work(found: list[Row], console: Console) -> None:
    """Print the cells of each stage and the time that they took."""
    table = sheet("Work of the last sweep", "done", "reused", "failed", "work [s]", left=["stage"])
    for row in found:
        *cells, seconds = row.values()
        table.add_row(*map(str, cells), f"{seconds:.1f}")
    show(table, console)

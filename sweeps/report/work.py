"""Run time of a sweep by stage, kept beside its tables, since a store holds no times."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import pandas as pd

from sweeps.report.files import csv_of
from sweeps.report.frames import Column, Frame
from sweeps.report.own import OwnFiles
from sweeps.report.places import tables_folder

NAME = "stages"
COUNTS = ("done", "reused", "failed")


class Progress(Protocol):
    """Cells of a stage, and the time [s] that they took."""

    done: int
    reused: int
    failed: int
    seconds: float


def write_work(store: Path, stages: Mapping[str, Progress]) -> list[Path]:
    """Write the work of a sweep beside the tables of its store.

    Returns the paths at which other files are in the way. Raises OSError if it cannot.
    """
    rows = [
        (name, one.done, one.reused, one.failed, round(one.seconds, 3))
        for name, one in stages.items()
    ]
    files = OwnFiles(tables_folder(store))
    files.put(f"{NAME}.csv", csv_of(_frame(rows)))
    return files.kept


def read_work(store: Path) -> Frame | None:
    """Return the work of the sweep that last wrote a store; None if unknown."""
    try:
        text = (tables_folder(store) / f"{NAME}.csv").read_text(encoding="utf-8")
        rows = [
            (row[0], *map(int, row[1:4]), float(row[4]))
            for row in list(csv.reader(io.StringIO(text)))[1:]
        ]
    except (OSError, ValueError, IndexError):
        return None
    return _frame(rows) if rows else None


def _frame(rows: Sequence[tuple[object, ...]]) -> Frame:
    columns = {"stage": Column("stage", "stage", "stage")}
    columns |= {name: Column(name, name, name, role="figure") for name in COUNTS}
    columns["work_s"] = Column("work_s", "work", "work", "s", role="figure", format=".1f")
    data = pd.DataFrame(rows, columns=list(columns))
    return Frame(NAME, "Work of the last sweep, by stage", data, columns, down=("stage",))

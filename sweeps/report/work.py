"""Run time of a sweep by stage, kept beside its tables, since a store holds no times."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from sweeps.engine.declare.paths import PathOrUrl
from sweeps.report.files import csv_of
from sweeps.report.frames import Column, Frame
from sweeps.report.outputs import tables_folder, write_own_files

if TYPE_CHECKING:
    from sweeps.engine.run.schedule import Progress

NAME = "stages"
COLUMNS = {
    "stage": Column("stage", "stage", "stage"),
    **{name: Column(name, name, name, role="figure") for name in ("done", "reused", "failed")},
    "work_s": Column("work_s", "work", "work", "s", role="figure", format=".1f", digits=3),
}


def write_work(store: PathOrUrl, stages: Mapping[str, Progress]) -> list[Path]:
    """Write the work of a sweep beside the tables of its store.

    Returns the paths at which other files are in the way. Raises OSError if it cannot.
    """
    rows = [
        (name, work.done, work.reused, work.failed, work.seconds) for name, work in stages.items()
    ]
    content = csv_of(_work_frame(pd.DataFrame(rows, columns=list(COLUMNS))))
    return write_own_files(tables_folder(store), {f"{NAME}.csv": content})


def read_work(store: PathOrUrl) -> Frame | None:
    """Return the work of the sweep that last wrote a store; None if unknown."""
    try:
        rows = pd.read_csv(tables_folder(store) / f"{NAME}.csv")
    except (OSError, ValueError):
        return None
    return _work_frame(rows) if list(rows) == list(COLUMNS) and len(rows) else None


def _work_frame(rows: pd.DataFrame) -> Frame:
    return Frame(NAME, "Work of the last sweep, by stage", rows, COLUMNS, down=("stage",))

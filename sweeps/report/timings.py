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


def write_timings(store: PathOrUrl, stages: Mapping[str, Progress]) -> list[Path]:
    """Write the run time of a sweep by stage beside the tables of its store.

    Returns the paths at which other files are in the way. Raises OSError if it cannot.
    """
    rows = [
        (name, stage.done, stage.reused, stage.failed, stage.seconds)
        for name, stage in stages.items()
    ]
    content = csv_of(_timings_frame(pd.DataFrame(rows, columns=list(COLUMNS))))
    return write_own_files(tables_folder(store), {f"{NAME}.csv": content})


def read_timings(store: PathOrUrl) -> Frame | None:
    """Return the run time, by stage, of the sweep that last wrote a store; None if unknown."""
    try:
        rows = pd.read_csv(tables_folder(store) / f"{NAME}.csv")
    except (OSError, ValueError):
        return None
    return _timings_frame(rows) if list(rows) == list(COLUMNS) and len(rows) else None


def _timings_frame(rows: pd.DataFrame) -> Frame:
    return Frame(NAME, "Run time of the last sweep by stage", rows, COLUMNS, down=("stage",))

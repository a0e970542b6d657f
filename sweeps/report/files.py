"""Tables of a store as CSV files beside it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from sweeps.engine.declare.paths import PathOrUrl
from sweeps.report.frames import PART, Frame
from sweeps.report.outputs import tables_folder, write_own_files
from sweeps.report.words import is_missing

FORMULA_PREFIXES = ("=", "+", "-", "@", "\t", "\r")  # prefixes of formulas in spreadsheets


def write_tables(store: PathOrUrl, frames: Iterable[Frame]) -> list[Path]:
    """Write the tables of a store as CSV files beside it; remove those of an earlier run.

    Files that were changed since a report wrote them stay. Returns the paths at which other files
    are in the way. Raises OSError if it fails.
    """
    contents = {f"{frame.name}.csv": csv_of(frame) for frame in frames}
    return write_own_files(tables_folder(store), contents, instead_of=".csv")


def csv_of(frame: Frame) -> bytes:
    """Return a frame as CSV with its columns as header; an absent value is an empty field."""
    rows = frame.rows.drop(columns=PART, errors="ignore")
    texts: dict[str, Any] = {}
    for name in rows:
        kind, digits = rows[name].dtype.kind, frame.columns[name].digits
        if kind not in "fiub":
            texts[name] = rows[name].map(neutralise_formula)
        elif digits is not None and kind == "f":
            texts[name] = rows[name].map(partial(round_number, digits=digits))
    rows = rows.assign(**texts).rename(columns=neutralise_formula)
    text = rows.to_csv(index=False, lineterminator="\r\n")
    return text.encode("utf-8", "backslashreplace")


def round_number(value: float, digits: int) -> float:
    """Return a number rounded to some decimals, and NaN for an infinite one."""
    return round(value, digits) if math.isfinite(value) else math.nan


def neutralise_formula(value: Any) -> Any:
    """Return a cell with an apostrophe before a text that a spreadsheet would run as a formula."""
    if not isinstance(value, str) or is_missing(value) or not value.startswith(FORMULA_PREFIXES):
        return value
    with suppress(ValueError):
        float(value)
        return value
    return f"'{value}"

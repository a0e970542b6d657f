"""Data sets of a store as rows: a column an axis, and a column a figure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from sweeps.report.axes import NOMINAL, Axis, axes_of
from sweeps.report.source import source_percent

Row = dict[str, Any]

BIN = "aspect_bin_deg"
RULES = ("label_rule", "score_rule")  # what the source leaves open of its network


def cells(dataset: xr.Dataset, **which: Any) -> Iterator[tuple[Row, Row]]:
    """Yield axes and values of every cell of a data set, by names of columns and of variables.

    `which` dimensions are axes is as of `axes_of`.
    """
    axes = axes_of(dataset, **which)
    dims = list(dict.fromkeys(dim for dim in axes.values() if dim))
    arrays = {
        str(name): array.transpose(*dims).values.ravel().tolist()
        for name, array in xr.broadcast(dataset)[0].data_vars.items()
    }
    values = {axis: np.atleast_1d(dataset[axis.name].values).tolist() for axis in axes}
    for number, place in enumerate(np.ndindex(*(dataset.sizes[dim] for dim in dims))):
        here: Row = {
            axis: known(values[axis][place[dims.index(dim)] if dim else 0])
            for axis, dim in axes.items()
        }
        yield here, {name: array[number] for name, array in arrays.items()}


def known(value: Any) -> Any:
    """Return a value; none of NaN."""
    return None if value != value else value


def score_rows(tables: xr.Dataset, prefix: str = "", *, label: Mapping[str, Any]) -> list[Row]:
    """Percent correct with its interval, one row a cell and aspect bin, labels first.

    Variables have a prefix: `training_` and `ship_` count something else.
    """
    columns = {prefix + name: name for name in ("accuracy", "ci_low", "ci_high", "spread")}
    columns[prefix + "accuracy"] = "percent_correct"
    if f"{prefix}spread" not in tables:
        del columns[f"{prefix}spread"]
    return [
        {**label, **axes}
        | {column: percent(cell[name]) for name, column in columns.items()}
        | {"n": cell[prefix + "n"]}
        for axes, cell in cells(tables[[*columns, prefix + "n"]])
    ]


def beside_source(rows: list[Row], tables: xr.Dataset, table: str) -> list[Row]:
    """The same rows with the source's figures, of one of its tables."""
    lowest = dict(zip(tables.aspect_bin.values, tables.aspect_low.values.tolist(), strict=True))
    for row in rows:
        there = {"receiver": tables.attrs.get("receiver")} | row
        row["source_percent"] = source_percent(table, there, lowest[row[BIN]])
    return rows


def together(*parts: Iterable[Row]) -> list[Row]:
    """Rows of several kinds with the same columns: labels, axes, figures; none where one lacks."""
    rows = [row for part in parts for row in part]
    axes = set(axes_in(rows))
    labels = [key for row in rows[:1] for key in list(row)[: _first_axis(row)]]
    others = dict.fromkeys(key for row in rows for key in row if key not in axes)
    figures = [key for key in others if key not in labels]
    keys = [*labels, *sorted(axes, key=lambda axis: axis.rank), *figures]
    return [{key: row.get(key) for key in keys} for row in rows]


def _first_axis(row: Row) -> int:
    return next((k for k, key in enumerate(row) if isinstance(key, Axis)), len(row))


def axes_in(rows: Iterable[Row]) -> list[Axis]:
    """Columns of rows that are axes."""
    keys = dict.fromkeys(key for row in rows for key in row)
    return [key for key in keys if isinstance(key, Axis)]


def several(rows: Sequence[Row], *, but: Iterable[str] = (), none: bool = False) -> list[Axis]:
    """Axes with several values among rows, of which none may be one, but those told elsewhere."""
    nothing = set() if none else {None}
    return [
        axis
        for axis in axes_in(rows)
        if axis not in set(but) and len({row.get(axis) for row in rows} - nothing) > 1
    ]


def grouped(rows: Iterable[Row], keys: Sequence[str]) -> dict[tuple[Any, ...], list[Row]]:
    """Rows by the values of some columns, in the order they come."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row.get(key) for key in keys), []).append(row)
    return groups


def of_one(rows: Sequence[Row], names: Iterable[str] = RULES) -> list[Row]:
    """Rows of the nominal value on some axes, or of the first, and those without any."""
    for name in names:
        there = dict.fromkeys(row[name] for row in rows if row.get(name) is not None)
        wanted = NOMINAL.get(name) if NOMINAL.get(name) in there else next(iter(there), None)
        rows = [row for row in rows if row.get(name) in (None, wanted)]
    return list(rows)


def nearest(wanted: float, there: Iterable[Any]) -> Any:
    """The value that is nearest to another, the lesser of two."""
    return min(there, key=lambda value: (abs(value - wanted), value))


def percent(fraction: float) -> float | None:
    """A fraction in per cent, to a tenth; none of NaN."""
    return None if math.isnan(fraction) else round(100 * fraction, 1)


def finite(value: float) -> float | None:
    """A number; none of NaN or infinity."""
    return value if math.isfinite(value) else None


def rounded(value: float, digits: int | None = None) -> float | None:
    """A number to so many digits, or a whole one; none of NaN or infinity."""
    return round(value, digits) if math.isfinite(value) else None

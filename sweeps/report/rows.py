"""Groups of a store as rows: a column for each axis and each figure."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import yaml
import zarr

from sweeps.engine.attributes import nested
from sweeps.report.axes import NOMINAL, OF_ARRAYS, Axis, axes_of

Row = dict[str, Any]
Column = tuple[str, Callable[[Any], Any]]  # variable, and function that formats a cell

BIN = "aspect_bin_deg"
RULES = ("label_rule", "score_rule")  # what the source leaves unspecified of its network
ENDS = ("ci_low", "ci_high")
COMPARED = "compared"  # attribute of tables with tests of their rows, by classifier

# Tables of the source by classifier.
TABLES = {"acn": "table4", "mnn": "table2", "acn_infrared": "table5"}
SAME = {"vigilance": "vigilance", "pulse_width": "pulse_width_ns", "frame_count": "frame_count"}


def opened(path: Path) -> Any:
    """Return a store with its metadata. Raises OSError if there is none."""
    return zarr.open_group(path, mode="r")


def attributes(store: Any) -> dict[str, Any]:
    """Return the attributes of a store, or of a group, with mappings and lists as such."""
    return nested(store.attrs)


def groups(store: Any, under: str = "") -> list[str]:
    """Return the names of groups of a store, or of subgroups of one."""
    inside = store.get(under) if under else store
    return sorted(inside.group_keys()) if inside is not None else []


def read(store: Any, group: str) -> xr.Dataset:
    """Return a group of a store, each variable read lazily. Raises KeyError without it."""
    return xr.open_dataset(xr.backends.ZarrStore(store[group], mode="r"))


def setting(dataset: xr.Dataset, configuration: Mapping[str, Any], name: str) -> Any:
    """Return a setting: the coordinate of that name, else the configuration's value; or None."""
    if name in dataset.coords and not dataset[name].dims:
        return known(dataset[name].item())
    value = configuration[name]
    return value[0] if isinstance(value, list) else value


def cells(dataset: xr.Dataset, **which: Any) -> Iterator[tuple[Row, Row]]:
    """Yield axes and values of every cell, by column and variable; `which` as in `axes_of`."""
    axes = axes_of(dataset, **which)
    sizes = {dim: dataset.sizes[dim] for dim in axes.values() if dim}
    arrays = {
        str(name): array.variable.set_dims(sizes).transpose(*sizes).values.ravel().tolist()
        for name, array in dataset.data_vars.items()
    }
    values = {axis: np.atleast_1d(dataset[axis.name].values).tolist() for axis in axes}
    dims = list(sizes)
    for number, place in enumerate(np.ndindex(*sizes.values())):
        here: Row = {
            axis: known(values[axis][place[dims.index(dim)] if dim else 0])
            for axis, dim in axes.items()
        }
        yield here, {name: array[number] for name, array in arrays.items()}


def known(value: Any) -> Any:
    """Return a value; None for NaN."""
    return None if value != value else value


def table_rows(
    tables: xr.Dataset, columns: Mapping[str, Column], label: Mapping[str, Any]
) -> list[Row]:
    """Return a row for each cell: labels, axes, and columns."""
    named = tables[list(dict.fromkeys(name for name, _ in columns.values()))]
    return [
        {**label, **axes} | {column: of(cell[name]) for column, (name, of) in columns.items()}
        for axes, cell in cells(named)
    ]


def score_rows(tables: xr.Dataset, prefix: str = "", **label: Any) -> list[Row]:
    """Return percent correct with its interval, a row for each cell and aspect bin, labels first.

    `prefix` selects variables: `training_` and `ship_` are other scores.
    """
    columns = {
        column: (prefix + name, percent)
        for column, name in (("percent_correct", "accuracy"), *zip(ENDS, ENDS, strict=True))
    }
    if f"{prefix}spread" in tables:
        columns["spread"] = (f"{prefix}spread", percent)
    return table_rows(tables, columns | {"n": (prefix + "n", known)}, label)


def formation_rows(tables: xr.Dataset) -> list[Row]:
    """Return numbers of categories, a row per training: mean, spread and extremes over draws.

    `first` is the count of the first draw, `views` the number of training views.
    """
    formed = tables[["category_count", "view_count", "settled"]]
    # Categories do not depend on labels or tests.
    formed = formed.drop_vars((*RULES, "learn_in_test"), errors="ignore")
    axes = list(axes_of(formed))
    every = (place | cell for place, cell in cells(formed, but=OF_ARRAYS))
    rows = []
    for place, draws in grouped(every, axes).items():
        done = [draw for draw in draws if draw["view_count"] > 0]
        counts = [draw["category_count"] for draw in done]
        row: Row = dict(zip(axes, place, strict=True)) | {"trainings": len(done)}
        row["categories"] = round(statistics.fmean(counts), 2) if counts else None
        row["spread"] = round(statistics.pstdev(counts), 2) if counts else None
        row |= {"least": min(counts, default=None), "most": max(counts, default=None)}
        row["first"] = counts[0] if draws[0] in done else None
        row["views"] = max(draw["view_count"] for draw in draws)
        row["settled"] = bool(done) and all(draw["settled"] == 1 for draw in done)
        rows.append(row)
    return rows


def together(*parts: Iterable[Row]) -> list[Row]:
    """Return rows of several kinds with the same columns: labels, axes, figures, or None."""
    rows = [row for part in parts for row in part]
    axes = set(axes_in(rows))
    first = list(rows[0]) if rows else []
    labels = first[: next((k for k, key in enumerate(first) if key in axes), len(first))]
    others = dict.fromkeys(key for row in rows for key in row if key not in axes)
    figures = [key for key in others if key not in labels]
    keys = [*labels, *sorted(axes, key=lambda axis: axis.rank), *figures]
    return [{key: row.get(key) for key in keys} for row in rows]


def axes_in(rows: Iterable[Row]) -> list[Axis]:
    """Return the columns of rows that are axes."""
    keys = dict.fromkeys(key for row in rows for key in row)
    return [key for key in keys if isinstance(key, Axis)]


def several(rows: Sequence[Row], *, but: Iterable[str] = (), none: bool = False) -> list[Axis]:
    """Return axes with several values among rows, except `but`; with `none`, None is a value."""
    nothing = set() if none else {None}
    return [
        axis
        for axis in axes_in(rows)
        if axis not in set(but) and len({row.get(axis) for row in rows} - nothing) > 1
    ]


def grouped(rows: Iterable[Row], keys: Sequence[str]) -> dict[tuple[Any, ...], list[Row]]:
    """Return rows by the values of some columns, in the order they come."""
    found: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        found.setdefault(tuple(row.get(key) for key in keys), []).append(row)
    return found


def of_one(rows: Sequence[Row], names: Iterable[str] = RULES) -> list[Row]:
    """Return rows at the nominal or first value on some axes, and rows without these."""
    for name in names:
        there = dict.fromkeys(row[name] for row in rows if row.get(name) is not None)
        wanted = NOMINAL.get(name) if NOMINAL.get(name) in there else next(iter(there), None)
        rows = [row for row in rows if row.get(name) in (None, wanted)]
    return list(rows)


@lru_cache
def main_setting() -> dict[str, Any]:
    """Return the value of each axis that is shown first: the source's, or else the nominal one."""
    source = source_figures()
    profiles, silhouettes = source["table4_percent_correct"], source["table5_percent_correct"]
    return NOMINAL | {
        "pulse_width": profiles["pulse_width"],
        "vigilance": profiles["vigilance"],
        "frame_count": silhouettes["frame_count"],
        "infrared_frame_count": silhouettes["frame_count"],
        "range": source["experiment"]["range"],
        "super_resolution": "none",
        "gain_sigma": 1.0,  # unknown
    }


def preferred(name: str, there: Sequence[Any]) -> Any:
    """Return the value of an axis that is shown first: of numbers the nearest, else the first."""
    value: Any = main_setting().get(name)
    if value in there:
        return value
    if all(type(one) in (int, float) and math.isfinite(one) for one in (value, *there)):
        return nearest(value, there)
    return there[0]


def nearest(wanted: float, there: Iterable[Any]) -> Any:
    """Return the value nearest to another, the lesser of two."""
    return min(there, key=lambda value: (abs(value - wanted), value))


def percent(fraction: float) -> float | None:
    """Return a fraction in percent, to a tenth; None for NaN."""
    return None if math.isnan(fraction) else round(100 * fraction, 1)


def rounded(value: float, digits: int | None = None) -> float | None:
    """Return a number rounded to some digits, or a whole one; None for NaN or infinity."""
    return round(value, digits) if math.isfinite(value) else None


def finite(value: float) -> float | None:
    """Return a number; None for NaN or infinity."""
    return value if math.isfinite(value) else None


@lru_cache
def source_figures() -> dict[str, Any]:
    """Return the figures of the article."""
    text = files("sweeps.report").joinpath("source_figures.yaml").read_text(encoding="utf-8")
    figures: dict[str, Any] = yaml.safe_load(text)
    return figures


def as_in_source(row: Mapping[str, Any]) -> bool:
    """Return whether range and receiver are the article's."""
    given = source_figures()["experiment"]
    return (row.get("range_km"), row.get("receiver")) == (given["range"], given["receiver"])


def is_fair(row: Row, tables: xr.Dataset, table: str) -> bool:
    """Return whether a row is of the article's ships, aspects and settings.

    False for tables that `fair.compared` did not prepare.
    """
    test = tables.attrs.get(COMPARED, {}).get(table)
    return test is not None and test(row)


def beside_source(rows: list[Row], tables: xr.Dataset, table: str) -> list[Row]:
    """Return rows with the source's figures from one of its tables where the comparison is fair."""
    lowest = dict(zip(tables.aspect_bin.values, tables.aspect_low.values.tolist(), strict=True))
    for row in rows:
        there = {"receiver": tables.attrs.get("receiver")} | row
        theirs = (
            source_percent(table, there, lowest[row[BIN]]) if is_fair(row, tables, table) else None
        )
        row["source_percent"] = theirs
    return rows


def source_percent(classifier: str, row: Mapping[str, Any], lowest: float) -> int | None:
    """Return the article's percent correct for a row with its `receiver`, if it has one.

    For a classifier, and the bin of a lowest aspect [deg], NaN for all aspects.
    """
    if classifier not in TABLES:
        return None
    if row.get("aspects", "learned") != "learned":  # the source tests the training aspects
        return None
    table = source_figures()[f"{TABLES[classifier]}_percent_correct"]
    frames = row.get("frame_count")
    if any(name in table and row.get(key) != table[name] for name, key in SAME.items()):
        return None
    if classifier == "acn_infrared":
        way, slant_range = row["super_resolution"], row["range_km"]
        if lowest != lowest:
            whole: int | None = table["overall"].get(way, {}).get(slant_range)
            return whole
        figures = table.get(way, {}).get(slant_range)
    elif not as_in_source(row):
        return None
    else:
        figures = table["training"] if frames is None else table["frames"].get(frames)
    if figures is None or not lowest <= 90:
        return None
    found: int = figures[sum(lowest >= start for start in table["bin_starts"]) - 1]
    return found

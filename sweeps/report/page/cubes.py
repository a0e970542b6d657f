"""Variables of a store as cubes of plain numbers, read by the page and its script."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sweeps.report.axes import DRAWS, MARKS, OF_ARRAYS, Column, axes_of, printable, shown
from sweeps.report.axes import Axis as SweepAxis
from sweeps.report.rows import beside_source, preferred, score_rows

ENDS = (("ci_low", "ci_high"), ("low", "high"))  # of intervals, after the name of their variable
COUNTS = ("n", "of")  # suffixes of the total of which a variable is a fraction
BESIDE = ("spread", *COUNTS)  # shown with a variable, not on their own
SPLIT = ("channel", "classifier", "kind", "engine")  # axes whose values are curves of their own
SCORE = "accuracy"
BIN, OVERALL, DEGREE = "aspect_bin", "overall", "°"
TRUE, NAMED = "true ship", "ship named"  # axes of confusion matrices
DIGITS = 5  # significant digits of numbers that are no percentages

Floats = NDArray[np.float64]
Place = Mapping[str, int]


@dataclass(frozen=True)
class Axis:
    """An axis of the sweep: its values as texts, as Python code, and as numbers if they are."""

    name: str
    words: str
    unit: str
    meaning: str
    values: tuple[Any, ...]
    texts: tuple[str, ...]
    codes: tuple[str, ...]
    numbers: tuple[float, ...] | None
    default: int

    @property
    def label(self) -> str:
        """Its name, with its unit in brackets."""
        return f"{self.words} [{self.unit}]" if self.unit else self.words

    def told(self, place: int) -> str:
        """Return a value with its unit."""
        return with_unit(self.texts[place], self.unit)


@dataclass(frozen=True)
class Cube:
    """Values of one variable over its axes, flat in C order, with what is shown beside them.

    `dims` are axes of several values, `at` the positions of their values on the page's axes.
    `fixed` has values of the others. `code` is Python with a `hole` for the code of a value.
    `codes` overrides these codes.
    """

    group: str
    name: str
    label: str
    long_name: str
    units: str
    dims: tuple[str, ...]
    at: tuple[tuple[Any, ...], ...]
    values: tuple[float | None, ...]
    code: str
    fixed: Mapping[str, str] = field(default_factory=dict)
    low: tuple[float | None, ...] = ()
    high: tuple[float | None, ...] = ()
    count: tuple[int | None, ...] = ()
    source: tuple[int | None, ...] = ()
    codes: Mapping[str, Sequence[str]] = field(default_factory=dict)

    @property
    def counted(self) -> bool:
        """Whether its values are integers, which are shown with all digits."""
        return all(isinstance(one, int) for one in self.values)

    def index(self, place: Place) -> int | None:
        """Return the index of the value at a place on the page's axes; None if it is absent."""
        found = 0
        for dim, there in zip(self.dims, self.at, strict=True):
            if place.get(dim) not in there:
                return None
            found = found * len(there) + there.index(place[dim])
        return found


@dataclass
class _Known:
    """Values of an axis in any cube, in order of appearance."""

    column: SweepAxis
    values: dict[Any, str] = field(default_factory=dict)  # with their code


def hole(dim: str) -> str:
    """Return the placeholder of an axis' value in the code of a cube."""
    return f"\0{dim}\0"


class Axes:
    """The axes of all cubes of a page."""

    def __init__(self) -> None:
        self._known: dict[str, _Known] = {}

    def add(
        self, name: str, column: SweepAxis, values: Sequence[Any], codes: Sequence[str]
    ) -> None:
        """Add values of an axis."""
        known = self._known.setdefault(name, _Known(column))
        for value, code in zip(values, codes, strict=True):
            known.values.setdefault(value, code)

    def finished(self) -> dict[str, Axis]:
        """Return the axes in the order of columns, numbers ascending."""
        ordered = sorted(self._known.items(), key=lambda one: one[1].column.rank)
        return {name: _axis(name, known) for name, known in ordered}


def _axis(name: str, known: _Known) -> Axis:
    values = list(known.values)
    numeric = all(isinstance(one, int | float) and not isinstance(one, bool) for one in values)
    if numeric:
        values.sort(key=lambda one: (one != one, one))
    finite = numeric and all(map(math.isfinite, values))
    return Axis(
        name,
        printable(known.column.name.replace("_", " ")),
        "" if name == BIN else unit_of(known.column),
        printable(known.column.long_name),
        tuple(values),
        tuple(_text(name, one) for one in values),
        tuple(known.values[one] for one in values),
        tuple(map(float, values)) if finite else None,
        _default(name, values),
    )


def unit_of(column: Column) -> str:
    """Return the unit of a column as the page has it."""
    return DEGREE if column.units == "degree" else column.unit


def with_unit(text: str, unit: str) -> str:
    """Return a value with its unit, degrees without a blank."""
    return f"{text}{unit}" if unit == DEGREE else f"{text} {unit}".strip()


def _text(name: str, value: Any) -> str:
    if name == BIN and value != OVERALL:
        return f"{shown(value).replace('-', '–')}{DEGREE}"
    return shown(value)


def _default(name: str, values: Sequence[Any]) -> int:
    """Return the place of the value that is shown first."""
    own = {BIN: OVERALL, "channel": "both"}.get(name)
    return values.index(own if own in values else preferred(name, values))


def placed(cube: Cube, axes: Mapping[str, Axis]) -> Cube:
    """Return a cube with values replaced by places on the axes of the page."""
    places = {
        dim: {value: place for place, value in enumerate(axes[dim].values)} for dim in cube.dims
    }
    at = (
        tuple(places[dim][value] for value in there)
        for dim, there in zip(cube.dims, cube.at, strict=True)
    )
    return replace(cube, at=tuple(at))


def cubes_of(table: xr.Dataset, group: str, store: str, axes: Axes) -> list[Cube]:
    """Return the cubes of all numeric variables of a table, scores first.

    Means over draws. Their `at` holds values until `placed`; the values are added to `axes`.
    """
    names = [str(name) for name in table.data_vars if _is_measure(table, str(name))]
    names.sort(key=lambda name: not name.endswith(SCORE))
    found = []
    for name in names:
        array = table[name]
        split = [dim for dim in SPLIT if dim in array.dims and array.sizes[dim] > 1]
        for values in product(*(array[dim].values.tolist() for dim in split)):
            place = dict(zip(split, values, strict=True))
            found.append(_cube(table.sel(place), name, group, store, axes, place))
    return found


def _is_measure(table: xr.Dataset, name: str) -> bool:
    array = table[name]
    if array.dtype.kind not in "fiub" or set(array.dims) & set(OF_ARRAYS):
        return False
    for end in (*BESIDE, *ENDS[0], *ENDS[1]):
        stem = name.removesuffix(end)
        if stem != name and (f"{stem}{SCORE}" in table or stem.removesuffix("_") in table):
            return False
    return True


def _cube(
    table: xr.Dataset, name: str, group: str, store: str, axes: Axes, split: Mapping[str, Any]
) -> Cube:
    """Return the cube of one variable, at one value of each axis that is split."""
    array, percent = table[name], name.endswith(SCORE)
    prefix = name.removesuffix(SCORE) if percent else ""
    count_of = _first(table, [f"{prefix}n"] if percent else [f"{name}_{end}" for end in COUNTS])
    ends = [f"{prefix}{end}" for end in ENDS[0]] if percent else _ends(table, name)
    draws = [str(dim) for dim in array.dims if dim in DRAWS]
    here = [dim for dim in map(str, array.dims) if dim not in draws]
    dims = tuple(dim for dim in here if array.sizes[dim] > 1)
    raw, at, fixed = {}, [f"{key}={value!r}" for key, value in split.items()], {}
    for dim in here:
        values, codes, column = along(table, dim)
        if dim in dims:
            axes.add(dim, column, values, codes)
            raw[dim] = tuple(values)
            at.append(f"{dim}={hole(dim)}")
        else:
            fixed[dim] = with_unit(_text(dim, values[0]), unit_of(column))
            at.append(f"{dim}={codes[0]}")
    numbers = [_numbers(table, one, dims, draws, percent) for one in (name, *ends)]
    mean = f".mean({draws!r})" if draws else ""
    place = f".sel({', '.join(at)})" if at else ""
    opened = f"xr.open_zarr({store!r}, group={group!r})[{name!r}]"
    low, high = numbers[1:] or ((), ())
    return Cube(
        group,
        name,
        printable(name.replace("_", " ")),
        printable(str(array.attrs.get("long_name", ""))),
        "%" if percent else unit_of(Column(array)),
        dims,
        tuple(raw.values()),
        numbers[0],
        f"{'100 * ' if percent else ''}float({opened}{place}{mean})",
        fixed | {key: shown(value) for key, value in split.items()},
        low=low,
        high=high,
        count=_numbers(table, count_of, dims, draws, False),
        source=_source(table, group, prefix, dims) if percent and not split else (),
    )


def _first(table: xr.Dataset, names: Iterable[str]) -> str:
    """Return the name of the first variable of some that a table has, or an empty text."""
    return next((name for name in names if name in table), "")


def _ends(table: xr.Dataset, name: str) -> list[str]:
    """Return names of both ends of a variable's interval, if it has one."""
    pairs = ([f"{name}_{end}" for end in pair] for pair in ENDS)
    return next((pair for pair in pairs if all(one in table for one in pair)), [])


def along(table: xr.Dataset, dim: str) -> tuple[list[Any], list[str], SweepAxis]:
    """Return values of a dimension, their code for `sel`, and its column.

    For a joint axis, which has several coordinates, the values are numbers, labelled by all.
    """
    coord = table[dim]
    values = [None if one != one else one for one in coord.values.tolist()]
    column = SweepAxis(coord)
    others = [
        SweepAxis(one)
        for name, one in table.coords.items()
        if one.dims == (dim,) and name not in (dim, "aspect_low", *MARKS)
    ]
    others.sort(key=lambda one: one.rank)
    if others:
        told = zip(*(table[one.name].values.tolist() for one in others), strict=True)
        texts = [
            ", ".join(
                f"{one.name.replace('_', ' ')} {with_unit(shown(value), unit_of(one))}"
                for one, value in zip(others, place, strict=True)
            )
            for place in told
        ]
        return texts, [repr(value) for value in values], SweepAxis(coord.drop_attrs())
    return values, [repr(value) for value in values], column


def _numbers(
    table: xr.Dataset, name: str, dims: Sequence[str], draws: Sequence[str], percent: bool
) -> tuple[Any, ...]:
    """Return flat values of a variable: percentages finer than shown, others rounded; None for NaN.

    Rounded to a tenth here and to a whole number where it is shown, 68.52 would be 68.
    """
    if name not in table:
        return ()
    array = table[name]
    gone = [dim for dim in draws if dim in array.dims]
    array = array.mean(gone) if gone else array
    rest = [dim for dim in map(str, array.dims) if dim not in dims]
    there = {dim: table.sizes[dim] for dim in dims}
    values = array.isel(dict.fromkeys(rest, 0)).variable.set_dims(there).transpose(*dims).values
    flat: list[float] = np.ravel(values).tolist()
    if values.dtype.kind in "iub" and not percent:
        return tuple(map(int, flat))
    if percent and values.dtype.kind == "f":
        return tuple(None if one != one else round(100 * one, 4) for one in flat)
    return tuple(None if not math.isfinite(one) else float(f"{one:.{DIGITS}g}") for one in flat)


def _source(
    table: xr.Dataset, group: str, prefix: str, dims: Sequence[str]
) -> tuple[int | None, ...]:
    """Return the source's percentages for a table of scores, where the comparison is fair."""
    name = f"{group.rpartition('/')[2]}{'_ship' if prefix == 'ship_' else ''}"
    if prefix and name == "acn_infrared":  # the source has only test silhouettes
        return ()
    if "view_count" not in table or "aspect_low" not in table.coords:
        return ()
    single = [dim for dim in map(str, table.dims) if table.sizes[dim] == 1]
    rows = beside_source(score_rows(table.squeeze(single), prefix), table, name)
    figures = [row["source_percent"] for row in rows]
    if all(one is None for one in figures):
        return ()
    named = table.squeeze(single)[[f"{prefix}{SCORE}", *(f"{prefix}{end}" for end in ENDS[0])]]
    order = list(_dims(named))
    shaped = np.array(figures, dtype=object).reshape([table.sizes[dim] for dim in order])
    ordered = shaped.transpose([order.index(dim) for dim in dims])
    return tuple(ordered.ravel().tolist())


def _dims(named: xr.Dataset) -> Iterator[str]:
    """Yield dimensions of a table in the order of its rows."""
    yield from dict.fromkeys(dim for dim in axes_of(named).values() if dim)

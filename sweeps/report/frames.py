"""Tables of a store as tidy pandas frames: a row per cell, a column per axis and figure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import pandas as pd
import xarray as xr

from ncti.evaluate.answers import DRAWS
from ncti.text import printable
from sweeps.engine.declare.display import ATTRIBUTE, Display, Figure, parse_display
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.paths import PathOrUrl, path_or_url
from sweeps.engine.store.writing import PARTIAL
from sweeps.report.stores import (
    ARRAY_DIMS,
    attributes,
    list_groups,
    open_store,
    read_group,
    refusal,
)
from sweeps.report.words import (
    OVERALL,
    UNITS,
    WORD_AXES,
    WORDS,
    file_name,
    is_number,
    unit_of,
    value_text,
    words_of,
)

HIDDEN_COORDS = ("learned", "known")  # no axes
INTERVAL_SUFFIXES = (("_ci_low", "_ci_high"), ("_low", "_high"))  # of the variables of ends
BESIDE_SUFFIXES = ("_spread", "_n", "_of")
MAX_POINTS = 6  # of settings that run together, to be listed
PERCENT_DIGITS = 1  # decimals of percentages in files
AXIS_ROLES = ("axis", "along")
PART = "part"  # column with the number of the part of a frame, not in files
TABLE_ORDER = (
    *("scores", "flights", "landmarks", "scan", "categories", "rejection_curve", "rejection"),
    *("infrared_sensor", "infrared_detection", "infrared_super_resolution"),
)
"""The tables in the order in which they are shown; others follow."""


@dataclass(frozen=True)
class Column:
    """Column of a frame: its words, unit and meaning, from the labels of outputs and settings."""

    name: str
    axis: str  # name of the axis, or of the column of the figure that it belongs to
    words: str
    unit: str = ""
    meaning: str = ""
    role: str = "axis"  # axis, along, figure, low, high, beside, article or chance
    format: str = ".4g"
    listed: bool = True
    digits: int | None = None  # decimals in files; None: all
    factor: int = 1  # by which values of the store are multiplied
    infinite: str = "inf"  # words for infinity

    @property
    def heading(self) -> str:
        """The words, and the unit in brackets."""
        return f"{self.words} [{self.unit}]" if self.unit else self.words

    def text(self, value: Any) -> str:
        """Return a value as printed, without its unit."""
        if self.axis in WORD_AXES and value in WORDS:
            return WORDS[value]
        if isinstance(value, float) and math.isinf(value):
            return self.infinite
        return value_text(value, "g" if self.role in AXIS_ROLES else self.format)

    def in_words(self, value: Any) -> str:
        """Return a value with the words of its axis, and its unit."""
        return f"{self.words} {self.text(value)} {self.unit}".strip()


@dataclass(frozen=True)
class Part:
    """The rows of a frame from one group: variable and dimensions of each column."""

    group: str
    display: Display
    variables: Mapping[str, str]
    dims: Mapping[str, tuple[str, ...]]
    names: Mapping[str, str]  # of the columns of dimensions
    attrs: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Frame:
    """A table: its tidy rows and their columns."""

    name: str
    title: str
    rows: pd.DataFrame
    columns: Mapping[str, Column]
    parts: tuple[Part, ...] = ()
    down: tuple[str, ...] = ()  # columns of axes down, before others
    across: str = ""  # column of the axis across, if any
    notes: tuple[str, ...] = ()
    joint: tuple[str, ...] = ()  # sentences on settings that run along one axis

    def columns_of_role(self, role: str, figure: str = "") -> list[str]:
        """Return names of the columns of a role, of one figure if given."""
        return [
            name
            for name, column in self.columns.items()
            if column.role == role and (not figure or column.axis == figure)
        ]

    def column_of_role(self, role: str, figure: str) -> str:
        """Return the name of the first column of a role of a figure; empty if there is none."""
        return next(iter(self.columns_of_role(role, figure)), "")

    def related_columns(self, figure: str) -> dict[str, str]:
        """Return the columns of a figure's interval and level of chance, by role; empty: none."""
        return {role: self.column_of_role(role, figure) for role in ("low", "high", "chance")}

    @property
    def figures(self) -> list[str]:
        """Return names of the columns of figures that are listed, the main one first."""
        return [name for name in self.columns_of_role("figure") if self.columns[name].listed]

    @property
    def place_columns(self) -> list[str]:
        """Names of the columns that place a row: axes, and coordinates that run along one."""
        return [*self.columns_of_role("axis"), *self.columns_of_role("along")]

    @property
    def names_by_axis(self) -> dict[str, str]:
        """Names of the columns that place a row, by the names of the coordinates."""
        return {self.columns[name].axis: name for name in self.place_columns}

    @cached_property
    def varying_axes(self) -> list[str]:
        """Names of the axes along which rows differ."""
        return [name for name in self.columns_of_role("axis") if self.rows[name].nunique() > 1]

    @cached_property
    def records(self) -> dict[Any, dict[str, Any]]:
        """Values of every row by column, by the row's label; quicker than looking rows up."""
        return self.rows.to_dict("index")

    @property
    def has_overall(self) -> bool:
        """Whether the axis across has an overall value, beside bins of aspects."""
        return bool(self.across) and bool((self.rows[self.across] == OVERALL).any())

    def where(self, rows: Any) -> Frame:
        """Return the frame with some of its rows."""
        return replace(self, rows=self.rows.loc[rows])

    def keep_axes(self, names: Sequence[str]) -> Frame:
        """Return the frame with only some of its axes."""
        columns = {
            n: column for n, column in self.columns.items() if column.role != "axis" or n in names
        }
        return replace(self, columns=columns)

    def select(self, name: str, value: Any) -> Frame:
        """Return the rows at a value of an axis, including rows without a value there."""
        column = self.rows[name]
        return self.where(column.isna() | (column == value).fillna(False).astype(bool))


def frame(path: PathOrUrl, name: str) -> pd.DataFrame:
    """Return a table of a store as a tidy frame, with a row per cell.

    Parameters
    ----------
    path : path
        A store of a sweep.
    name : str
        Name of the table, which is that of its CSV file.

    Returns
    -------
    DataFrame
        A column per axis and figure. `attrs["columns"]` has label and unit of each.

    Raises
    ------
    ConfigurationError
        If the store has no such table.
    """
    table = select_table(read_frames(path_or_url("store", path)), name)
    rows = table.rows.drop(columns=PART, errors="ignore")
    rows.attrs["columns"] = {
        key: {"label": column.meaning or column.words, "unit": column.unit}
        for key, column in table.columns.items()
    }
    return rows


def select_table(frames: Mapping[str, Frame], name: str) -> Frame:
    """Return the table of a name. Raises ConfigurationError, which lists the names."""
    if name not in frames:
        raise ConfigurationError(f"table is {name!r}, but must be one of {', '.join(frames)}")
    return frames[name]


def read_frames(path: PathOrUrl) -> dict[str, Frame]:
    """Return the tables of a store by name. Raises ConfigurationError if it has none."""
    try:
        store = open_store(path)
        parts: dict[str, list[Frame]] = {}
        attrs = attributes(store)
        group_names = {f"tables/{name}": name for name in list_groups(store, "tables")}
        # The store of one function over a grid has no tables.
        if not group_names and attrs.get("title") in list_groups(store):
            group_names = {attrs["title"]: attrs["title"]}
        for group, name in group_names.items():
            table = read_group(store, group)
            for display in displays_of(table, name):
                figures = display.figures or tuple(_all_figures(table))
                if figures and figures[0].variable in table:
                    part = tidy_frame(table, replace(display, figures=figures), group)
                    parts.setdefault(display.name, []).append(part)
        frames = {name: stack_frames(tables) for name, tables in parts.items()}
        if any(part.display.source for frame in frames.values() for part in frame.parts):
            from sweeps.report.article_columns import add_comparisons

            frames = {name: add_comparisons(frame, attrs) for name, frame in frames.items()}
    # zarr and xarray raise various errors for damaged or other files.
    except Exception as error:
        raise refusal(path, error) from error
    if not frames:
        missing = attrs.get(PARTIAL)
        raise refusal(path, f"{missing}; the sweep's command completes it" if missing else "")
    order = {name: number for number, name in enumerate(TABLE_ORDER)}
    return {name: frames[name] for name in sorted(frames, key=lambda frame: order.get(frame, 99))}


def displays_of(table: xr.Dataset, name: str) -> list[Display]:
    """Return the displays stored with a group, or one display of all its variables."""
    declared = attributes(table).get(ATTRIBUTE)
    if declared:
        return [parse_display(display) for display in declared]
    return [Display(name, str(table.attrs.get("title", name.replace("_", " ").capitalize())))]


def tidy_frame(table: xr.Dataset, display: Display, group: str) -> Frame:
    """Return the frame of one display of a group, which has the main figure of the display."""
    declared = [figure for figure in display.figures if figure.variable in table]
    figures = [_complete_figure(figure, table) for figure in declared]
    figure_columns = _columns_of_figures(table, figures)
    data = table[list(dict.fromkeys(variable for variable, _ in figure_columns.values()))]
    extra = [name for name in (*HIDDEN_COORDS, *DRAWS) if _is_extra_coordinate(data, name)]
    data = data.drop_vars(extra).load()
    expanded = data if data.dims else data.expand_dims("row_number")
    flat = expanded.to_dataframe().reset_index().drop(columns="row_number", errors="ignore")
    columns = {name: Column(name, name, name) for name in display.labels}
    rows: dict[str, Any] = {
        name: pd.Series(text, index=flat.index, dtype=object)
        for name, text in display.labels.items()
    }
    axes = [str(name) for name in flat if name not in data.data_vars]
    axes.sort(key=lambda name: name == display.columns)
    main_coordinates = {dim: main_coordinate(data, dim) for dim in map(str, data.dims)}
    joint = []
    for axis in axes:
        is_axis = axis in main_coordinates.values() or not data[axis].ndim
        column = replace(column_of_axis(data, axis), role="axis" if is_axis else "along")
        columns[column.name], rows[column.name] = column, _to_nullable_dtype(flat[axis])
    for dim, main_name in main_coordinates.items():
        joint += _joint_sentence(data, dim, main_name)
    for name, (variable, column) in figure_columns.items():
        values = _to_nullable_dtype(flat[variable])
        columns[name] = column
        rows[name] = values if column.factor == 1 else column.factor * values
    main = figures[0].column
    if display.chance is not None:
        name = f"{main}_by_chance"
        columns[name] = Column(name, main, "chance", columns[main].unit, "", "chance", ".0f")
        rows[name] = pd.Series(float(display.chance), index=flat.index)  # type: ignore[arg-type]
    column_names = {
        column.axis: name for name, column in columns.items() if column.role in AXIS_ROLES
    }
    counts = next((table[name] for name in ("view_count", "views") if name in table), None)
    views = {} if counts is None else {"views": int(counts.max())}
    variables = {name: variable for name, (variable, _) in figure_columns.items()}
    dims = {name: tuple(map(str, table[variable].dims)) for name, variable in variables.items()}
    return Frame(
        display.name,
        display.title,
        pd.DataFrame(rows | {PART: 0}),
        columns,
        (Part(group, display, variables, dims, column_names, attributes(table) | views),),
        down=tuple(column_names[name] for name in display.rows if name in column_names),
        across=column_names.get(display.columns, ""),
        notes=display.notes,
        joint=tuple(joint),
    )


def main_coordinate(data: xr.Dataset, dim: str) -> str:
    """Return the coordinate to use as the axis of a dimension; others may run along it.

    Use the coordinate named after the dimension, unless it is absent or lists the values of others,
    as in 'mass=3,limit=9'. Otherwise use the first coordinate with distinct values.
    """
    if dim in data.coords and not any("=" in str(label) for label in data[dim].values):
        return dim
    for name in _coordinates_along(data, dim):
        if name != dim and len({*data[name].values.tolist()}) == data.sizes[dim]:
            return name
    return dim


def _coordinates_along(data: xr.Dataset, dim: str) -> list[str]:
    """Return the coordinates of one dimension alone, in the order in which it names them."""
    names = [str(name) for name, values in data.coords.items() if values.dims == (dim,)]
    return sorted(names, key=lambda name: dim.find(name) if name in dim else len(dim))


def _joint_sentence(data: xr.Dataset, dim: str, main_name: str) -> list[str]:
    """Return a sentence on the settings that run along a dimension, if there are several."""
    others = [name for name in _coordinates_along(data, dim) if name not in (dim, main_name)]
    if not others:
        return []
    main, *columns = (column_of_axis(data, name) for name in (main_name, *others))
    if data.sizes[dim] > MAX_POINTS:
        return [f"Along {main.words} run {', '.join(column.words for column in columns)}."]
    points = [
        f"{main.in_words(value)}: "
        + ", ".join(
            column.in_words(data[name].values.tolist()[number])
            for name, column in zip(others, columns, strict=True)
        )
        for number, value in enumerate(data[main_name].values.tolist())
    ]
    text = "; ".join(points)
    return [f"{text[0].upper()}{text[1:]}."]


def _columns_of_figures(
    table: xr.Dataset, figures: Sequence[Figure]
) -> dict[str, tuple[str, Column]]:
    """Return variable and column, by name, of each figure, its interval and its other columns."""
    interval_count = sum(bool(figure.low) for figure in figures)
    columns: dict[str, tuple[str, Column]] = {}
    for main in figures:
        prefix = "" if interval_count == 1 else f"{main.column}_"
        variables = {main.column: ("figure", main.variable)}
        variables |= {f"{prefix}ci_low": ("low", main.low), f"{prefix}ci_high": ("high", main.high)}
        variables |= {name: ("beside", variable) for name, variable in main.extra_columns.items()}
        for name, (role, variable) in variables.items():
            if variable not in table:
                continue
            attrs = table[variable].attrs
            is_percent = main.percent and (role != "beside" or name == "spread")
            column = Column(
                name,
                main.column,
                printable(name.replace("_", " ")),
                "%" if is_percent else unit_of(str(attrs.get("units", "1"))),
                printable(str(attrs.get("long_name", ""))),
                role,
                main.format,
                main.listed,
                PERCENT_DIGITS if is_percent else main.digits,
                100 if is_percent else 1,
                printable(str(attrs.get("infinite", "inf"))),
            )
            columns[name] = variable, column
    return columns


def column_of_axis(data: xr.Dataset, name: str) -> Column:
    """Return the column of an axis, with the label and unit of its setting."""
    attrs = data[name].attrs
    units = str(attrs.get("units", UNITS.get(name, "1")))
    meaning = printable(str(attrs.get("long_name", "")))
    return Column(file_name(name, units), name, words_of(name), unit_of(units), meaning)


def _is_extra_coordinate(data: xr.Dataset, name: str) -> bool:
    """Return whether a coordinate is neither an axis of its own nor a setting."""
    return name in data.coords and (name in HIDDEN_COORDS or name not in data.dims)


def _all_figures(table: xr.Dataset) -> Iterator[Figure]:
    """Yield a figure for every variable of a table that is not shown beside another."""
    names = [str(name) for name in table if not set(table[name].dims) & set(ARRAY_DIMS)]
    ends = [*BESIDE_SUFFIXES, *(end for pair in INTERVAL_SUFFIXES for end in pair)]
    for name in names:
        if not any(name.endswith(e) and name.removesuffix(e) in names for e in ends):
            yield Figure(name)


def _complete_figure(figure: Figure, table: xr.Dataset) -> Figure:
    """Return a figure with an interval and columns found by name, where it declares none."""
    name = figure.variable
    pairs = ((name + low, name + high) for low, high in INTERVAL_SUFFIXES)
    low, high = next((pair for pair in pairs if {*pair} <= {*table}), ("", ""))
    extra_columns = {name + end: name + end for end in BESIDE_SUFFIXES if name + end in table}
    return replace(
        figure,
        low=figure.low or low,
        high=figure.high or high,
        extra_columns=figure.extra_columns or extra_columns,
    )


def _to_nullable_dtype(values: pd.Series) -> pd.Series:
    """Return values as floats, or as integers and truth values that may be missing."""
    kind = values.dtype.kind
    types = {"f": "float64", "i": "Int64", "u": "Int64", "b": "boolean"}
    return values.astype(types[kind]) if kind in types else values.astype(object)


def stack_frames(parts: Sequence[Frame]) -> Frame:
    """Concatenate frames: labels first, then axes, the one across last, then figures."""
    columns = {name: column for part in parts for name, column in part.columns.items()}
    across = next((part.across for part in parts if part.across), "")
    labels = [name for part in parts for name in part.parts[0].display.labels]
    axes = [name for name, column in columns.items() if column.role in AXIS_ROLES]
    axes = [name for name in axes if name != across]
    figures = [name for name, column in columns.items() if column.role not in AXIS_ROLES]
    names = [*dict.fromkeys([*labels, *axes]), *[across] * bool(across), *figures]
    numbered = [part.rows.assign(**{PART: number}) for number, part in enumerate(parts)]
    rows = pd.concat(numbered, ignore_index=True) if len(numbered) > 1 else numbered[0]
    return replace(
        parts[0],
        rows=rows[[*names, PART]],
        columns={name: columns[name] for name in names},
        parts=tuple(part for table in parts for part in table.parts),
        down=tuple(dict.fromkeys(name for part in parts for name in part.down)),
        across=across,
        notes=tuple(dict.fromkeys(note for part in parts for note in part.notes)),
        joint=tuple(dict.fromkeys(sentence for part in parts for sentence in part.joint)),
    )


def values_of(rows: pd.DataFrame, name: str) -> list[Any]:
    """Return the values of an axis in some rows, numbers in ascending order."""
    values = rows[name].dropna().unique().tolist()
    if all(map(is_number, values)):
        values.sort()
    return values

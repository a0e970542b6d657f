"""The answer of a comparison: what changed most, where, whether by chance, and along the axis."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import pandas as pd

from sweeps.report.answer import thinned
from sweeps.report.compare import FIRST, NAME, SECOND, STORE, Comparison
from sweeps.report.contest import SHIP, is_test, main_axis
from sweeps.report.frames import Column, Frame
from sweeps.report.page.provenance import flat, in_words
from sweeps.report.pairs import LEVEL
from sweeps.report.pivot import Entry, Line, Table, entry
from sweeps.report.stores import attributes, opened
from sweeps.report.words import MAIN, missing

MOST_LINES, MOST_SETTINGS = 10, 3
ABOUT = ("seed", "version")  # attributes of a store that its results may depend on


def sentences(compared: Comparison) -> list[str]:
    """Return in words what changed most, at which setting, and whether chance alone would do it."""
    first, *others = compared.names
    if not compared.frames:
        return [f"{', '.join(others)} and {first} have the same results."]
    frame = next(iter(compared.frames.values()))
    label, row = _largest(frame)
    figure = frame.figures[0]
    column, main = frame.columns[figure], frame.name == NAME
    unit = f" {column.unit}".rstrip()
    one, other = (_end(frame, row, end) for end in (FIRST, SECOND))
    store = row.get(STORE, others[0])
    who = ", ".join(_names(frame, row))
    where = _place(frame, row)
    changed = _signed(entry(frame, label, figure))
    interval = f" [{changed.interval}]" if changed.interval else ""
    said = f"{who or column.words} changed most{f', at {where}' if where else ''}: "
    said = said[0].upper() + said[1:]
    said += f"from {one} in {first} to {other} in {store}, {changed.text}{unit}{interval}."
    if not main:
        return [said, "Without intervals it is not known whether chance alone would do so."]
    number = f"{compared.number:,} comparison{'s' * (compared.number != 1)}"
    corrected = f"by Holm's correction at {100 * LEVEL:.0f} %"
    if row["significant"] == 1:
        verb = "is" if compared.significant == 1 else "are"
        return [
            said,
            f"That is more than chance: {compared.significant:,} of {number} {verb}, {corrected}.",
        ]
    return [said, f"That may be chance: none of {number} exceeds it {corrected}."]


def answer(compared: Comparison, swept: Sequence[str]) -> Table:
    """Return a table of at most ten lines of what changed most, a column a store, along an axis.

    Without an axis, the lines are the curves that changed most. Of two stores the last column is
    the difference.
    """
    frame = next(iter(compared.frames.values()))
    _, largest = _largest(frame)
    figure, rows = frame.figures[0], _rows(frame)
    curve = [name for name in _curve(frame) if name != STORE]
    same = _same(rows, largest, curve)
    axis = main_axis(frame.where(same.index), swept)
    several = [name for name in frame.several if name not in (STORE, axis)]
    if axis:
        rows = _same(same, largest, [name for name in several if name not in curve])
        down, keys = frame.columns[axis], rows[axis]
    else:
        rows = _same(rows, largest, [name for name in several if name not in curve])
        keys = pd.Series([", ".join(_names(frame, row)) for _, row in rows.iterrows()], rows.index)
        down = Column("", "", ", ".join(frame.columns[n].words for n in curve) or "figure")
    order = rows[figure].abs().groupby(keys).max().sort_values(ascending=False, kind="stable")
    places = sorted(order.index) if axis and rows[axis].dtype.kind in "fiu" else [*order.index]
    lines = []
    for place in places:
        at = rows[keys == place]
        ends = {row.get(STORE, compared.names[1]): row for _, row in at.iterrows()}
        cells = [Entry(_end(frame, next(iter(ends.values())), FIRST, unit=False))]
        cells += [
            Entry(_end(frame, ends[name], SECOND, unit=False) if name in ends else "")
            for name in compared.names[1:]
        ]
        if len(compared.names) == 2:
            cells.append(_signed(entry(frame, at.index[0], figure)))
        text = down.text(place) if axis else str(place)
        lines.append(Line((place,), (text,), tuple(cells)))
    count = len(lines)
    lines = thinned(lines, MOST_LINES) if axis else lines[:MOST_LINES]
    title = frame.title.partition(":")[0].replace("[points]", "[%]")
    where = [*_names(frame, largest), _place(frame, largest, but=axis)] if axis else []
    heads = (*compared.names, "difference") if len(compared.names) == 2 else compared.names
    fewer = f"{len(lines)} of {count} lines." if count > len(lines) else ""
    return Table(
        frame.name,
        ", ".join(filter(None, [title, *where])),
        (down,),
        heads,
        tuple(lines),
        tuple(filter(None, [fewer])),
    )


def settings_that_differ(compared: Comparison) -> list[tuple[str, list[str]]]:
    """Return the settings that differ between stores: keys, and values in words of each store."""
    about = [attributes(opened(path)) for path in compared.paths]
    given: list[Mapping[str, Any]] = [
        dict(flat(one.get("configuration", {}))) | {key: one.get(key) for key in ABOUT}
        for one in about
    ]
    keys = dict.fromkeys(key for settings in given for key in settings)
    return [
        (key, [_written(settings.get(key)) for settings in given])
        for key in keys
        if len({json.dumps(settings.get(key), default=str) for settings in given}) > 1
    ]


def settings_sentence(compared: Comparison) -> str:
    """Return a sentence on the settings that differ, at most three."""
    differ = settings_that_differ(compared)
    if not differ:
        return "All settings are the same."
    listed = list[str]()
    for key, values in differ[:MOST_SETTINGS]:
        named = zip(values, compared.names, strict=True)
        *most, last = (f"{value} in {name}" for value, name in named)
        listed.append(f"{key} {', '.join(most)} and {last}")
    more = len(differ) - MOST_SETTINGS
    return f"Settings that differ: {'; '.join(listed)}{f'; and {more} more' if more > 0 else ''}."


def _signed(cell: Entry) -> Entry:
    """Return a difference whose interval has no dash beside a sign."""
    return replace(cell, interval=cell.interval.replace("–", " to "))


def _written(value: Any) -> str:
    return f"[{in_words(value, '')}]" if isinstance(value, list) else in_words([value], "")


def _rows(frame: Frame) -> pd.DataFrame:
    """Return the rows of differences that are answers: over all aspects, of tests."""
    rows = frame.rows[frame.rows[frame.figures[0]].notna()]
    overall = MAIN["aspect_bin"]
    if frame.across and (rows[frame.across] == overall).any():
        rows = rows[rows[frame.across] == overall]
    if "kind" in rows and (tests := rows.kind.map(is_test)).any():
        rows = rows[tests]
    return rows


def _largest(frame: Frame) -> tuple[Any, pd.Series]:
    """Return label and row of the largest difference, of the significant ones if any are."""
    rows = _rows(frame)
    if "significant" in rows and (rows.significant == 1).any():
        rows = rows[rows.significant == 1]
    label = rows[frame.figures[0]].astype(float).abs().idxmax()
    return label, rows.loc[label]


def _same(rows: pd.DataFrame, of: pd.Series, names: Sequence[str]) -> pd.DataFrame:
    """Return the rows that have the values of one row in some columns."""
    for name in names:
        rows = rows[rows[name].isna() if missing(of[name]) else rows[name] == of[name]]
    return rows


def _curve(frame: Frame) -> list[str]:
    return [name for name in frame.down if name in frame.several or name in ("classifier",)]


def _names(frame: Frame, row: pd.Series) -> list[str]:
    """Return the words of what a row is of, such as its classifier and sensor."""
    names = [n for n in frame.down if n != STORE and frame.rows[n].dtype == object]
    several = [n for n in names if n in frame.several or n in ("classifier", "channel")]
    words = [(name, row[name]) for name in several if not missing(row[name])]
    return [frame.columns[name].text(value) for name, value in words if value != SHIP]


def _place(frame: Frame, row: pd.Series, *, but: str = "") -> str:
    """Return the setting of a row: values of the axes along which rows differ."""
    words = [n for n in frame.down if frame.rows[n].dtype == object]
    names = [n for n in frame.several if n not in (*words, but, STORE, "kind")]
    names = [n for n in names if not missing(row[n]) and row[n] != MAIN["aspect_bin"]]
    return ", ".join(frame.columns[name].in_words(row[name]) for name in names)


def _end(frame: Frame, row: pd.Series, end: str, *, unit: bool = True) -> str:
    """Return the figure of a row in the first store, or in the second."""
    name = end if frame.name == NAME else f"{frame.figures[0]}_{end}"
    column = frame.columns[name]
    text = replace(column, role="figure").text(row[name])
    return f"{text} {column.unit}".rstrip() if unit else text

"""Frames as tables to look at: axes down, and an axis or the figures across."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from sweeps.report.frames import PART, Column, Frame, values_of
from sweeps.report.words import NOTHING, WORDED, missing, preferred


@dataclass(frozen=True)
class Cell:
    """A figure as printed: its interval, and what stands beside it."""

    text: str
    interval: str = ""
    source: str = ""
    spread: str = ""
    row: Any = None  # label of the frame's row, and column
    column: str = ""


@dataclass(frozen=True)
class Line:
    """A row of a table: its place on the axes down, and its cells."""

    place: tuple[Any, ...]
    keys: tuple[str, ...]
    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class Table:
    """A frame laid out: axes down, headings across, and the same figures in all rows apart."""

    title: str
    down: tuple[Column, ...]
    heads: tuple[str, ...]
    lines: tuple[Line, ...]
    same: Mapping[str, str]  # words of axes and figures of one value
    notes: tuple[str, ...]


def ordered(frame: Frame, swept: Sequence[str] = ()) -> list[str]:
    """Return axes of several values in the order of rows: swept ones, declared ones, others."""
    several = [name for name in frame.several() if name != frame.across]
    first = [name for name in several if frame.columns[name].axis in swept]
    second = [name for name in frame.down if name in several and name not in first]
    first.sort(key=lambda name: list(swept).index(frame.columns[name].axis))
    return [*first, *second, *(one for one in several if one not in (*first, *second))]


def laid_out(
    frame: Frame, swept: Sequence[str] = (), *, joined: Sequence[str] | None = None
) -> Table:
    """Return a frame as a table: one row for every place on the axes of several values.

    With `joined`, only these axes and the declared ones are down, the latter as one column of
    words.
    """
    down = ordered(frame, swept)
    if joined is not None:
        down = [name for name in down if name in (*joined, *frame.down)]
    across = frame.across if frame.across in frame.several() else ""
    figures = frame.figures
    if across:
        heads = values_of(frame.rows, across)
        column = frame.columns[across]
        unit = column.unit if column.unit == "°" else f" {column.unit}".rstrip()
        texts = [column.text(one) for one in heads]
        headings = [text + unit * (text[:1].isdigit()) for text in texts]
        if column.axis not in ("aspect_bin", "channel"):
            headings = [f"{column.words} {text}" for text in headings]
        extra = [name for name in figures[1:] if _is_constant(frame, name, down)]
    else:
        heads, headings, extra = [], [], list(figures)
    headings += [frame.columns[name].heading for name in extra]
    groups: dict[tuple[Any, ...], dict[Any, Any]] = {}
    keys = zip(*(frame.rows[name].tolist() for name in down), strict=True) if down else None
    for label, place in zip(frame.rows.index, keys or [()] * len(frame.rows), strict=True):
        place = tuple(None if missing(one) else one for one in place)
        of = frame.records[label][across] if across else None
        groups.setdefault(place, {})[of] = label
    order = {name: {v: k for k, v in enumerate(values_of(frame.rows, name))} for name in down}
    places = sorted(groups, key=lambda place: _rank(place, down, order))
    lines = []
    for place in places:
        at = groups[place]
        cells = [cell(frame, at.get(head), figures[0]) for head in heads]
        cells += [cell(frame, next(iter(at.values())), name) for name in extra]
        keyed = tuple(
            "" if value is None else frame.columns[name].text(value)
            for name, value in zip(down, place, strict=True)
        )
        lines.append(Line(place, keyed, tuple(cells)))
    columns = tuple(frame.columns[name] for name in down)
    first = next((k for k, name in enumerate(down) if name in frame.down), len(down))
    if joined is not None and first < len(down) - 1:
        lines = [_joined(line, columns, first) for line in lines]
        columns = (*columns[:first], replace(columns[first], unit=""))
    return Table(frame.title, columns, tuple(headings), tuple(lines), constants(frame), frame.notes)


def _joined(line: Line, columns: Sequence[Column], first: int) -> Line:
    """Return a row whose keys from one on are one text; numbers have the words of their axis."""
    words = [
        text if column.axis in WORDED or not text[:1].isdigit() else f"{column.words} {text}"
        for column, text in zip(columns[first:], line.keys[first:], strict=True)
        if text
    ]
    return replace(line, keys=(*line.keys[:first], ", ".join(words)))


def _rank(place: tuple[Any, ...], down: Sequence[str], order: Mapping[str, Any]) -> tuple[int, ...]:
    return tuple(order[name].get(value, -1) for name, value in zip(down, place, strict=True))


def _is_constant(frame: Frame, name: str, down: Sequence[str]) -> bool:
    """Return whether a figure is the same across."""
    if not down:
        return bool(frame.rows[name].nunique(dropna=False) == 1)
    return bool((frame.rows.groupby(list(down), dropna=False)[name].nunique() <= 1).all())


def constants(frame: Frame) -> dict[str, str]:
    """Return the values of axes of one value, with their units, by the words of the axis."""
    found = {}
    for name in frame.of_role("axis"):
        values = frame.rows[name].dropna().unique()
        column = frame.columns[name]
        if len(values) == 1 and not frame.rows[name].isna().any():
            unit = f" {column.unit}".rstrip()
            found[column.words] = column.text(values.tolist()[0]) + unit
    return found


def cell(frame: Frame, label: Any, figure: str) -> Cell:
    """Return a figure of a row with its interval, and the article's figure."""
    if label is None:
        return Cell("")
    row, column = frame.records[label], frame.columns[figure]
    value = row[figure]
    if missing(value):
        return Cell(NOTHING, row=label, column=figure)

    def beside(role: str) -> str:
        names = frame.of_role(role, figure)
        there = [name for name in names if not missing(row[name])]
        return column.text(row[there[0]]) if there else ""

    low, high = beside("low"), beside("high")
    return Cell(
        column.text(value),
        f"{low}–{high}" if low and high else "",
        beside("source"),
        *(_spread(frame, row, figure, column), label, figure),
    )


def _spread(frame: Frame, row: Any, figure: str, column: Column) -> str:
    """Return the standard deviation over draws of a figure without an interval."""
    if frame.of_role("low", figure):
        return ""
    names = [name for name in frame.of_role("beside", figure) if name.endswith("spread")]
    shown = [column.text(row[name]) for name in names if not missing(row[name]) and row[name]]
    return f"±{shown[0]}" if shown else ""


def at_main(frame: Frame, keep: Sequence[str] = ()) -> Frame:
    """Return a frame at the preferred value of every axis but some, and the one across.

    Parts of a frame that lack that value keep their own.
    """
    for name in frame.several():
        if name in (*keep, frame.across):
            continue
        values = values_of(frame.rows, name)
        if not values:
            continue
        axis = frame.columns[name].axis
        kept = frame.at({name: preferred(axis, values)}).rows.index
        rest = set(frame.rows[PART]) - set(frame.rows.loc[kept, PART])
        # What tells parts apart, such as tests from training, is not for them to keep.
        for part in (k for k in rest if name not in frame.parts[k].display.labels):
            own = frame.rows[frame.rows[PART] == part]
            there = values_of(own, name)
            own = own[own[name] == preferred(axis, there)]
            kept = kept.append(own.index)
        frame = frame.where(frame.rows.index.isin(kept))
    return frame


def place_of(whole: Frame, at: Frame, *, but: Sequence[str] = ()) -> str:
    """Return in words the values at which a frame is, of axes along which the whole differs."""
    found = []
    for name in whole.several():
        values = at.rows[name].dropna().unique().tolist()
        column = whole.columns[name]
        if len(values) == 1 and name not in (*whole.down, whole.across, *but):
            found.append(f"{column.words} {column.text(values[0])} {column.unit}".strip())
    return ", ".join(found)

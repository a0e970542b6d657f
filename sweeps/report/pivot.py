"""Frames as tables to look at: axes down, and an axis or the figures across."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from sweeps.report.frames import PART, Column, Frame, values_of
from sweeps.report.words import NOTHING, WORD_AXES, is_missing, preferred_value

FEW_ANSWERS = 30  # answers below which a score is said to rest on few


@dataclass(frozen=True)
class Entry:
    """A figure as printed, with its interval and the columns beside it."""

    text: str
    interval: str = ""
    article: str = ""
    spread: str = ""
    row: Any = None  # label of the frame's row, and column
    column: str = ""

    def in_unit(self, unit: str) -> str:
        """Return the figure with its unit and its interval."""
        return " ".join(filter(None, [self.text, unit, self.interval and f"[{self.interval}]"]))


@dataclass(frozen=True)
class Line:
    """A row of a table: its place on the axes down, and its cells."""

    place: tuple[Any, ...]
    keys: tuple[str, ...]
    cells: tuple[Entry, ...]


@dataclass(frozen=True)
class TextTable:
    """A frame laid out: axes down, headings across, and lines of figures."""

    name: str
    title: str
    down: tuple[Column, ...]
    heads: tuple[str, ...]
    lines: tuple[Line, ...]
    notes: tuple[str, ...]


def ordered_axes(frame: Frame, swept: Sequence[str]) -> list[str]:
    """Return the varying axes in the order of rows, axes of words last.

    Among the others, swept axes come first, then declared ones.
    """
    words = word_axes(frame)
    varying = [name for name in frame.varying_axes if name not in (frame.across, *words)]
    leading = [name for name in varying if frame.columns[name].axis in swept]
    leading.sort(key=lambda name: list(swept).index(frame.columns[name].axis))
    declared = [name for name in frame.down if name in varying]
    return [*dict.fromkeys([*leading, *declared, *varying]), *words]


def word_axes(frame: Frame) -> list[str]:
    """Return the declared axes down whose values are words, such as classifiers."""
    return [n for n in frame.down if n in frame.varying_axes and frame.rows[n].dtype == object]


def lay_out(frame: Frame, swept: Sequence[str] = ()) -> TextTable:
    """Return a frame as a table with one row for every place on the varying axes.

    The declared axes whose values are words, such as classifiers, are one column, the last.
    """
    down = ordered_axes(frame, swept)
    across = frame.across if frame.across in frame.varying_axes else ""
    heads = values_of(frame.rows, across) if across else []
    main, figures = frame.figures[0], frame.figures
    extra = figures
    if across:
        extra = [name for name in figures[1:] if _is_constant(frame, name, down)]
    headings = [_column_heading(frame.columns[across], value) for value in heads]
    headings += [frame.columns[name].heading for name in extra]
    groups: dict[tuple[Any, ...], dict[Any, Any]] = {}
    for label, row in frame.records.items():
        place = tuple(None if is_missing(row[name]) else row[name] for name in down)
        groups.setdefault(place, {})[row[across] if across else None] = label
    order = {name: {v: k for k, v in enumerate(values_of(frame.rows, name))} for name in down}
    lines = []
    for place in sorted(groups, key=lambda place: _rank(place, down, order)):
        labels = groups[place]
        cells = [make_entry(frame, labels.get(head), main) for head in heads]
        cells += [make_entry(frame, next(iter(labels.values())), name) for name in extra]
        keys = tuple(
            "" if value is None else frame.columns[name].text(value)
            for name, value in zip(down, place, strict=True)
        )
        lines.append(Line(place, keys, tuple(cells)))
    columns = tuple(frame.columns[name] for name in down)
    start = len(down) - len(word_axes(frame))
    if start < len(down) - 1:
        lines = [_join_keys(line, columns, start) for line in lines]
        words = ", ".join(column.words for column in columns[start:])
        columns = (*columns[:start], replace(columns[start], words=words, unit=""))
    return TextTable(
        frame.name,
        title_with_unit(frame) if across else frame.title,
        columns,
        tuple(headings),
        tuple(lines),
        notes_of(frame),
    )


def title_with_unit(frame: Frame) -> str:
    """Return the title of a frame, with its main figure and its unit unless it states the unit."""
    title, figure = frame.title, frame.columns[frame.figures[0]]
    if not figure.unit or f"[{figure.unit}" in title:
        return title
    same = figure.words.lower() == title.lower()
    return f"{title} [{figure.unit}]" if same else f"{title}: {figure.heading}"


def _column_heading(column: Column, value: Any) -> str:
    """Return the heading of a value of the axis across."""
    text = column.text(value)
    if text[:1].isdigit():
        text += column.unit if column.unit == "°" else f" {column.unit}".rstrip()
    if column.axis == "aspect_bin":
        return f"aspect {text}" if text[:1].isdigit() else text
    return text if column.axis in WORD_AXES else f"{column.words} {text}"


def _join_keys(line: Line, columns: Sequence[Column], start: int) -> Line:
    """Return a row with its keys from `start` on joined; numbers get the words of their axis."""
    words = [
        text if column.axis in WORD_AXES or not text[:1].isdigit() else f"{column.words} {text}"
        for column, text in zip(columns[start:], line.keys[start:], strict=True)
        if text
    ]
    return replace(line, keys=(*line.keys[:start], ", ".join(words)))


def notes_of(frame: Frame) -> tuple[str, ...]:
    """Return the notes of a table, including those on chance and wide intervals."""
    notes = [*frame.notes, *frame.joint, chance_in_words(frame)]
    if frame.columns_of_role("low") and frame.has_overall:
        notes.append(
            "The overall interval includes the variation between aspect bins, so it may be wider "
            "than theirs."
        )
    numbers = frame.rows["n"].dropna() if "n" in frame.rows else ()
    min_answers = min((number for number in numbers if number > 0), default=FEW_ANSWERS)
    if min_answers < FEW_ANSWERS:
        notes.append(f"Where answers are few (minimum n = {min_answers:.0f}), intervals are wide.")
    return tuple(note for note in notes if note)


def chance_in_words(frame: Frame) -> str:
    """Return a sentence on the level of chance, if it is constant or depends on one axis down."""
    for chance in frame.columns_of_role("chance", frame.figures[0]):
        text, unit = frame.columns[chance].text, frame.columns[chance].unit
        levels = frame.rows[chance].dropna().unique()
        if len(levels) == 1:
            return f"By chance: {text(levels[0])} {unit}."
        for name in frame.down:
            by_axis = frame.rows.groupby(name)[chance]
            if (by_axis.nunique() <= 1).all():
                words = frame.columns[name].text
                texts = [
                    f"{words(value)} {text(level)} {unit}" for value, level in by_axis.max().items()
                ]
                return f"By chance: {', '.join(texts)}."
    return ""


def _rank(place: tuple[Any, ...], down: Sequence[str], order: Mapping[str, Any]) -> tuple[int, ...]:
    return tuple(order[name].get(value, -1) for name, value in zip(down, place, strict=True))


def _is_constant(frame: Frame, name: str, down: Sequence[str]) -> bool:
    """Return whether a figure is the same across."""
    if not down:
        return bool(frame.rows[name].nunique(dropna=False) == 1)
    return bool((frame.rows.groupby(list(down), dropna=False)[name].nunique() <= 1).all())


def constant_values(frame: Frame) -> dict[str, str]:
    """Return the value, with unit, of each axis that has only one, by the words of the axis."""
    values_in_words = {}
    for name in frame.columns_of_role("axis"):
        values = frame.rows[name].dropna().unique()
        column = frame.columns[name]
        if len(values) == 1 and not frame.rows[name].isna().any():
            unit = f" {column.unit}".rstrip()
            values_in_words[column.words] = column.text(values.tolist()[0]) + unit
    return values_in_words


def make_entry(frame: Frame, label: Any, figure: str) -> Entry:
    """Return a figure of a row with its interval, and the article's figure."""
    if label is None:
        return Entry("")
    row, column = frame.records[label], frame.columns[figure]
    value = row[figure]
    if is_missing(value):
        return Entry(NOTHING, row=label, column=figure)

    def related_text(role: str, end: str = "") -> str:
        names = [name for name in frame.columns_of_role(role, figure) if name.endswith(end)]
        texts = [column.text(row[name]) for name in names if not is_missing(row[name])]
        return texts[0] if texts else ""

    low, high = related_text("low"), related_text("high")
    # Without an interval, the standard deviation over draws.
    spread = "" if frame.columns_of_role("low", figure) else related_text("beside", "spread")
    return Entry(
        column.text(value),
        f"{low}–{high}" if low and high and not _is_all_infinite(value, low, high) else "",
        related_text("article"),
        f"±{spread}" if spread.strip("0.") else "",
        label,
        figure,
    )


def _is_all_infinite(value: Any, low: str, high: str) -> bool:
    """Return whether a figure and both ends of its interval, as printed, are infinite."""
    return isinstance(value, float) and math.isinf(value) and low == high


def main_value(
    name: str, axis: str, values: Sequence[Any], case: Mapping[str, Any] | None = None
) -> Any:
    """Return the value of a column to show first: that of `case`, or the preferred one."""
    given = (case or {}).get(name)
    return given if given in values else preferred_value(axis, values)


def select_main(
    frame: Frame, keep: Sequence[str] = (), case: Mapping[str, Any] | None = None
) -> Frame:
    """Return a frame at the main value of every axis except `keep` and the one across.

    The main value is the one in `case`, by column, or the preferred one. A part of the frame
    without that value is taken at the main value of its rows.
    """
    for name in frame.varying_axes:
        if name in (*keep, frame.across):
            continue
        values = values_of(frame.rows, name)
        if not values:
            continue
        axis = frame.columns[name].axis
        labels = frame.select(name, main_value(name, axis, values, case)).rows.index
        other_parts = set(frame.rows[PART]) - set(frame.rows.loc[labels, PART])
        # Labels that distinguish parts, such as tests from training, select parts themselves.
        for part in (k for k in other_parts if name not in frame.parts[k].display.labels):
            rows = frame.rows[frame.rows[PART] == part]
            part_values = values_of(rows, name)
            rows = rows[rows[name] == main_value(name, axis, part_values, case)]
            labels = labels.append(rows.index)
        frame = frame.where(frame.rows.index.isin(labels))
    return frame

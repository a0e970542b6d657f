"""Headline and main table of a comparison: the largest change, its setting and significance."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pandas as pd

from ncti.text import printable
from sweeps.report.answer import thin_lines
from sweeps.report.compare import BOTH_STORES, NAME, STORE, Comparison
from sweeps.report.frames import Column, Frame
from sweeps.report.page.provenance import iter_settings, values_in_words
from sweeps.report.pairs import LEVEL
from sweeps.report.pivot import Entry, Line, TextTable, make_entry
from sweeps.report.ranking import SHIP, is_test, main_axis
from sweeps.report.stores import attributes, open_store
from sweeps.report.words import OVERALL, is_missing

MAX_LINES, MAX_LISTED = 10, 3
RUN_ATTRIBUTES = ("seed", "version")  # attributes of a store that its results may depend on


def change_sentences(compared: Comparison) -> list[str]:
    """Return sentences on the largest change, its setting, and whether it is significant."""
    first, *others = compared.names
    if not compared.frames:
        return [f"{', '.join(others)} and {first} have the same results wherever both have any."]
    frame = next(iter(compared.frames.values()))
    label, row = _largest_row(frame)
    figure = frame.figures[0]
    column, store = frame.columns[figure], row.get(STORE, others[0])
    setting = _row_setting(frame, row)
    suffix = f", at {setting}" if setting else ""
    subject = ", ".join(_row_names(frame, row)) or column.words
    before, after = (_end_text(frame, row, end) for end in BOTH_STORES)
    course = f"from {before} in {first} to {after} in {store}"
    if not is_missing(row[figure]):
        changed = _with_signed_interval(make_entry(frame, label, figure))
        course += f", {changed.in_unit(column.unit)}"
    if frame.name != NAME:
        table = printable(frame.name.removesuffix(f"_{NAME}").replace("_", " "))
        return [
            f"Of {table}, {subject} changed most{suffix}: {course}.",
            "This table has no intervals, so significance is unknown.",
        ]
    sentence = f"{subject[0].upper()}{subject[1:]} changed most{suffix}: {course}."
    if row["significant"] == 1:
        sentence = f"The largest difference beyond chance is that of {subject}{suffix}: {course}."
    if not compared.number:
        return [sentence, "All answers of tests are equal; only those at learned aspects changed."]
    significance = f"{compared.significant:,} of {compared.number:,}"
    return [
        sentence,
        f"Comparisons significant by Holm's correction at {100 * LEVEL:.0f} %: {significance}.",
    ]


def change_table(compared: Comparison, swept: Sequence[str]) -> TextTable:
    """Return a table of the largest changes along an axis, at most ten lines.

    For two stores it has both figures and their difference. For more stores it has only the
    differences from the first, since each pair shares different views. Without an axis, the lines
    are the curves that changed most.
    """
    frame = next(iter(compared.frames.values()))
    _, largest = _largest_row(frame)
    figure, rows = frame.figures[0], _overall_rows(frame)
    curve = [n for n in frame.down if n in (*frame.varying_axes, "classifier") and n != STORE]
    curve_rows = _matching_rows(rows, largest, curve)
    axis = main_axis(frame.where(curve_rows.index), swept)
    others = [name for name in frame.varying_axes if name not in (STORE, axis, *curve)]
    rows = _matching_rows(curve_rows if axis else rows, largest, others)
    if axis:
        down, keys = frame.columns[axis], rows[axis]
    else:
        keys = pd.Series(
            [", ".join(_row_names(frame, row)) for _, row in rows.iterrows()], rows.index
        )
        down = Column("", "", ", ".join(frame.columns[n].words for n in curve) or "figure")
    order = rows[figure].abs().groupby(keys).max().sort_values(ascending=False, kind="stable")
    line_keys = sorted(order.index) if axis and rows[axis].dtype.kind in "fiu" else [*order.index]
    lines, two = [], len(compared.names) == 2
    for key in line_keys:
        key_rows = rows[keys == key]
        labels = {row.get(STORE, compared.names[1]): label for label, row in key_rows.iterrows()}
        cells = [
            _with_signed_interval(make_entry(frame, labels[name], figure))
            if name in labels
            else Entry("")
            for name in compared.names[1:]
        ]
        if two:
            row = key_rows.iloc[0]
            cells = [
                *(Entry(_end_text(frame, row, end, unit=False)) for end in BOTH_STORES),
                *cells,
            ]
        text = down.text(key) if axis else str(key)
        lines.append(Line((key,), (text,), tuple(cells)))
    count = len(lines)
    lines = thin_lines(lines, MAX_LINES) if axis else lines[:MAX_LINES]
    title = frame.title.partition(":")[0].replace("[points]", "[%]") if two else frame.title
    subtitle = [*_row_names(frame, largest), _row_setting(frame, largest, but=axis)] if axis else []
    heads = (*compared.names, "difference") if two else compared.names[1:]
    truncation_note = f"{len(lines)} of {count} lines." if count > len(lines) else ""
    return TextTable(
        frame.name,
        ", ".join(filter(None, [title, *subtitle])),
        (down,),
        heads,
        tuple(lines),
        tuple(filter(None, [truncation_note])),
    )


def settings_that_differ(compared: Comparison) -> list[tuple[str, list[str]]]:
    """Return the settings that differ between stores: keys, and each store's value in words."""
    configurations: list[dict[str, Any]] = []
    for attrs in (attributes(open_store(path)) for path in compared.paths):
        settings = dict(iter_settings(attrs.get("configuration", {})))
        configurations.append(settings | {key: attrs.get(key) for key in RUN_ATTRIBUTES})
    keys = dict.fromkeys(key for settings in configurations for key in settings)
    return [
        (key, [_setting_text(settings.get(key)) for settings in configurations])
        for key in keys
        if len({json.dumps(settings.get(key), default=str) for settings in configurations}) > 1
    ]


def settings_sentence(compared: Comparison) -> str:
    """Return a sentence on the settings and ships that differ, at most three of each."""
    settings, ships = list[str](), ships_that_differ(compared)
    for key, values in settings_that_differ(compared):
        by_store = zip(values, compared.names, strict=True)
        *former, last = (f"{value} in {name}" for value, name in by_store)
        settings.append(f"{key} {', '.join(former)} and {last}")
    sentence = (
        f"Settings that differ: {_abbreviate(settings)}."
        if settings
        else "All settings are the same."
    )
    return sentence + (f" Ships that differ: {_abbreviate(ships)}." if ships else "")


def ships_that_differ(compared: Comparison) -> list[str]:
    """Return the names of ships whose meshes or transforms differ between stores."""
    meshes: dict[str, set[tuple[str, str]]] = {}
    for attrs in (attributes(open_store(path)) for path in compared.paths):
        transforms = attrs.get("mesh_transforms", {})
        for name, digest in attrs.get("mesh_digests", {}).items():
            meshes.setdefault(name, set()).add((digest, transforms.get(name, "")))
    return [printable(name) for name, digests in meshes.items() if len(digests) > 1]


def _abbreviate(listed: Sequence[str]) -> str:
    """Return the first texts of a list and the number of the others."""
    more = len(listed) - MAX_LISTED
    return "; ".join(listed[:MAX_LISTED]) + (f"; and {more} more" if more > 0 else "")


def _with_signed_interval(cell: Entry) -> Entry:
    """Return a difference with 'to' between the signed ends of its interval."""
    return replace(cell, interval=cell.interval.replace("–", " to "))


def _setting_text(value: Any) -> str:
    if isinstance(value, list):
        return f"[{values_in_words(value, '')}]"
    return values_in_words([value], "")


def _overall_rows(frame: Frame) -> pd.DataFrame:
    """Return the rows of differences over all aspects, of tests where there are any."""
    ends = [_end_column(frame, end) for end in BOTH_STORES]
    rows = frame.rows[frame.rows[ends].notna().any(axis=1)]
    if frame.where(rows.index).has_overall:
        rows = rows[rows[frame.across] == OVERALL]
    if "kind" in rows and (tests := rows.kind.map(is_test)).any():
        rows = rows[tests]
    return rows


def largest_case(compared: Comparison) -> dict[str, Any]:
    """Return the axis values of the largest change, by column."""
    frame = next(iter(compared.frames.values()), None)
    if frame is None:
        return {}
    _, row = _largest_row(frame)
    return {name: row[name] for name in frame.varying_axes if not is_missing(row[name])}


def _largest_row(frame: Frame) -> tuple[Any, pd.Series]:
    """Return label and row of the largest difference, among significant ones if there are any.

    If no difference is a number other than 0, take a row where only one store has a value.
    """
    rows = _overall_rows(frame)
    if "significant" in rows and (rows.significant == 1).any():
        rows = rows[rows.significant == 1]
    sizes = rows[frame.figures[0]].astype(float).abs().fillna(-1)
    if not (sizes > 0).any() and (sizes < 0).any():
        sizes = -sizes
    label = sizes.idxmax()
    return label, rows.loc[label]


def _matching_rows(rows: pd.DataFrame, reference: pd.Series, names: Sequence[str]) -> pd.DataFrame:
    """Return the rows that equal a reference row in some columns."""
    for name in names:
        rows = rows[
            rows[name].isna() if is_missing(reference[name]) else rows[name] == reference[name]
        ]
    return rows


def _row_names(frame: Frame, row: pd.Series) -> list[str]:
    """Return the words that identify a row, such as its classifier and sensor."""
    names = [n for n in frame.down if n != STORE and frame.rows[n].dtype == object]
    varying = [n for n in names if n in frame.varying_axes or n in ("classifier", "channel")]
    words = [(name, row[name]) for name in varying if not is_missing(row[name])]
    return [frame.columns[name].text(value) for name, value in words if value != SHIP]


def _row_setting(frame: Frame, row: pd.Series, *, but: str = "") -> str:
    """Return the setting of a row: its values of the axes that vary between rows."""
    words = [n for n in frame.down if frame.rows[n].dtype == object]
    names = [n for n in frame.varying_axes if n not in (*words, but, STORE, "kind")]
    names = [n for n in names if not is_missing(row[n]) and row[n] != OVERALL]
    return ", ".join(frame.columns[name].in_words(row[name]) for name in names)


def _end_column(frame: Frame, end: str) -> str:
    """Return the column of the main figure in the first store, or in the second."""
    return end if frame.name == NAME else f"{frame.figures[0]}_{end}"


def _end_text(frame: Frame, row: pd.Series, end: str, *, unit: bool = True) -> str:
    """Return the main figure of a row in the first store, or in the second."""
    name = _end_column(frame, end)
    column = replace(frame.columns[name], role="figure")
    if unit and is_missing(row[name]):
        return "no value"
    return f"{column.text(row[name])} {column.unit * unit}".rstrip()

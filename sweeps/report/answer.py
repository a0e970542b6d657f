"""The one table of the screen: the swept axis down, and classifiers, or figures, across."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from sweeps.report.frames import Frame, values_of
from sweeps.report.headline import settings_of
from sweeps.report.pivot import (
    Entry,
    Line,
    TextTable,
    lay_out,
    make_entry,
    select_main,
    title_with_unit,
)
from sweeps.report.ranking import Candidate, main_axis, rank_candidates
from sweeps.report.terminal import count_fitting_columns, entry_text
from sweeps.report.words import OVERALL

MAX_ROWS, MAX_COLUMNS, MAX_WIDTH = 12, 6, 80


def answer_table(frame: Frame, swept: Sequence[str], width: int) -> TextTable:
    """Return the main table of a store: at most 12 rows, no wider than `width` and 80 cells.

    Several classifiers are columns, the best first, or rows without an axis. For one classifier,
    and for other results, the figures are columns.
    """
    columns = {name: col for name, col in frame.columns.items() if col.role != "article"}
    frame = replace(frame, columns=columns)
    axis, width = main_axis(frame, swept), min(width, MAX_WIDTH)
    candidates = rank_candidates(frame, axis)
    if len(candidates) < 2:
        frame = _add_second_axis(frame, axis)
        table = _figure_table(frame, [axis] * bool(axis))
    elif any(candidate.axis for candidate in candidates):
        table = _axis_table(frame, axis, candidates)
    else:
        table = _candidate_table(frame, candidates)
    notes = [*table.notes, _omission_note(table, frame, axis)]
    table = replace(
        table, lines=tuple(thin_lines(table.lines, MAX_ROWS) if axis else table.lines[:MAX_ROWS])
    )
    table, left_out = _narrow_table(table, width)
    # The headline states the level of chance, and the setting of the best classifier.
    sentences = (*notes, *frame.joint, left_out, _other_settings(frame, candidates))
    return replace(table, notes=tuple(text for text in sentences if text))


def _other_settings(frame: Frame, candidates: Sequence[Candidate]) -> str:
    """Return a sentence on settings of the other candidates that differ from the best one's."""
    best = settings_of(frame, candidates[0]) if candidates else {}
    differing: dict[str, list[str]] = {}
    for candidate in candidates[1:]:
        for words, value in settings_of(frame, candidate).items():
            if best.get(words) != value and value not in differing.setdefault(words, []):
                differing[words].append(value)
    listed = [f"{words} {' or '.join(values)}" for words, values in differing.items() if values]
    return f"Where they apply: {', '.join(listed)}." if listed else ""


def thin_lines(lines: Sequence[Line], count: int) -> list[Line]:
    """Return at most `count` rows, evenly spaced, including the first and the last."""
    if len(lines) <= count:
        return list(lines)
    step = (len(lines) - 1) / (count - 1)
    return [lines[round(step * index)] for index in range(count)]


def _axis_table(frame: Frame, axis: str, candidates: Sequence[Candidate]) -> TextTable:
    """Return the main figure by an axis, one column for each candidate that depends on it."""
    along, column = [candidate for candidate in candidates if candidate.axis], frame.columns[axis]
    labels = [dict(zip(c.frame.rows[axis], c.frame.rows.index, strict=True)) for c in along]
    values = [v for v in values_of(frame.rows, axis) if any(v in by_value for by_value in labels)]
    lines = [
        Line(
            (value,),
            (column.text(value),),
            tuple(make_entry(frame, by_value.get(value), frame.figures[0]) for by_value in labels),
        )
        for value in values
    ]
    independent = [c for c in candidates if not c.axis]
    entries = [make_entry(frame, c.frame.rows.index[0], frame.figures[0]) for c in independent]
    texts = [f"{c.name} {entry_text(e)}" for c, e in zip(independent, entries, strict=True)]
    notes = [f"Whatever the {column.words}: {'; '.join(texts)}."] if texts else []
    title, heads = title_with_unit(frame), tuple(candidate.name for candidate in along)
    return TextTable(frame.name, title, (column,), heads, tuple(lines), tuple(notes))


def _candidate_table(frame: Frame, candidates: Sequence[Candidate]) -> TextTable:
    """Return the main figure of each candidate: overall, or else by the axis across."""
    names = list(dict.fromkeys(name for candidate in candidates for name in candidate.of))
    words = ", ".join(frame.columns[name].words for name in names)
    column = replace(frame.columns[names[0]], words=words, unit="")
    table = _figure_table(frame, names)
    by_name = {", ".join(filter(None, line.keys)): line for line in table.lines}
    lines = [replace(by_name[c.name], keys=(c.name,)) for c in candidates if c.name in by_name]
    return replace(table, lines=tuple(lines), down=(column,))


def _figure_table(frame: Frame, axes: Sequence[str]) -> TextTable:
    """Return the figures by some axes, or the main figure by these and the axis across."""
    selected = select_main(frame, axes)
    if selected.has_overall:
        selected = selected.select(selected.across, OVERALL)
    return replace(lay_out(selected.keep_axes([*axes, selected.across])), notes=())


def _add_second_axis(frame: Frame, axis: str) -> Frame:
    """Return a frame with one figure and a second axis of few values across."""
    if not axis or frame.across or len(frame.figures) > 1:
        return frame
    candidates = [name for name in frame.varying_axes if name not in (axis, *frame.down)]
    short_axes = [name for name in candidates if frame.rows[name].nunique() <= MAX_COLUMNS]
    return replace(frame, across=next(iter(short_axes), ""))


def _omission_note(table: TextTable, frame: Frame, axis: str) -> str:
    """Return a sentence on the rows of a table that are not shown, if any."""
    count = len(table.lines)
    if count <= MAX_ROWS:
        return ""
    if axis:
        return f"{MAX_ROWS} of {count} values of {frame.columns[axis].words}, evenly spaced."
    return f"{count - MAX_ROWS} more are in {table.name}.csv."


def _narrow_table(table: TextTable, width: int) -> tuple[TextTable, str]:
    """Return a table cut to a width, dropping intervals, then last columns; and a note on it."""
    if count_fitting_columns(table, width) == len(table.heads):
        return table, ""
    lines = [
        replace(line, cells=tuple(Entry(cell.text) for cell in line.cells)) for line in table.lines
    ]
    count = count_fitting_columns(replace(table, lines=tuple(lines)), width)
    lines = [replace(line, cells=line.cells[:count]) for line in lines]
    dropped = len(table.heads) - count
    has_intervals = any(cell.interval for line in table.lines for cell in line.cells)
    intervals = "Intervals" if has_intervals else ""
    columns = f"{dropped} more column{'s' * (dropped > 1)}" if dropped else ""
    omitted = " and ".join(filter(None, [intervals, columns]))
    verb = "is" if omitted.startswith("1 ") else "are"
    note = f"{omitted} {verb} in {table.name}.csv." if omitted else ""
    return replace(table, heads=table.heads[:count], lines=tuple(lines)), note

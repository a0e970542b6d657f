"""The result of a sweep in words: which classifier is best, how often it is right, and where."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from sweeps.report.frames import Column, Frame
from sweeps.report.pivot import FEW_ANSWERS, constant_values, make_entry
from sweeps.report.ranking import (
    SCORES,
    TRAINING_KINDS,
    Candidate,
    main_axis,
    main_frame,
    rank_candidates,
)
from sweeps.report.stores import PROFILE_ERROR
from sweeps.report.words import OVERALL, SIMPLEST, is_missing

NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
STATED = ("range", "pulse width", "vigilance", "frame count", "infrared frame count", "aspects")
"""Settings that a headline states even if they do not vary."""
COVERAGE = 0.95
"""Share of views whose error `accuracy_sentences` states."""
MAX_DIGITS = 6  # at most, to tell two ends apart
NOT_SIGNIFICANT = ", not significantly better than chance"

SENSOR_WORDS = {"range": "range profiles", "infrared": "silhouettes", "both": "both sensors"}


def headline(frames: Mapping[str, Frame], attributes: Mapping[str, Any]) -> list[str]:
    """Return sentences on the main result of a store, each with its setting."""
    frame = main_frame(frames)
    axis = main_axis(frame, attributes.get("swept", ()))
    candidates = rank_candidates(frame, axis)
    if not candidates:
        score = SCORES in frames
        return ["No score: no test has an answer." if score else f"{frame.title}: no result."]
    if SCORES in frames:
        return [_score_sentence(frame, candidates, ships_in_words(attributes))]
    return [_figure_sentence(frame, candidates[0])]


def accuracy_sentences(store: Any) -> list[str]:
    """Return a sentence on the numerical error of a store's range profiles, if it has any."""
    errors = np.asarray(store[PROFILE_ERROR]) if PROFILE_ERROR in store else np.zeros(0)
    errors = errors[errors > 0]  # also drops NaN
    if not errors.size:
        return []
    percent = 100 * float(np.quantile(errors, COVERAGE, method="higher"))
    unit = 10 ** (math.floor(math.log10(percent)) - 1)
    bound_text = f"{math.ceil(percent / unit) * unit:.10g} % of the exact ones"
    return [f"Profiles are within {bound_text} ({100 * COVERAGE:.0f} % of views)."]


def headline_for_script(
    frames: Mapping[str, Frame], attributes: Mapping[str, Any], max_rows: int
) -> dict[str, Any] | None:
    """Return the data from which the page's script writes the headline of another selection.

    None for a store without scores, or with more rows than the page has.
    """
    if SCORES not in frames or len(frames[SCORES].rows) > max_rows:
        return None
    frame = main_frame(frames)
    figure, axes = frame.figures[0], frame.columns_of_role("axis")
    return frame.related_columns(figure) | {
        "table": SCORES,
        "figure": figure,
        "ships": ships_in_words(attributes),
        "by": SENSOR_WORDS,
        "axes": {name: (frame.columns[name].words, frame.columns[name].unit) for name in axes},
        "settings": _setting_columns(frame),
        "simplest": SIMPLEST,
        "untested": TRAINING_KINDS,
        "overall": OVERALL,
        "few": FEW_ANSWERS,
    }


def settings_of(table: Frame, candidate: Candidate) -> dict[str, str]:
    """Return the setting of a candidate, except on its axis: values by the words of their axes."""
    columns, values = candidate.frame.columns, constant_values(candidate.frame)
    names = [n for n in _setting_columns(table) if n not in (candidate.axis, *candidate.of)]
    words = [columns[name].words for name in names]
    return {axis: values[axis] for axis in words if axis in values}


def _setting_columns(frame: Frame) -> list[str]:
    """Return the columns of `STATED` axes and of axes that vary between rows."""
    by_words = {frame.columns[name].words: name for name in frame.columns_of_role("axis")}
    listed = [by_words[words] for words in STATED if words in by_words]
    left_out = (*frame.down, frame.across, "kind")
    return list(dict.fromkeys([*listed, *(n for n in frame.varying_axes if n not in left_out)]))


def _score_sentence(scores: Frame, candidates: Sequence[Candidate], ships: str) -> str:
    """Return a sentence on the best classifier: percent correct, interval, setting and chance."""
    best = candidates[0]
    frame, figure = best.frame, scores.figures[0]
    row = frame.rows.iloc[0]
    classifier = frame.columns["classifier"].text(row.classifier)
    name = f"{classifier} on {SENSOR_WORDS.get(row.channel, row.channel)}"
    count = len(candidates)
    start = f"Best of {count}: {name}" if count > 1 else name[0].upper() + name[1:]
    first, *last = _end_labels(best)
    words, first_remark = _format_figure(frame, first)
    ends = f"{words} of {ships}{_position_text(best, first)}{first_remark}"
    for label in last:
        words, remark = _format_figure(frame, label)
        place = _position_text(best, label, whole_words=False)
        ends += f"{',' * bool(first_remark)} and {words}{place}{remark}"
    setting = ", ".join(f"{words} {value}" for words, value in settings_of(scores, best).items())
    sentence = f"{start} identifies {ends}{f' ({setting})' if setting else ''}"
    level = frame.column_of_role("chance", figure)
    sentence += f"; chance {row[level]:.0f} %." if level else "."
    sentence += _ranking_sentence(candidates)
    min_answers = frame.rows["n"].min() if "n" in frame.rows else FEW_ANSWERS
    if min_answers < FEW_ANSWERS:
        sentence += f" Few answers (n = {min_answers:.0f}) make the interval wide."
    return sentence


def _ranking_sentence(candidates: Sequence[Candidate]) -> str:
    """Return a sentence on the values that rank candidates, unless all have all values."""
    candidate = next((candidate for candidate in candidates if candidate.axis), None)
    if candidate is None or len(candidate.shared) == candidate.count:
        return ""
    words = candidate.frame.columns[candidate.axis].words
    if not candidate.shared:
        return f" Ranked by means over different values of {words}, since none is shared."
    count = len(candidate.shared)
    pronoun = "those" if count > 1 else "the one"
    return f" Ranked by {count} of {candidate.count} values of {words}, {pronoun} that all have."


def _figure_sentence(table: Frame, candidate: Candidate) -> str:
    """Return a sentence on the main figure of any table, between the ends of its axis."""
    frame, column = candidate.frame, table.columns[table.figures[0]]
    row, numeric = frame.rows.iloc[0], pd.api.types.is_numeric_dtype(frame.rows[column.name])
    identity = [name for name in candidate.of if name in table.varying_axes]
    settings = [
        frame.columns[name].in_words(row[name])
        for name in dict.fromkeys([*identity, *table.varying_axes])
        if name != candidate.axis and not is_missing(row[name])
    ]
    name = column.words[0].upper() + column.words[1:]
    ends = _end_labels(candidate)
    if len(ends) == 2 and numeric:
        clause = f"{name} {_describe_course(candidate, column)}"
    else:
        words, remark = _format_figure(frame, ends[0])
        clause = f"{name} is {words}{_position_text(candidate, ends[0])}{remark}"
    level = frame.column_of_role("chance", column.name)
    chance = f"; chance {row[level]:.0f} %" if level else ""
    return f"{', '.join([clause, *settings])}{chance}."


def _describe_course(candidate: Candidate, column: Column) -> str:
    """Return how a figure changes along an axis, such as 'falls from 3 at 1 to 2 at 5 km'.

    Along an axis without a unit, its words stand before each value.
    """
    frame, ends = candidate.frame, _end_labels(candidate)
    axis, rows = frame.columns[candidate.axis], frame.rows
    values = rows[column.name].astype(float)
    first, last = (float(values.loc[label]) for label in ends)
    texts = dict(zip(ends, _distinct_numbers(first, last, column), strict=True))
    words = f"{axis.words} " * (not axis.unit)
    end_positions = _axis_texts([rows.at[label, candidate.axis] for label in ends], axis)
    start, stop = (f"{words}{text}" for text in end_positions)
    stop = f"{stop} {axis.unit}".rstrip()
    first_text, last_text = (
        replace(make_entry(frame, label, column.name), text=texts[label]).in_unit(column.unit)
        for label in ends
    )
    if texts[ends[0]] == texts[ends[1]]:
        clause = f"is {first_text} at {start} and at {stop}"
    elif not pd.api.types.is_numeric_dtype(rows[candidate.axis]):
        clause = f"is {first_text} at {start} and {last_text} at {stop}"
    else:
        verb = "falls" if last < first else "rises"
        clause = f"{verb} from {first_text} at {start} to {last_text} at {stop}"
    if not np.isfinite(values).all():
        return clause
    # An extreme between the ends is part of the answer.
    minimum, maximum = values.min(), values.max()
    for word, label, excess in (
        ("minimum", values.idxmin(), min(first, last) - minimum),
        ("maximum", values.idxmax(), maximum - max(first, last)),
    ):
        if excess > 0.1 * (maximum - minimum):
            text = _distinct_numbers(float(values.loc[label]), last, column)[0]
            place = f"{words}{axis.text(rows.at[label, candidate.axis])}"
            clause += f", with a {word} of {text} at {place}"
    return clause


def _distinct_numbers(first: float, last: float, column: Column) -> tuple[str, str]:
    """Return two numbers to two digits, or to as many digits as distinguish them."""
    largest = max(abs(first), abs(last))
    if column.unit == "%" or not (math.isfinite(largest) and 1e-4 <= largest < 1e6):
        return column.text(first), column.text(last)
    texts = "", ""
    for digits in range(2, MAX_DIGITS + 1):
        texts = _round_significant(first, digits), _round_significant(last, digits)
        if texts[0] != texts[1] or first == last:
            break
    return texts


def _round_significant(value: float, digits: int) -> str:
    """Return a number to some significant digits, whole ones in full and without an exponent."""
    if value.is_integer():
        return f"{value:.0f}"
    return f"{value:.{max(0, digits - 1 - math.floor(math.log10(abs(value))))}f}"


def _axis_texts(values: Sequence[Any], column: Column) -> list[str]:
    """Return values of an axis with equally many decimals."""
    texts = [column.text(value) for value in values]
    decimals = max(len(text.partition(".")[2]) for text in texts)
    if not decimals or not all(text.replace(".", "", 1).lstrip("-").isdigit() for text in texts):
        return texts
    return [f"{value:.{decimals}f}" for value in values]


def _end_labels(candidate: Candidate) -> list[Any]:
    """Return the labels of the first and the last row; only the first without an axis."""
    labels = candidate.frame.rows.index
    return list(dict.fromkeys([labels[0], labels[-1]])) if candidate.axis else [labels[0]]


def _format_figure(frame: Frame, label: Any) -> tuple[str, str]:
    """Return a figure with unit and interval, and a remark if it may be chance."""
    figure = frame.columns[frame.figures[0]]
    cell, row = make_entry(frame, label, figure.name), frame.rows.loc[label]
    low, chance = (frame.column_of_role(role, figure.name) for role in ("low", "chance"))
    has_bounds = low and chance and not is_missing(row[low]) and not is_missing(row[chance])
    is_doubtful = has_bounds and row[low] <= row[chance]
    return cell.in_unit(figure.unit), NOT_SIGNIFICANT if is_doubtful else ""


def _position_text(candidate: Candidate, label: Any, *, whole_words: bool = True) -> str:
    """Return the position of a row on its axis, with the name of the axis if `whole_words`."""
    if not candidate.axis:
        return ""
    frame = candidate.frame
    column, value = frame.columns[candidate.axis], frame.rows.at[label, candidate.axis]
    words = column.in_words(value) if whole_words else f"{column.text(value)} {column.unit}"
    return f" at {words}".rstrip()


def ships_in_words(attributes: Mapping[str, Any]) -> str:
    """Return the number of learned ships in words."""
    configuration = attributes.get("configuration", {})
    ships = configuration.get("grid", {}).get("ship")
    unknown = configuration.get("classifier", {}).get("unknown") or ()
    if ships is None:
        return "ships"
    count = len([ships] if isinstance(ships, str) else ships) - len(unknown)
    number = NUMBERS[count] if count < len(NUMBERS) else str(count)
    return f"{number} ship{'s' * (count != 1)}"

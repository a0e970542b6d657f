"""What a sweep found, in words: how often which classifier is right, at which setting."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sweeps.report.frames import Frame, values_of
from sweeps.report.pivot import FEW, at_main, constants, entry
from sweeps.report.stores import ERRORS
from sweeps.report.words import MAIN, missing, preferred

NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
NAMED = ("range", "pulse width", "vigilance", "frame count", "infrared frame count", "aspects")
COVERED = 0.95
"""Share of views whose error `accuracy` states."""

BY = {"range": "range profiles", "infrared": "silhouettes", "both": "both sensors"}


def headline(frames: Mapping[str, Frame], attributes: Mapping[str, Any]) -> list[str]:
    """Return sentences on the main result of a store, each with its setting."""
    swept = list(attributes.get("swept", ()))
    if "scores" not in frames:
        return [_of_any(next(iter(frames.values())), swept)]
    scores = frames["scores"]
    tested = scores.where(~scores.rows.kind.isin(["training", "learned"]))
    if tested.rows[tested.figures[0]].notna().sum() == 0:
        return ["No score: no test has an answer."]
    axis = main_axis(tested, swept)
    overall = tested.at({tested.across: MAIN["aspect_bin"]}) if tested.across else tested
    channels = values_of(overall.rows, "channel")
    if "both" in channels:
        channels = [preferred("channel", channels)]
    sentences = [
        _of_scores(overall.at({"channel": channel}), axis, attributes) for channel in channels
    ]
    return [sentence for sentence in sentences if sentence]


def accuracy(store: Any) -> list[str]:
    """Return a sentence on the numerical error of a store's range profiles, if it has any."""
    errors = np.asarray(store[ERRORS]) if ERRORS in store else np.zeros(0)
    errors = errors[errors > 0]  # nor NaN
    if not errors.size:
        return []
    percent = 100 * float(np.quantile(errors, COVERED, method="higher"))
    unit = 10 ** (math.floor(math.log10(percent)) - 1)
    most = f"{math.ceil(percent / unit) * unit:.10g}"
    return [f"Profiles are within {most} % of the exact ones ({100 * COVERED:.0f} % of views)."]


def main_axis(frame: Frame, swept: Sequence[str]) -> str:
    """Return the column of the axis that was swept, of numbers if there is one; else empty."""
    several = frame.several
    names = [n for axis in swept for n in several if frame.columns[n].axis == axis]
    names = [name for name in names if name != frame.across and name not in frame.down]
    numeric = [name for name in names if frame.rows[name].dtype.kind in "fiu"]
    return next(iter([*numeric, *names]), "")


def _of_scores(scores: Frame, axis: str, attributes: Mapping[str, Any]) -> str:
    """Return a sentence on the best classifier of a channel; empty if none has a score."""
    figure = scores.figures[0]
    best = at_main(scores, [*scores.down, *[axis] * bool(axis)])
    best = best.where(best.rows[figure].notna())
    if best.rows.empty:
        return ""
    names = ["classifier", "scored"]
    mean = best.rows.groupby(names, dropna=False)[figure].mean()
    best = best.at(dict(zip(names, mean.idxmax(), strict=True)))
    best = best.where(~best.rows.duplicated([axis] if axis else names))
    row, given = best.rows.iloc[0], constants(best)
    classifier = best.columns["classifier"].text(row.classifier)
    where = ", ".join(f"{words} {given[words]}" for words in NAMED if words in given)
    sentence = (
        f"{classifier[0].upper()}{classifier[1:]} on {BY.get(row.channel, row.channel)} "
        f"identifies {_ends(best, axis)} of {ships_in_words(attributes)}"
        f"{f' ({where})' if where else ''}"
    )
    chance = [row[name] for name in best.of_role("chance", figure)]
    sentence += f"; chance {chance[0]:.0f} %." if chance else "."
    least = best.rows["n"].min() if "n" in best.rows else FEW
    if least < FEW:
        sentence += f" Few answers (n = {least:.0f}) make the interval wide."
    return sentence


def _of_any(frame: Frame, swept: Sequence[str]) -> str:
    """Return a sentence on the main figure of any table, between the ends of the swept axis.

    Of a figure that has a level of chance it is the best row, else the first.
    """
    axis, column = main_axis(frame, swept), frame.columns[frame.figures[0]]
    chance = frame.of_role("chance", column.name)
    compared = [name for name in frame.down if chance and name != axis]
    at = at_main(frame, [*compared, *[axis] * bool(axis)])
    if across := at.across:
        at = at.at({across: preferred(at.columns[across].axis, values_of(at.rows, across))})
    at = at.where(at.rows[column.name].notna())
    if at.rows.empty:
        return f"{frame.title}: no result."
    best = at.rows.loc[at.rows[column.name].idxmax() if compared else at.rows.index[0]]
    at = at.at({name: best[name] for name in compared})
    names = [name for name in frame.several if name != axis and not missing(best[name])]
    place = ", ".join(frame.columns[name].in_words(best[name]) for name in names)
    level = f"; chance {best[chance[0]]:.0f} %" if chance else ""
    return f"{column.words.capitalize()}: {_ends(at, axis)}{f' ({place})' if place else ''}{level}."


def _ends(frame: Frame, axis: str) -> str:
    """Return the main figure at the ends of an axis in words, or in the first row without one."""
    rows = frame.rows.sort_values(axis) if axis else frame.rows[:1]
    figure, ends = frame.columns[frame.figures[0]], []
    for label in dict.fromkeys([rows.index[0], rows.index[-1]]):
        percent = entry(frame, label, figure.name)
        words = [percent.text, figure.unit, f"[{percent.interval}]" * bool(percent.interval)]
        words += [f"at {frame.columns[axis].in_words(rows.at[label, axis])}"] if axis else []
        ends.append(" ".join(word for word in words if word))
    return " and ".join(ends)


def ships_in_words(attributes: Mapping[str, Any]) -> str:
    """Return the number of ships that are learned, in words."""
    given = attributes.get("configuration", {})
    ships, unknown = given.get("grid", {}).get("ship"), given.get("classifier", {}).get("unknown")
    if ships is None:
        return "ships"
    count = len([ships] if isinstance(ships, str) else ships) - len(unknown or ())
    number = NUMBERS[count] if count < len(NUMBERS) else str(count)
    return f"{number} ship{'s' * (count != 1)}"

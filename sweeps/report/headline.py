"""What a sweep found, in words: how often which classifier is right, at which setting."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sweeps.report.frames import Frame, values_of
from sweeps.report.pivot import at_main, cell, constants, ordered
from sweeps.report.words import MAIN, missing, preferred

NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
NAMED = ("range", "pulse width", "vigilance", "frame count", "infrared frame count", "aspects")
FEW = 30  # answers below which a score is said to rest on few


def headline(frames: Mapping[str, Frame], attributes: Mapping[str, Any]) -> list[str]:
    """Return sentences on the main result of a store, each with its setting."""
    swept = list(attributes.get("swept", ()))
    if "scores" not in frames:
        return [_of_figure(next(iter(frames.values())), swept)]
    scores = frames["scores"]
    tested = scores.where(~scores.rows.kind.isin(["training", "learned"]))
    if tested.rows[tested.figures[0]].notna().sum() == 0:
        return ["No score: no test has an answer."]
    return _of_scores(tested, attributes, swept)


def main_axis(frame: Frame, swept: Sequence[str]) -> str:
    """Return the column of the axis that was swept, of numbers if there is one; else empty."""
    several = frame.several()
    names = [n for axis in swept for n in several if frame.columns[n].axis == axis]
    names = [name for name in names if name != frame.across and name not in frame.down]
    numeric = [name for name in names if frame.rows[name].dtype.kind in "fiu"]
    return next(iter([*numeric, *names]), "")


def _of_scores(tested: Frame, attributes: Mapping[str, Any], swept: Sequence[str]) -> list[str]:
    axis, figure = main_axis(tested, swept), tested.figures[0]
    overall = tested.at({tested.across: MAIN["aspect_bin"]}) if tested.across else tested
    channels = values_of(overall.rows, "channel")
    sentences = []
    for channel in [preferred("channel", channels)] if "both" in channels else channels:
        here = overall.at({"channel": channel})
        keep = [*overall.down, *[axis] * bool(axis)]
        at = at_main(here, keep)
        at = at.where(at.rows[figure].notna())
        if at.rows.empty:
            continue
        who = ["classifier", "scored"]
        mean = at.rows.groupby(who, dropna=False)[figure].mean()
        best = dict(zip(who, mean.idxmax(), strict=True))
        of = at.at(best)
        of = of.where(~of.rows.duplicated([axis] if axis else who))
        sentences.append(_sentence(of, axis, best["classifier"], channel, attributes))
    return sentences


def _sentence(
    of: Frame, axis: str, classifier: str, channel: str, attributes: Mapping[str, Any]
) -> str:
    figure = of.figures[0]
    name = of.columns["classifier"].text(classifier)
    by = {"range": "range profiles", "infrared": "silhouettes", "both": "both sensors"}
    rows = of.rows.sort_values(axis) if axis else of.rows
    ends = dict.fromkeys([rows.index[0], rows.index[-1]])
    said = []
    for label in ends:
        one = cell(of, label, figure)
        at = _at(of, axis, rows.at[label, axis]) if axis else ""
        said.append(f"{one.text} % [{one.interval}]{at}")
    given = constants(of)
    where = ", ".join(f"{key} {given[key]}" for key in NAMED if key in given)
    first = name[0].upper() + name[1:]
    sentence = (
        f"{first} on {by.get(channel, channel)} identifies {' and '.join(said)} of "
        f"{ships_in_words(attributes)}{' (' + where + ')' if where else ''}"
    )
    chance = [value for c in of.of_role("chance", figure) for value in of.rows[c].dropna().unique()]
    sentence += f"; chance {chance[0]:.0f} %." if chance else "."
    least = of.rows["n"].min() if "n" in of.rows else FEW
    if least < FEW:
        sentence += f" Few answers (n = {least:.0f}) make the interval wide."
    return sentence


def ships_in_words(attributes: Mapping[str, Any]) -> str:
    """Return the number of ships that are learned, in words."""
    given = attributes.get("configuration", {})
    ships, unknown = given.get("grid", {}).get("ship"), given.get("classifier", {}).get("unknown")
    if ships is None:
        return "ships"
    count = len([ships] if isinstance(ships, str) else ships) - len(unknown or ())
    number = NUMBERS[count] if count < len(NUMBERS) else str(count)
    return f"{number} ship{'s' * (count != 1)}"


def _with_unit(frame: Frame, name: str, value: Any) -> str:
    column = frame.columns[name]
    return f"{column.text(value)} {column.unit}".strip()


def _at(frame: Frame, axis: str, value: Any) -> str:
    return f" at {frame.columns[axis].words} {_with_unit(frame, axis, value)}"


def _of_figure(frame: Frame, swept: Sequence[str]) -> str:
    """Return a sentence on the main figure of any table, between the ends of the swept axis."""
    axis, figure = main_axis(frame, swept), frame.figures[0]
    at = at_main(frame, [axis] if axis else [])
    rows = at.rows[[not missing(value) for value in at.rows[figure]]]
    if rows.empty:
        return f"{frame.title}: no result."
    if axis:
        rows = rows.sort_values(axis)
    said = []
    for label in dict.fromkeys([rows.index[0], rows.index[-1]] if axis else [rows.index[0]]):
        one, unit = cell(frame, label, figure), frame.columns[figure].unit
        interval = f" [{one.interval}]" if one.interval else ""
        at_axis = _at(frame, axis, rows.at[label, axis]) if axis else ""
        said.append(f"{one.text} {unit}".strip() + interval + at_axis)
    down = [name for name in ordered(at.where(rows.index)) if name != axis]
    place = [f"{frame.columns[n].words} {_with_unit(frame, n, rows[n].iloc[0])}" for n in down]
    where = f" ({', '.join(place)})" if place else ""
    return f"{frame.columns[figure].words.capitalize()}: {' and '.join(said)}{where}."

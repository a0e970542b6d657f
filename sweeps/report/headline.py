"""The main table at the end of a sweep: each classifier at one setting, or another result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console

from sweeps.report import flights, scans, tables
from sweeps.report.axes import NOTHING, Axis, printable, shown, told
from sweeps.report.layout import sheet, show
from sweeps.report.parts import Part
from sweeps.report.rows import BIN, Row, axes_in, grouped, preferred
from sweeps.report.screen import note, print_scores

MOST_LINES = 20  # of a table that has no shorter form
TITLES = tables.TITLES | {"likelihood": "max. likelihood"}
CHANNELS = {"infrared": "similarity", "both": "max. likelihood"}
OF_PROFILES = ("pulse_width", "gain_sigma")  # without effect on silhouettes
NAMED = (
    *("range", "pulse_width", "vigilance", "frame_count", "infrared_frame_count"),
    *("super_resolution", "gain_sigma", "aspects"),
)
"""Axes whose values are named below the table."""

SCORE = ("percent_correct", "ci_low", "ci_high")

Section = list[tuple[str, list[Row]]]  # name and rows of each classifier of a sensor


def headline(parts: Sequence[Part], console: Console) -> None:
    """Print the main table of a store, in at most some 25 lines."""
    by_name = {part.name: part for part in parts}
    if sections := _sections(by_name):
        _print_sections(sections, console)
    elif "flights" in by_name:
        _print_flown(by_name["flights"].rows, console)
        _print_measured(by_name["measured"].rows if "measured" in by_name else [], console)
    elif "scan" in by_name:
        scans.print_found(by_name["scan"].rows, console)
    else:
        shortest = min((part for part in parts if part.listed), key=lambda part: len(part.rows))
        with console.capture() as captured:
            shortest.write(console)
        lines = captured.get().rstrip("\n").splitlines()
        more = [] if len(lines) <= MOST_LINES else [f"(--table {shortest.name} prints all rows)"]
        console.file.write("\n".join([*lines[:MOST_LINES], *more, ""]))


# classifiers --------------------------------------------------------------------------------------


def at_one_setting(rows: list[Row]) -> list[Row]:
    """Return rows of one value on every axis except aspect bins, the preferred one."""
    return at_common_setting([rows])[0]


def at_common_setting(lines: Sequence[list[Row]]) -> list[list[Row]]:
    """Return rows of each line at one value of every axis except aspect bins.

    It is the preferred one of the values that all lines with that axis have, or where there is
    none, of each line's own.
    """
    lines = list(lines)
    for axis in axes_in(row for line in lines for row in line):
        if axis == BIN:
            continue
        found = [_values(line, axis) for line in lines]
        known = [values for values in found if values]
        common = [one for one in known[0] if all(one in own for own in known)] if known else []
        for place, own in enumerate(found):
            if own:
                value = preferred(axis.name, common or own)
                lines[place] = [row for row in lines[place] if row.get(axis) in (None, value)]
    return lines


def _values(rows: list[Row], axis: Axis) -> list[Any]:
    """Return the values of an axis in some rows, in the order of appearance."""
    return list(dict.fromkeys(row[axis] for row in rows if row.get(axis) is not None))


def _sections(parts: Mapping[str, Part]) -> dict[str, Section]:
    """Return the classifiers of each sensor, all at one setting where they have it."""
    found: dict[str, list[tuple[str, list[Row]]]] = {}
    profiles = parts.get("classifiers") or parts.get("accuracy")
    for name, part in (
        ("range profiles", profiles),
        ("silhouettes", parts.get("infrared_accuracy")),
    ):
        tested = [row for row in (part.rows if part else ()) if row["frame_count"] is not None]
        for (classifier,), rows in grouped(tested, ("classifier",)).items():
            title = TITLES.get(classifier or "acn", printable(str(classifier)))
            found.setdefault(name, []).append((title, rows))
    fused = parts["fusion"].rows if "fusion" in parts else []
    for channel, title in CHANNELS.items():
        rows = [row for row in fused if row["channel"] == channel]
        name = "silhouettes" if channel == "infrared" else "both sensors"
        if rows:
            found.setdefault(name, []).append((title, rows))
    return {
        name: list(
            zip(
                [title for title, _ in lines],
                at_common_setting([rows for _, rows in lines]),
                strict=True,
            )
        )
        for name, lines in found.items()
    }


def _print_sections(sections: Mapping[str, Section], console: Console) -> None:
    lines: list[tuple[str, list[Row]]] = []
    words = []
    for name, classifiers in sections.items():
        lines.append((name, []))
        place = _place(classifiers)
        for title, rows in classifiers:
            other = {axis: rows[0][axis] for axis in place if rows[0].get(axis) is not None}
            differing = [axis for axis in other if other[axis] != place[axis]]
            lines.append((", ".join([title, *told(other, differing)]), rows))
        words.append(f"{name}: {', '.join(told(place, _named(name, place)))}")
    title = "Ships identified correctly [%], with 95 % intervals, by aspect"
    print_scores(title, "classifier", lines, console)
    beside = any(row.get("source_percent") is not None for _, rows in lines for row in rows)
    rule = "Settings are the article's, or the nearest that were swept."
    source = " source: the article, for the same ships, aspects and settings." * beside
    note(f"{'; '.join(words)}. {rule}{source}", console)


def _place(classifiers: Section) -> dict[Axis, Any]:
    """Return the setting of a section: on every axis the value of the first row that has one."""
    place: dict[Axis, Any] = {}
    for _, rows in classifiers:
        for axis in axes_in(rows):
            if axis != BIN and rows[0][axis] is not None:
                place.setdefault(axis, rows[0][axis])
    return place


def _named(sensor: str, place: Mapping[Axis, Any]) -> list[Axis]:
    """Return the axes of a section's setting that are named below it."""
    given = {axis.name: place[axis] for axis in place}
    left = set(OF_PROFILES) if sensor == "silhouettes" else set()
    if given.get("infrared_frame_count") == given.get("frame_count"):
        left.add("infrared_frame_count")
    return [
        axis
        for axis in place
        if axis.name in NAMED and axis.name not in left and place[axis] != "none"
    ]


# flights ------------------------------------------------------------------------------------------


def _print_flown(rows: list[Row], console: Console) -> None:
    """Print how well flights past each ship are corrected, everything else at its nominal value."""
    rows = [row for row in rows if row["figure"] in flights.FIGURES and row["value"] is not None]
    headings = [heading for heading, _ in flights.FIGURES.values()]
    title = "Corrected flights against the noiseless truth, all inputs nominal"
    table = sheet(title, *headings, left=("ship",))
    for (ship,), of_ship in grouped(rows, ("ship",)).items():
        texts = []
        for name, (_, digits) in flights.FIGURES.items():
            found = at_one_setting([row for row in of_ship if row["figure"] == name])
            texts.append(f"{found[0]['value']:.{digits}f}" if found else NOTHING)
        table.add_row(shown(ship), *texts)
    show(table, console)


def _print_measured(rows: list[Row], console: Console) -> None:
    """Print how often classifiers identify the ship flown past."""
    lines = []
    measured = [row for row in rows if row["kind"] == "measured"]
    for (classifier,), found in grouped(measured, ("classifier",)).items():
        chosen = at_one_setting(found)
        of_ship = [row | {end: row[f"ship_{end}"] for end in SCORE} for row in chosen]
        lines.append((TITLES.get(classifier, printable(str(classifier))), of_ship))
    if lines:
        title = (
            "Profiles of simulated flights identified correctly [%], with 95 % intervals, by aspect"
        )
        print_scores(title, "classifier", lines, console)

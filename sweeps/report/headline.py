"""The main table at the end of a sweep: each classifier at one setting, or another result."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from sweeps.engine.kinds import Draws
from sweeps.engine.settings import Setting
from sweeps.report import flights, scans, tables
from sweeps.report.axes import NOMINAL, NOTHING, Axis, printable, shown, told
from sweeps.report.layout import sheet, show
from sweeps.report.parts import Part
from sweeps.report.rows import BIN, Row, axes_in, grouped, nearest, opened, several, source_figures
from sweeps.report.screen import note, print_scores
from sweeps.stages.classifier import Classifier
from sweeps.stages.infrared import Infrared
from sweeps.stages.ladar import Ladar
from sweeps.stages.likelihood import Likelihood
from sweeps.stages.views import Grid, Scene

MOST_LINES = 20  # of a table that has no shorter form
TITLES = tables.TITLES | {"likelihood": "max. likelihood"}
CHANNELS = {"infrared": "similarity", "both": "max. likelihood"}
GROUPS = {"range profiles": (Scene, Ladar), "silhouettes": (Scene, Infrared)}
"""Settings that must be the article's for its figures to be shown beside those of a sensor."""

SCORE = ("percent_correct", "ci_low", "ci_high")

Section = list[tuple[str, list[Row]]]  # name and rows of each classifier of a sensor


def headline(path: Path, parts: Sequence[Part], console: Console) -> None:
    """Print the main table of a store, in at most some 25 lines."""
    by_name = {part.name: part for part in parts}
    if sections := _sections(by_name):
        _print_sections(sections, opened(path).attrs.get("configuration", {}), console)
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


def wanted(sensor: str) -> dict[str, Any]:
    """Return the values at which classifiers of a sensor are compared: the article's."""
    figures = source_figures()
    table, silhouettes = figures["table4_percent_correct"], figures["table5_percent_correct"]
    chosen = {
        "pulse_width": table["pulse_width"],
        "frame_count": silhouettes["frame_count"],
        "range": figures["experiment"]["range"],
        "vigilance": table["vigilance"],
        "infrared_frame_count": silhouettes["frame_count"],
        "super_resolution": "none",
        "aspects": NOMINAL["aspects"],  # if some are tested that were absent from training
        "gain_sigma": Likelihood.gain_sigma.default,
    }
    if sensor == "silhouettes":
        # The farther of its ranges without super-resolution: it trains at the other one.
        farthest = max(silhouettes["none"])
        chosen |= {"range": farthest, "vigilance": silhouettes["vigilance"]}
        del chosen["pulse_width"]  # it has no effect
    return chosen


def at_one_setting(rows: list[Row], wished: Mapping[str, Any]) -> list[Row]:
    """Return rows of one value on every axis except aspect bins.

    The value is the wished one (of numbers, the nearest), else the nominal one, else the first.
    """
    while axes := several(rows, but=(BIN,)):
        axis = axes[0]
        there = list(dict.fromkeys(row[axis] for row in rows if row[axis] is not None))
        wish = wished.get(axis.name, NOMINAL.get(axis.name))
        if wish in there:
            value = wish
        elif isinstance(wish, int | float) and not isinstance(wish, bool):
            value = nearest(wish, there)
        else:
            value = there[0]
        rows = [row for row in rows if row[axis] in (None, value)]
    return rows


def _sections(parts: Mapping[str, Part]) -> dict[str, Section]:
    """Return the classifiers of each sensor, each at one setting."""
    found: dict[str, list[tuple[str, list[Row]]]] = {}
    profiles = parts.get("classifiers") or parts.get("accuracy")
    for name, part in (
        ("range profiles", profiles),
        ("silhouettes", parts.get("infrared_accuracy")),
    ):
        tested = [row for row in (part.rows if part else ()) if row["frame_count"] is not None]
        for (classifier,), rows in grouped(tested, ("classifier",)).items():
            title = TITLES.get(classifier or "acn", printable(str(classifier)))
            found.setdefault(name, []).append((title, at_one_setting(rows, wanted(name))))
    fused = parts["fusion"].rows if "fusion" in parts else []
    for channel, title in CHANNELS.items():
        rows = [row for row in fused if row["channel"] == channel]
        name = "silhouettes" if channel == "infrared" else "both sensors"
        if rows:
            found.setdefault(name, []).append((title, at_one_setting(rows, wanted(name))))
    return {name: lines for name, lines in found.items() if lines}


def _print_sections(
    sections: Mapping[str, Section], configuration: Mapping[str, Any], console: Console
) -> None:
    lines: list[tuple[str, list[Row]]] = []
    words = []
    beside = False
    for name, classifiers in sections.items():
        lines.append((name, []))
        for title, rows in classifiers:
            fair = is_fair(rows, configuration, GROUPS.get(name, ()))
            lines.append((title, [row if fair else row | {"source_percent": None} for row in rows]))
            beside |= fair and any(row.get("source_percent") is not None for row in rows)
        words.append(f"{name}: {_setting(classifiers, wanted(name))}")
    title = "Ships identified correctly [%], with 95 % intervals, by aspect"
    print_scores(title, "classifier", lines, console)
    rule = "Settings are the article's, or the nearest that were swept."
    source = " source: the article, for the same ships, aspects and settings." * beside
    note(f"{'; '.join(words)}. {rule}{source}", console)


def _setting(classifiers: Section, wished: Mapping[str, Any]) -> str:
    """Return the setting of some classifiers in words."""
    place: dict[Axis, Any] = {}
    for _, rows in classifiers:
        for axis in axes_in(rows):
            if axis.name in wished and rows[0][axis] is not None:
                place.setdefault(axis, rows[0][axis])
    named = [axis for axis in place if place[axis] != "none"]
    if {"frame_count", "infrared_frame_count"} <= {axis.name for axis in named}:
        named = [axis for axis in named if axis.name != "infrared_frame_count"]
    return ", ".join(told(place, named))


def is_fair(rows: list[Row], configuration: Mapping[str, Any], groups: Iterable[Any]) -> bool:
    """Return whether rows are of the article's ships, aspects and protocol.

    These are the defaults of ships and aspects, of some groups of settings and of classifiers.
    """
    axes = {axis.name: axis for axis in axes_in(rows)}

    def same(setting: Setting) -> bool:
        group, _, name = setting.key.rpartition(".")
        default = set(setting.values(setting.default))
        if setting.name in axes and rows[0][axes[setting.name]] is not None:
            return rows[0][axes[setting.name]] in default
        return (
            set(setting.values(configuration.get(group, {}).get(name, setting.default))) == default
        )

    checked = [Grid.ship, Grid.aspect]
    for group in (*groups, Classifier):
        checked += [
            one
            for one in group.declared
            if one.fallback is None
            and one is not Classifier.name
            and not isinstance(one.kind, Draws)
        ]
    return bool(rows) and bool(groups) and all(map(same, checked))


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
            found = at_one_setting([row for row in of_ship if row["figure"] == name], {})
            texts.append(f"{found[0]['value']:.{digits}f}" if found else NOTHING)
        table.add_row(shown(ship), *texts)
    show(table, console)


def _print_measured(rows: list[Row], console: Console) -> None:
    """Print how often classifiers identify the ship flown past."""
    lines = []
    measured = [row for row in rows if row["kind"] == "measured"]
    for (classifier,), found in grouped(measured, ("classifier",)).items():
        chosen = at_one_setting(found, wanted("range profiles"))
        of_ship = [row | {end: row[f"ship_{end}"] for end in SCORE} for row in chosen]
        lines.append((TITLES.get(classifier, printable(str(classifier))), of_ship))
    if lines:
        title = "Measured profiles identified correctly [%], with 95 % intervals, by aspect"
        print_scores(title, "classifier", lines, console)

"""Pictures of percentages, one panel an aspect bin: classifiers, both channels, silhouettes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sweeps.report.axes import nominal, told, which
from sweeps.report.rows import (
    BIN,
    RULES,
    Row,
    has_source_views,
    nearest,
    of_one,
    several,
    source_figures,
)
from sweeps.report.silhouettes import positions, silhouette_accuracy_rows
from sweeps.report.tables import BOUND, accuracy_rows

# The source's main setting, and that of its Table 5.
PULSE_WIDTH, VIGILANCE = 30.0, 0.95
OF_SILHOUETTES = {"vigilance": [0.87], "frame_count": [16]}

OURS, THEIRS = "#1f4e79", "#c1440e"
THIN = {"mfc": "white", "ms": 4, "lw": 1.2, "elinewidth": 0.7}
BELOW: dict[str, Any] = {"loc": "outside lower center", "frameon": False}

# Which rows make a line of a picture, the worst first: colour, style, and values of columns.
LINES: dict[str, tuple[str, str, Row]] = {
    "MNN, ship and aspect group": (THEIRS, "s-", {"classifier": "mnn"}),
    "ACN": (OURS, "o-", {"classifier": "acn", "vigilance": VIGILANCE}),
    "correlation": ("#2a9d5c", "^-", {"classifier": "correlation", "training": "expected"}),
    "maximum likelihood, gain unknown": ("0.5", "D--", {"classifier": BOUND, "gain_sigma": 1}),
    "maximum likelihood, gain known": ("black", "D-", {"classifier": BOUND, "gain_sigma": 0}),
}
CHANNELS: dict[str, tuple[str, str, Row]] = {
    "silhouette": (THEIRS, "s-", {"channel": "infrared"}),
    "range profile": (OURS, "o-", {"channel": "range"}),
    "both": ("black", "D-", {"channel": "both"}),
}
CELL = ("range_km", "pulse_width_ns", "target_free_ifovs")

# Of resolutions of silhouettes.
WAYS = {
    "none": "detector's pixels",
    "perfect": "2×, perfect",
    "shifted": "2×, shifted, from 4 × the frames",
}
COLOURS = {"none": OURS, "perfect": "#2a9d6f", "shifted": "#b8860b"}

# Of profiles of flights: what they are called, and their colour.
KINDS = {
    "learned": ("synthetic, learned", "0.7"),
    "test": ("synthetic, noisy", "0.4"),
    "measured": ("measured", OURS),
}


def by_bin(rows: Iterable[Row], *, high: float = 3.9) -> tuple[Figure, list[Axes], list[str]]:
    """Return a figure so many inches high, its empty panels, and the bins that they are of."""
    bins = list(dict.fromkeys(row[BIN] for row in rows))
    figure = Figure(figsize=(2.65 * len(bins) + 0.6, high), dpi=150, layout="constrained")
    panels: list[Axes] = list(figure.subplots(1, len(bins), sharey=True, squeeze=False)[0])
    for axes, label in zip(panels, bins, strict=True):
        title = label if label == "overall" else f"aspect {label.replace('-', '–')}°"
        axes.set_title(title, fontsize=10)
        plain_percent(axes)
    panels[0].set_ylabel("percent correct")
    return figure, panels, bins


def plain_percent(axes: Axes) -> None:
    """Draw lines of a percentage across, and no frame but left and below."""
    axes.set(ylim=(0.0, 104.0))
    axes.grid(axis="y", color="0.92")
    axes.spines[["right", "top"]].set_visible(False)


def with_intervals(axes: Axes, line: Mapping[Any, Row], style: str, **how: Any) -> None:
    """Draw percent correct against anything, with 95 % intervals, of what there is."""
    known = {x: row for x, row in sorted(line.items()) if row["percent_correct"] is not None}
    if known:
        middle = [row["percent_correct"] for row in known.values()]
        low, high = ([row[name] for row in known.values()] for name in ("ci_low", "ci_high"))
        ends = np.abs(np.subtract([low, high], middle))
        axes.errorbar(list(known), middle, ends, fmt=style, **{"capsize": 2} | how)


def draw_tables(tables: xr.Dataset) -> Figure:
    """Draw percent correct against the number of frames, beside the source's."""
    kept = ("range", "pulse_width", "vigilance", "frame_count", "aspect_bin")
    here = nominal(tables, keep=kept)
    wanted = {"pulse_width": [PULSE_WIDTH], "vigilance": [VIGILANCE], "range": [100.0]}
    here = here.sel(wanted, method="nearest")
    rows = accuracy_rows(here)
    figure, panels, bins = by_bin(rows, high=3.4)
    for axes, label in zip(panels, bins, strict=True):
        # Numbers of frames ascending, training last.
        line = [row for row in rows if row[BIN] == label and row["percent_correct"] is not None]
        line.sort(key=lambda row: row["frame_count"] or np.inf)
        with_intervals(axes, dict(enumerate(line)), "o-", color=OURS, label="ours, 95 %")
        theirs = [(k, row["source_percent"]) for k, row in enumerate(line) if row["source_percent"]]
        if theirs:
            shown = zip(*theirs, strict=True)
            axes.plot(*shown, "s--", color=THEIRS, mfc="white", label="source")
        counts = [str(row["frame_count"] or "expected") for row in line]
        axes.set_xticks(range(len(line)), counts, fontsize=8)
    panels[0].legend(frameon=False, loc="lower right", fontsize=8)
    below = ["frames averaged; expected: the training profiles"]
    if any(row["source_percent"] is not None for row in rows):
        below.append(source_figures()["table4_percent_correct"]["note"])
    figure.supxlabel("\n".join(below), fontsize=8)
    pulse_width, vigilance = here.pulse_width.item(), here.vigilance.item()
    title = f"Ships identified by the ACN, {pulse_width:g} ns, vigilance {vigilance:g}"
    figure.suptitle(title + which(here.squeeze(), tables, but=kept), fontsize=11)
    return figure


def draw_classifiers(rows: list[Row]) -> Figure:
    """Draw percent correct of every classifier against the number of frames.

    Of several settings the nominal one is drawn, or the first.
    """
    rows, words = _of_one(rows, (*CELL, "vigilance", "training", "gain_sigma", "left_out"))
    width, floor = _usual(rows)
    cell = (rows[0]["range_km"], width, floor)
    shown = [row for row in rows if row["frame_count"] and cell == tuple(row[k] for k in CELL)]
    aspects = [row for row in shown if not row.get("left_out")]
    title = f"The same profiles named by each classifier, {cell[0]:g} km, {width:g} ns"
    title += f", {floor} target-free IFOVs a frame{words}"
    return _lines(shown, aspects, LINES, "frame_count", "frames averaged", title)


def draw_fusion(rows: list[Row]) -> Figure:
    """Draw percent correct of each channel and of both against range, of the most frames."""
    frames = max(row["frame_count"] for row in rows)
    width, floor = _usual(rows)
    setting = {"pulse_width_ns": width, "target_free_ifovs": floor, "frame_count": frames}
    setting["gain_sigma"] = max(row["gain_sigma"] for row in rows)
    images = {row["infrared_frame_count"] for row in rows}
    setting["infrared_frame_count"] = nearest(frames, images)
    setting["super_resolution"] = rows[0]["super_resolution"]
    shown, words = _of_one([row for row in rows if _is(row, setting)], (*CELL, "channel"))
    title = f"Profile, silhouette and both together, {frames} frames each, {width:g} ns"
    title += f", gain {'unknown' if setting['gain_sigma'] else 'known'}{words}"
    return _lines(shown, shown, CHANNELS, "range_km", "slant range [km]", title)


def _usual(rows: list[Row]) -> tuple[float, int]:
    """The pulse width nearest to the source's, and the most target-free IFOVs."""
    width = nearest(PULSE_WIDTH, {row["pulse_width_ns"] for row in rows})
    return width, max(row["target_free_ifovs"] for row in rows)


def _is(row: Row, chosen: Row) -> bool:
    return all(row.get(key) == value for key, value in chosen.items())


def _of_one(rows: list[Row], placed: Sequence[str]) -> tuple[list[Row], str]:
    """Rows of one setting of all that has no place in the picture, and its words for the title."""
    others = several(rows, but=(*placed, "frame_count", BIN))
    rows = of_one(rows, others)
    kept = {axis: row[axis] for row in rows for axis in others if row[axis] is not None}
    words = told(kept, [axis for axis in kept if axis not in RULES])
    return rows, "".join(f", {word}" for word in words)


def _lines(
    rows: list[Row],
    drawn: list[Row],
    lines: Mapping[str, tuple[str, str, Row]],
    across: str,
    label: str,
    title: str,
) -> Figure:
    """Percent correct against the values of a column that all rows have, of some a line each."""
    figure, panels, bins = by_bin(rows)
    ticks = sorted({row[across] for row in rows})
    for axes, of_bin in zip(panels, bins, strict=True):
        here = [row for row in reversed(drawn) if row[BIN] == of_bin]
        for name, (colour, style, chosen) in lines.items():
            line = {row[across]: row for row in here if _is(row, chosen)}
            with_intervals(axes, line, style, color=colour, label=name, **THIN)
        axes.set_xscale("log", base=2)
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.set_xlabel(label)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, ncols=min(len(labels), 3), fontsize=8, **BELOW)
    figure.suptitle(title, fontsize=11)
    return figure


def draw_table5(tables: xr.Dataset, *, ships: int) -> Figure:
    """Draw percent correct of silhouettes against range, and a guess among so many ships."""
    kept = ("vigilance", "range", "super_resolution", "frame_count", "aspect_bin", "phase", "order")
    here = nominal(tables, keep=kept).sel(OF_SILHOUETTES, method="nearest")
    rows = silhouette_accuracy_rows(here)
    beside = has_source_views(here) and any(row["source_percent"] is not None for row in rows)
    ranges = sorted(here.range.values.tolist())
    figure, every, bins = by_bin(rows, high=4.5)
    keys: dict[str, Any] = {}
    for axes, label in zip(every, bins, strict=True):
        _accuracy(axes, [row for row in rows if row[BIN] == label], ranges, beside=beside)
        axes.axhline(100 / ships, color="0.6", lw=0.9, ls=":", label=f"guess among {ships}")
        axes.set_xlabel("slant range [km]")
        for handle, name in zip(*axes.get_legend_handles_labels(), strict=True):
            keys.setdefault(name, handle)
    draws = here.sizes["phase"] * here.sizes["order"]
    keys["95 % interval"] = Line2D([], [], color="0.4", lw=1.4, marker="|", ms=7)
    keys[f"± spread of {draws} trainings"] = Line2D([], [], color="0.4", lw=6, alpha=0.3)
    if beside:
        keys["source, same resolution"] = Line2D([], [], ls="", marker="D", mfc="w", mec="0.3")
    said = source_figures()["table5_percent_correct"]["note"] if beside else None
    how: dict[str, Any] = {"title": said, "title_fontsize": 8, "fontsize": 8.5, "ncols": 4} | BELOW
    figure.legend(keys.values(), keys.keys(), **how)
    vigilance, frames = here.vigilance.item(), here.frame_count.item()
    taken = f"{frames} frames"
    if "shifted" in here.super_resolution.values:
        taken += f" ({positions('shifted')} × {frames} where shifted)"
    title = f"Silhouettes identified by the ACN, {taken}, vigilance {vigilance:g}"
    figure.suptitle(title, fontsize=12)
    return figure


def _accuracy(axes: Axes, rows: list[Row], ranges: list[float], *, beside: bool) -> None:
    """One aspect bin: ours by range and resolution, the training's, and the source's."""
    rows = [row for row in rows if row["percent_correct"] is not None]
    tested = [row for row in rows if row["silhouettes"] != "training"]
    for row in rows:
        if row["silhouettes"] == "training":
            level = row["percent_correct"]
            axes.axhline(level, color="0.35", lw=0.9, ls="--", label="training silhouettes")
    ways = list(dict.fromkeys(row["super_resolution"] for row in tested))
    for place, way in enumerate(ways):
        known = [row for row in tested if row["super_resolution"] == way]
        known.sort(key=lambda row: row["range_km"])
        x = np.array([ranges.index(row["range_km"]) for row in known], dtype=float)
        x += 0.24 * (place - (len(ways) - 1) / 2)
        colour = COLOURS.get(way, "0.3")
        mean, spread = ([row[key] for row in known] for key in ("percent_correct", "spread"))
        axes.errorbar(x, mean, spread, fmt="none", ecolor=colour, elinewidth=6, alpha=0.3)
        style = {"color": colour, "label": WAYS.get(way, way), "ms": 4.5}
        with_intervals(axes, dict(zip(x, known, strict=True)), "o-", **style)
        theirs = [(at - 0.1, row["source_percent"]) for at, row in zip(x, known, strict=True)]
        theirs = [(at, percent) for at, percent in theirs if beside and percent is not None]
        if theirs:
            shown = zip(*theirs, strict=True)
            axes.plot(*shown, "D", mfc="white", mec=colour, mew=1.6, zorder=4)
    axes.set_xticks(range(len(ranges)), [f"{value:g}" for value in ranges])
    axes.set(xlim=(-0.5, len(ranges) - 0.5))


def draw_measured(tables: xr.Dataset) -> Figure:
    """Draw percent named right by aspect bin: measured profiles beside synthetic ones.

    One panel a classifier and pulse width, the ship alone; of several flights the nominal one.
    """
    one = nominal(tables, keep=("pulse_width", "classifier", "kind", "aspect_bin"))
    rows, columns = one.sizes["pulse_width"], one.sizes["classifier"]
    figure = Figure(figsize=(3.0 * columns + 0.6, 2.5 * rows + 0.4), dpi=140, layout="constrained")
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    labels = one.aspect_bin.values.tolist()
    for row, column in np.ndindex(rows, columns):
        axes: Any = panels[row, column]
        here = one.isel(pulse_width=row, classifier=column)
        for place, (kind, (name, colour)) in enumerate(KINDS.items()):
            part = 100 * here.sel(kind=kind)
            middle = part.ship_accuracy.values
            ends = [middle - part.ship_ci_low.values, part.ship_ci_high.values - middle]
            x = np.arange(len(labels)) + 0.2 * (place - 1)
            axes.errorbar(x, middle, ends, fmt="o", color=colour, capsize=3, label=name)
        axes.set_xticks(np.arange(len(labels)), labels, fontsize=8)
        plain_percent(axes)
        axes.set_title(f"{here.classifier.item()}, {here.pulse_width.item():g} ns", fontsize=9)
    for axes in panels[:, 0]:
        axes.set_ylabel("ships right [%]", fontsize=8)
    for axes in panels[-1]:
        axes.set_xlabel("aspect [deg]", fontsize=8)
    panels[0, 0].legend(frameon=False, fontsize=7, loc="lower left")
    if words := which(one, tables):
        figure.suptitle(words.removeprefix(", "), fontsize=10)
    return figure

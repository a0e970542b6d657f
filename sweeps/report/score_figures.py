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
    nearest,
    of_one,
    several,
    source_figures,
)
from sweeps.report.silhouettes import positions, silhouette_accuracy_rows
from sweeps.report.style import (
    BELOW,
    BLACK,
    BLUE,
    GOLD,
    GREEN,
    HEADING,
    LABEL,
    OFFSET_NOTE,
    ORCHID,
    OURS,
    RUST,
    SMALL,
    THEIRS,
    aspect_title,
    key_below,
    nested,
    offset,
    plain_percent,
    titled,
)
from sweeps.report.tables import BOUND, TITLES, accuracy_rows

# The source's main setting, and that of its Table 5.
PULSE_WIDTH, VIGILANCE = 30.0, 0.95
OF_SILHOUETTES = {"vigilance": [0.87], "frame_count": [16]}

# Lines of a picture, the lowest first: colour, style, and the values of columns that select rows.
LINES: dict[str, tuple[str, str, Row]] = {
    TITLES["mnn"]: (RUST, "s-", {"classifier": "mnn"}),
    TITLES["acn"]: (BLUE, "o-", {"classifier": "acn", "vigilance": VIGILANCE}),
    TITLES["correlation"]: (GREEN, "^-", {"classifier": "correlation", "training": "expected"}),
    f"{TITLES[BOUND]}, gain unknown": (ORCHID, "v--", {"classifier": BOUND, "gain_sigma": 1}),
    f"{TITLES[BOUND]}, gain known": (BLACK, "D-", {"classifier": BOUND, "gain_sigma": 0}),
}
CHANNELS: dict[str, tuple[str, str, Row]] = {
    "silhouette": (RUST, "s-", {"channel": "infrared"}),
    "range profile": (GOLD, "o-", {"channel": "range"}),
    "both": (BLACK, "D--", {"channel": "both"}),
}
CELL = ("range_km", "pulse_width_ns", "target_free_ifovs")

# Resolutions of silhouettes.
WAYS = {
    "none": "detector's pixels",
    "perfect": "2×, perfect",
    "shifted": "2×, from 4 × the frames, shifted",
}
COLOURS = {"none": BLUE, "perfect": GREEN, "shifted": GOLD}
MARKERS = {"none": "o", "perfect": "s", "shifted": "^"}
BAND = 0.22  # distance of neighbouring marks of one range, which has a band of width 1

# Profiles of flights: name, colour and marker.
KINDS = {
    "learned": ("synthetic, as learned", GOLD, "s"),
    "test": ("synthetic, noisy", GREEN, "^"),
    "measured": ("simulated flight", BLUE, "o"),
}


def by_bin(rows: Iterable[Row], *, high: float = 3.9) -> tuple[Figure, list[Axes], list[str]]:
    """Return a figure, its empty panels, and the aspect bin of each; height in inches."""
    bins = list(dict.fromkeys(row[BIN] for row in rows))
    figure = Figure(figsize=(2.35 * len(bins) + 0.6, high), dpi=160, layout="constrained")
    panels: list[Axes] = list(figure.subplots(1, len(bins), sharey=True, squeeze=False)[0])
    for axes, label in zip(panels, bins, strict=True):
        axes.set_title(aspect_title(label), fontsize=HEADING)
        axes.tick_params(labelsize=LABEL)
        plain_percent(axes)
    panels[0].set_ylabel("percent correct", fontsize=LABEL)
    return figure, panels, bins


def with_intervals(axes: Axes, line: Mapping[Any, Row], style: str, **how: Any) -> None:
    """Draw percent correct with 95 % intervals, by position; skip rows without a value."""
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
    figure, panels, bins = by_bin(rows, high=3.9)
    for axes, label in zip(panels, bins, strict=True):
        # Numbers of frames ascending, training last.
        line = [row for row in rows if row[BIN] == label and row["percent_correct"] is not None]
        line.sort(key=lambda row: row["frame_count"] or np.inf)
        with_intervals(
            axes, dict(enumerate(line)), "o-", color=OURS, label="this package, 95 % interval"
        )
        theirs = [(k, row["source_percent"]) for k, row in enumerate(line) if row["source_percent"]]
        if theirs:
            shown = zip(*theirs, strict=True)
            axes.plot(*shown, "s--", color=THEIRS, mfc="white", ms=5, label="source")
        counts = [str(row["frame_count"] or "∞") for row in line]
        axes.set_xticks(range(len(line)), counts)
        axes.set_xlabel("frames averaged", fontsize=LABEL)
        axes.set_xlim(-0.4, len(line) - 0.6)
    below = ["∞: expected profiles, which are the training set"]
    if any(row["source_percent"] is not None for row in rows):
        below.append(source_figures()["table4_percent_correct"]["note"])
    key_below(figure, panels[0], title="\n".join(below))
    others = which(here.squeeze(), tables, but=kept).removeprefix(", ")
    where = f"{here.range.item():g} km", f"{here.pulse_width.item():g} ns"
    titled(
        figure,
        "Ships identified by the ACN",
        *where,
        f"vigilance {here.vigilance.item():g}",
        others,
    )
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
    where = f"{cell[0]:g} km", f"{width:g} ns", f"{floor} target-free IFOVs a frame", *words
    figure = _lines(shown, aspects, LINES, "frame_count", "frames averaged")
    titled(figure, "Classifiers compared on the same range profiles", *where)
    return figure


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
    gain = f"gain {'unknown' if setting['gain_sigma'] else 'known'}"
    figure = _lines(shown, shown, CHANNELS, "range_km", "slant range [km]")
    where = f"{frames} frames of each sensor", f"{width:g} ns", gain, *words
    titled(figure, "Range profile, infrared silhouette, and both together", *where)
    return figure


def _usual(rows: list[Row]) -> tuple[float, int]:
    """Return the pulse width nearest to the source's, and the most target-free IFOVs."""
    width = nearest(PULSE_WIDTH, {row["pulse_width_ns"] for row in rows})
    return width, max(row["target_free_ifovs"] for row in rows)


def _is(row: Row, chosen: Row) -> bool:
    return all(row.get(key) == value for key, value in chosen.items())


def _of_one(rows: list[Row], placed: Sequence[str]) -> tuple[list[Row], list[str]]:
    """Return rows of one setting of every axis that is not drawn, and those settings in words."""
    others = several(rows, but=(*placed, "frame_count", BIN))
    rows = of_one(rows, others)
    kept = {axis: row[axis] for row in rows for axis in others if row[axis] is not None}
    return rows, told(kept, [axis for axis in kept if axis not in RULES])


def _lines(
    rows: list[Row],
    drawn: list[Row],
    lines: Mapping[str, tuple[str, str, Row]],
    across: str,
    label: str,
) -> Figure:
    """Draw percent correct against a column: a line for each selection of rows."""
    figure, panels, bins = by_bin(rows, high=4.1)
    ticks = sorted({row[across] for row in rows})
    there = [one for one in lines.items() if any(_is(row, one[1][2]) for row in drawn)]
    for axes, of_bin in zip(panels, bins, strict=True):
        here = [row for row in reversed(drawn) if row[BIN] == of_bin]
        for place, (name, (colour, style, chosen)) in enumerate(there):
            line = {row[across]: row for row in here if _is(row, chosen)}
            line = dict(zip(offset(line, place, len(there)), line.values(), strict=True))
            widths = nested(place, len(there))
            with_intervals(axes, line, style, color=colour, label=name, mfc="white", **widths)
        axes.set_xscale("log", base=2)
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.set_xlabel(label, fontsize=LABEL)
    key_below(figure, panels[0], title=f"95 % intervals. {OFFSET_NOTE}")
    return figure


def draw_table5(tables: xr.Dataset, *, ships: int) -> Figure:
    """Draw percent correct of silhouettes against range, and a guess among so many ships."""
    kept = ("vigilance", "range", "super_resolution", "frame_count", "aspect_bin", "phase", "order")
    here = nominal(tables, keep=kept).sel(OF_SILHOUETTES, method="nearest")
    rows = silhouette_accuracy_rows(here)
    beside = any(row["source_percent"] is not None for row in rows)
    ranges = sorted(here.range.values.tolist())
    figure, every, bins = by_bin(rows, high=4.5)
    keys: dict[str, Any] = {}
    for axes, label in zip(every, bins, strict=True):
        _accuracy(axes, [row for row in rows if row[BIN] == label], ranges, beside=beside)
        axes.axhline(100 / ships, color="0.6", lw=0.9, ls=":", label=f"chance, 1 in {ships}")
        axes.set_xlabel("slant range [km]", fontsize=LABEL)
        for handle, name in zip(*axes.get_legend_handles_labels(), strict=True):
            keys.setdefault(name, handle)
    draws = here.sizes["phase"] * here.sizes["order"]
    keys["95 % interval"] = Line2D([], [], color="0.4", lw=0.8, marker="|", ms=7)
    keys[f"± standard deviation of {draws} trainings"] = Line2D(
        [], [], color="0.4", lw=6, alpha=0.3
    )
    if beside:
        keys["source, same resolution"] = Line2D([], [], ls="", marker="D", mfc="w", mec="0.3")
    said = source_figures()["table5_percent_correct"]["note"] if beside else None
    how: dict[str, Any] = {"title": said, "title_fontsize": SMALL, "fontsize": SMALL, "ncols": 3}
    figure.legend(keys.values(), keys.keys(), **how, **BELOW)
    vigilance, frames = here.vigilance.item(), here.frame_count.item()
    taken = f"{frames} frames"
    if "shifted" in here.super_resolution.values:
        taken += f" ({positions('shifted')} × {frames} where shifted)"
    titled(figure, "Silhouettes identified by the ACN", taken, f"vigilance {vigilance:g}")
    return figure


def _accuracy(axes: Axes, rows: list[Row], ranges: list[float], *, beside: bool) -> None:
    """Draw one aspect bin: a band for each range, in it a mark for each resolution and source."""
    rows = [row for row in rows if row["percent_correct"] is not None]
    tested = [row for row in rows if row["silhouettes"] != "training"]
    for row in rows:
        if row["silhouettes"] == "training":
            level = row["percent_correct"]
            axes.axhline(level, color="0.35", lw=0.9, ls="--", label="training silhouettes")
    for band in range(1, len(ranges), 2):
        axes.axvspan(band - 0.5, band + 0.5, color="0.95", lw=0, zorder=0)
    ways = list(dict.fromkeys(row["super_resolution"] for row in tested))
    for place, way in enumerate(ways):
        known = [row for row in tested if row["super_resolution"] == way]
        known.sort(key=lambda row: row["range_km"])
        x = np.array([ranges.index(row["range_km"]) for row in known], dtype=float)
        x += BAND * (place - (len(ways) - 1) / 2)
        colour = COLOURS.get(way, "0.3")
        mean, spread = ([row[key] for row in known] for key in ("percent_correct", "spread"))
        axes.errorbar(x, mean, spread, fmt="none", ecolor=colour, elinewidth=6, alpha=0.3)
        style = {"color": colour, "label": WAYS.get(way, way), "ms": 4.5, "elinewidth": 0.8}
        with_intervals(axes, dict(zip(x, known, strict=True)), MARKERS.get(way, "o"), **style)
        theirs = [(at - 0.09, row["source_percent"]) for at, row in zip(x, known, strict=True)]
        theirs = [(at, percent) for at, percent in theirs if beside and percent is not None]
        if theirs:
            shown = zip(*theirs, strict=True)
            axes.plot(*shown, "D", mfc="white", mec=colour, mew=1.4, ms=5, zorder=4)
    axes.set_xticks(range(len(ranges)), [f"{value:g}" for value in ranges])
    axes.tick_params(axis="x", length=0)
    axes.set(xlim=(-0.5, len(ranges) - 0.5))


def draw_measured(tables: xr.Dataset) -> Figure:
    """Draw percent correct by aspect bin: measured profiles beside synthetic ones.

    One panel for each classifier and pulse width, scored by ship; of several flights the nominal
    one.
    """
    one = nominal(tables, keep=("pulse_width", "classifier", "kind", "aspect_bin"))
    rows, columns = one.sizes["pulse_width"], one.sizes["classifier"]
    size = (2.9 * columns + 0.6, 2.2 * rows + 1.2)
    figure = Figure(figsize=size, dpi=150, layout="constrained")
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    labels = one.aspect_bin.values.tolist()
    for row, column in np.ndindex(rows, columns):
        axes: Any = panels[row, column]
        here = one.isel(pulse_width=row, classifier=column)
        for place, (kind, (name, colour, marker)) in enumerate(KINDS.items()):
            part = 100 * here.sel(kind=kind)
            middle = part.ship_accuracy.values
            ends = [middle - part.ship_ci_low.values, part.ship_ci_high.values - middle]
            x = np.arange(len(labels)) + 0.2 * (place - 1)
            style: dict[str, Any] = {"capsize": 2, "ms": 5, "elinewidth": 1.0, "label": name}
            axes.errorbar(x, middle, ends, fmt=marker, color=colour, **style)
        axes.set_xticks(np.arange(len(labels)), [label.replace("-", "–") for label in labels])
        axes.tick_params(labelsize=SMALL)
        plain_percent(axes)
        classifier = str(here.classifier.item())
        scored = TITLES.get(f"{classifier}_ship", TITLES.get(classifier, classifier))
        axes.set_title(f"{scored}, {here.pulse_width.item():g} ns", fontsize=HEADING)
    for axes in panels[:, 0]:
        axes.set_ylabel("percent correct", fontsize=LABEL)
    for axes in panels[-1]:
        axes.set_xlabel("aspect [°]", fontsize=LABEL)
    key_below(figure, panels[0, 0], title="95 % intervals")
    others = which(one, tables).removeprefix(", ")
    titled(figure, "Ships identified by measured and by synthetic range profiles", others)
    return figure

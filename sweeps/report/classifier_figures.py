"""Pictures of the classifiers side by side, and of what both sensors know together."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sweeps.report import stored
from sweeps.report.axes import told
from sweeps.report.classifiers import BOUND, TITLES, classifier_rows
from sweeps.report.fusion import fusion_rows
from sweeps.report.panels import by_bin, with_intervals
from sweeps.report.rows import BIN, RULES, Row, nearest, of_one, several

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

KINDS = {
    "classifiers": "percent correct of every classifier by aspect and number of frames",
    "fusion": "percent correct of profile, silhouette and both by aspect and range",
}
PULSE_WIDTH, VIGILANCE = 30.0, 0.95  # the source's main setting
THIN = {"mfc": "white", "ms": 4, "lw": 1.2, "elinewidth": 0.7}

# Which rows make a line of a picture, the worst first: colour, style, and values of columns.
LINES: dict[str, tuple[str, str, Row]] = {
    "MNN, ship and aspect group": ("#c1440e", "s-", {"classifier": "mnn"}),
    "ACN": ("#1f4e79", "o-", {"classifier": "acn", "vigilance": VIGILANCE}),
    "correlation": ("#2a9d5c", "^-", {"classifier": "correlation", "training": "expected"}),
    "maximum likelihood, gain unknown": ("0.5", "D--", {"classifier": BOUND, "gain_sigma": 1}),
    "maximum likelihood, gain known": ("black", "D-", {"classifier": BOUND, "gain_sigma": 0}),
}
CELL = ("range_km", "pulse_width_ns", "target_free_ifovs")
CHANNELS = {
    "silhouette": ("#c1440e", "s-", "infrared"),
    "range profile": ("#1f4e79", "o-", "range"),
    "both": ("black", "D-", "both"),
}


def draw(kind: str, path: Path) -> Figure:
    """A picture of a store's tables, of one of `KINDS`."""
    if kind == "fusion":
        return draw_fusion(fusion_rows(stored.read(path, "tables/fusion").load()))
    names = [name for name in stored.groups(path, "tables") if name in TITLES]
    there = {name: stored.read(path, f"tables/{name}").load() for name in names}
    return draw_classifiers(classifier_rows(there))


def draw_classifiers(rows: list[Row]) -> Figure:
    """Percent correct against the number of frames, one panel an aspect bin, one line each.

    Of several settings the nominal one is drawn, or the first.
    """
    rows, words = _of_one(rows, (*CELL, "vigilance", "training", "gain_sigma", "left_out"))
    width = nearest(PULSE_WIDTH, {row["pulse_width_ns"] for row in rows})
    floor = max(row["target_free_ifovs"] for row in rows)
    slant_range = rows[0]["range_km"]
    shown = [
        row
        for row in rows
        if row["frame_count"] and tuple(row[key] for key in CELL) == (slant_range, width, floor)
    ]
    figure, panels, bins = by_bin(shown)
    for axes, label in zip(panels, bins, strict=True):
        here = [row for row in shown if row["aspect_bin_deg"] == label]
        for name, (colour, style, chosen) in LINES.items():
            line = {row["frame_count"]: row for row in reversed(here) if _is(row, chosen)}
            with_intervals(axes, line, style, color=colour, label=name, **THIN)
        axes.set_xscale("log", base=2)
        counts = sorted({row["frame_count"] for row in shown})
        axes.set_xticks(counts, [str(count) for count in counts])
        axes.set_xlabel("frames averaged")
    title = f"The same profiles named by each classifier, {slant_range:g} km, {width:g} ns"
    return _finished(figure, panels, f"{title}, {floor} target-free IFOVs a frame{words}")


def _is(row: Row, chosen: Row) -> bool:
    """Whether a row has those values, and the true aspect among what is learned."""
    return not row.get("left_out") and all(row.get(key) == chosen[key] for key in chosen)


def draw_fusion(rows: list[Row]) -> Figure:
    """Percent correct against range, one panel an aspect bin, one line each sensor and both.

    The detector's own pixels, the largest number of frames, and the gain that is known least.
    """
    width = nearest(PULSE_WIDTH, {row["pulse_width_ns"] for row in rows})
    floor = max(row["target_free_ifovs"] for row in rows)
    frames = max(row["frame_count"] for row in rows)
    images = nearest(frames, {row["infrared_frame_count"] for row in rows})
    way = rows[0]["super_resolution"]
    gain = max(row["gain_sigma"] for row in rows)
    setting = (width, floor, gain, frames, images, way)
    keys = [*CELL[1:], "gain_sigma", "frame_count", "infrared_frame_count", "super_resolution"]
    shown = [row for row in rows if tuple(row[key] for key in keys) == setting]
    shown, words = _of_one(shown, (*CELL, "channel"))
    figure, panels, bins = by_bin(shown)
    for axes, label in zip(panels, bins, strict=True):
        here = [row for row in shown if row["aspect_bin_deg"] == label]
        for name, (colour, style, channel) in CHANNELS.items():
            line = {row["range_km"]: row for row in here if row["channel"] == channel}
            with_intervals(axes, line, style, color=colour, label=name, **THIN)
        axes.set_xscale("log", base=2)
        ranges = sorted({row["range_km"] for row in shown})
        axes.set_xticks(ranges, [f"{slant_range:g}" for slant_range in ranges])
        axes.set_xlabel("slant range [km]")
    title = f"Profile, silhouette and both together, {frames} frames each, {width:g} ns"
    title += ", gain " + ("unknown" if gain else "known")
    return _finished(figure, panels, title + words)


def _of_one(rows: list[Row], placed: Sequence[str]) -> tuple[list[Row], str]:
    """Rows of one setting of all that has no place in the picture, and its words for the title."""
    others = several(rows, but=(*placed, "frame_count", BIN))
    rows = of_one(rows, others)
    kept = {axis: row[axis] for row in rows for axis in others if row[axis] is not None}
    words = told(kept, [axis for axis in kept if axis not in RULES])
    return rows, "".join(f", {word}" for word in words)


def _finished(figure: Figure, panels: list[Axes], title: str) -> Figure:
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=min(len(labels), 3),
        frameon=False,
        fontsize=8,
    )
    figure.suptitle(title, fontsize=11)
    return figure

"""Pictures of the classifiers side by side, and of what both sensors know together."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sweeps import store
from sweeps.classifier_schema import CLASSIFIERS, FUSION
from sweeps.report.classifiers import CELL, classifier_rows
from sweeps.report.fusion import fusion_rows
from sweeps.report.tables import Row, first_rules
from sweeps.variables import TABLES_OF

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

KINDS = {
    "classifiers": "percent correct of every classifier by aspect and number of frames",
    "fusion": "percent correct of profile, silhouette and both by aspect and range",
}
PULSE_WIDTH, VIGILANCE = 30.0, 0.95  # the source's main setting
DPI = 150

# Which rows make a line of a picture, the worst first.
Chosen = Callable[[Row], bool]
LINES: dict[str, tuple[str, str, Chosen]] = {
    "MNN, ship and aspect group": ("#c1440e", "s-", lambda row: row["classifier"] == "mnn"),
    "ACN": (
        "#1f4e79",
        "o-",
        lambda row: row["classifier"] == "acn" and row["vigilance"] == VIGILANCE,
    ),
    "correlation": (
        "#2a9d5c",
        "^-",
        lambda row: (
            row["classifier"] == "correlation"
            and not row["left_out"]
            and row["training"] == "expected"
        ),
    ),
    "maximum likelihood, gain unknown": (
        "0.5",
        "D--",
        lambda row: (
            row["classifier"] == "likelihood" and not row["left_out"] and row["gain_sigma"] == 1
        ),
    ),
    "maximum likelihood, gain known": (
        "black",
        "D-",
        lambda row: (
            row["classifier"] == "likelihood" and not row["left_out"] and row["gain_sigma"] == 0
        ),
    ),
}
CHANNELS = {
    "silhouette": ("#c1440e", "s-", "infrared"),
    "range profile": ("#1f4e79", "o-", "range"),
    "both": ("black", "D-", "both"),
}


def draw(kind: str, path: Path) -> Figure:
    """A picture of a store's tables.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    path : Path
        The store.

    Returns
    -------
    matplotlib.figure.Figure
    """
    if kind == "fusion":
        return draw_fusion(fusion_rows(store.read_group(path, TABLES_OF[FUSION]).load()))
    there = {
        name: store.read_group(path, TABLES_OF[name]).load()
        for name in CLASSIFIERS
        if name != FUSION and store.has_group(path, TABLES_OF[name])
    }
    return draw_classifiers(classifier_rows(there))


def draw_classifiers(rows: list[Row]) -> Figure:
    """Percent correct against the number of frames, one panel an aspect bin, one line each.

    Parameters
    ----------
    rows : list of dict
        From `sweeps.report.classifiers.classifier_rows`. Of several settings the source's is
        drawn, or the first.

    Returns
    -------
    matplotlib.figure.Figure
    """
    rows = first_rules(rows)
    width = _nearest(PULSE_WIDTH, {row["pulse_width_ns"] for row in rows})
    floor = max(row["target_free_ifovs"] for row in rows)
    slant_range = rows[0]["range_km"]
    shown = [
        row
        for row in rows
        if row["frame_count"] and tuple(row[key] for key in CELL) == (slant_range, width, floor)
    ]
    figure, panels, bins = _panels(shown)
    for axes, label in zip(panels, bins, strict=True):
        here = [row for row in shown if row["aspect_bin_deg"] == label]
        for name, (colour, style, chosen) in LINES.items():
            line = {row["frame_count"]: row for row in reversed(here) if chosen(row)}
            _line(axes, line, colour, style, name)
        axes.set_xscale("log", base=2)
        counts = sorted({row["frame_count"] for row in shown})
        axes.set_xticks(counts, [str(count) for count in counts])
        axes.set_xlabel("frames averaged")
    title = f"The same profiles named by each classifier, {slant_range:g} km, {width:g} ns"
    return _finished(figure, panels, f"{title}, {floor} target-free IFOVs a frame")


def draw_fusion(rows: list[Row]) -> Figure:
    """Percent correct against range, one panel an aspect bin, one line each sensor and both.

    Parameters
    ----------
    rows : list of dict
        From `sweeps.report.fusion.fusion_rows`. The detector's own pixels are drawn, the
        largest number of frames, and the gain that is known least.

    Returns
    -------
    matplotlib.figure.Figure
    """
    width = _nearest(PULSE_WIDTH, {row["pulse_width_ns"] for row in rows})
    floor = max(row["target_free_ifovs"] for row in rows)
    frames = max(row["frame_count"] for row in rows)
    images = _nearest(frames, {row["infrared_frame_count"] for row in rows})
    way = rows[0]["super_resolution"]
    gain = max(row["gain_sigma"] for row in rows)
    setting = (width, floor, gain, frames, images, way)
    keys = [*CELL[1:], "gain_sigma", "frame_count", "infrared_frame_count", "super_resolution"]
    shown = [row for row in rows if tuple(row[key] for key in keys) == setting]
    figure, panels, bins = _panels(shown)
    for axes, label in zip(panels, bins, strict=True):
        here = [row for row in shown if row["aspect_bin_deg"] == label]
        for name, (colour, style, channel) in CHANNELS.items():
            line = {row["range_km"]: row for row in here if row["channel"] == channel}
            _line(axes, line, colour, style, name)
        axes.set_xscale("log", base=2)
        ranges = sorted({row["range_km"] for row in shown})
        axes.set_xticks(ranges, [f"{slant_range:g}" for slant_range in ranges])
        axes.set_xlabel("slant range [km]")
    title = f"Profile, silhouette and both together, {frames} frames each, {width:g} ns"
    title += ", gain " + ("unknown" if gain else "known")
    return _finished(figure, panels, title)


def _panels(rows: list[Row]) -> tuple[Figure, list[Axes], list[str]]:
    from matplotlib.figure import Figure

    bins = list(dict.fromkeys(row["aspect_bin_deg"] for row in rows))
    figure = Figure(figsize=(2.6 * len(bins) + 0.6, 3.9), dpi=DPI, layout="constrained")
    panels: list[Axes] = list(figure.subplots(1, len(bins), sharey=True, squeeze=False)[0])
    for axes, label in zip(panels, bins, strict=True):
        title = label if label == "overall" else f"aspect {label.replace('-', '–')}°"
        axes.set_title(title, fontsize=10)
        axes.set(ylim=(0.0, 104.0))
        axes.grid(axis="y", color="0.9")
        axes.spines[["right", "top"]].set_visible(False)
    panels[0].set_ylabel("percent correct")
    return figure, panels, bins


def _line(axes: Axes, line: dict[Any, Row], colour: str, style: str, name: str) -> None:
    """One line with 95 % intervals, of what there is."""
    known = {x: row for x, row in sorted(line.items()) if row["percent_correct"] is not None}
    if not known:
        return
    middle = [row["percent_correct"] for row in known.values()]
    bars = [
        [row["percent_correct"] - row["ci_low"] for row in known.values()],
        [row["ci_high"] - row["percent_correct"] for row in known.values()],
    ]
    axes.errorbar(
        list(known),
        middle,
        bars,
        fmt=style,
        color=colour,
        mfc="white",
        ms=4,
        lw=1.2,
        capsize=2,
        elinewidth=0.7,
        label=name,
    )


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


def _nearest(wanted: float, there: set[Any]) -> Any:
    return min(there, key=lambda value: (abs(value - wanted), value))

"""Pictures of how silhouettes are named: the categories they form, and percent correct.

They are drawn by `sweeps.report.silhouette_figures`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from sweeps.report.axes import nominal
from sweeps.report.panels import by_bin, with_intervals
from sweeps.report.rows import BIN, Row
from sweeps.report.silhouettes import positions, silhouette_accuracy_rows
from sweeps.report.source import has_source_views, source_figures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# The source's Figure 20 and Table 5.
VIGILANCE, FRAMES = 0.87, 16

WAYS = {
    "none": "detector's pixels",
    "perfect": "2×, perfect",
    "shifted": "2×, shifted, from 4 × the frames",
}
COLOURS = {"none": "#1f4e79", "perfect": "#2a9d6f", "shifted": "#b8860b"}

# Of ships, as in the source's Figure 20: a category is a tint of its ship's.
SHIP_COLOURS = ("#1f5fa8", "#c0392b", "#2a8c4a", "#d9a300", "#0e8a8a", "#7a5230")
SHARED_COLOUR = "#54278f"

DPI = 140

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Run:
    """Neighbouring aspects of one ship that share a category.

    The ship is its place on the axis; start and stop are half-way to the neighbours [deg]; category
    -1 is no answer; confused says whether views of another ship share it.
    """

    ship: int
    start: float
    stop: float
    category: int
    confused: bool


def runs_of(training: xr.Dataset) -> list[Run]:
    """Runs of aspects of one category, ship by ship, aspects ascending."""
    ordered = training.transpose("ship", "aspect")
    edges = _edges(ordered.aspect.values)
    runs = []
    for ship, (categories, confused) in enumerate(
        zip(ordered.training_category.values, ordered.training_confused.values, strict=True)
    ):
        begins = np.flatnonzero(np.diff(categories, prepend=categories[0] - 1))
        for begin, end in zip(begins, [*begins[1:], categories.size], strict=True):
            runs.append(
                Run(
                    ship=ship,
                    start=float(edges[begin]),
                    stop=float(edges[end]),
                    category=int(categories[begin]),
                    confused=bool(confused[begin] == 1),
                )
            )
    return runs


def _edges(aspect: np.ndarray) -> np.ndarray:
    """Half-way between aspects, and as far beyond the first and the last [deg]."""
    if aspect.size == 1:
        return np.array([aspect[0] - 1.0, aspect[0] + 1.0])
    between = (aspect[1:] + aspect[:-1]) / 2
    return np.array([2 * aspect[0] - between[0], *between, 2 * aspect[-1] - between[-1]])


def draw_formation(classified: xr.Dataset) -> Figure:
    """Which views share a category, from bow to beam, one strip a ship.

    The first phase and order at the vigilance nearest to the source's, in tints of the ship's
    colour, categories of several ships hatched; below, how often a view's category is shared.
    """
    from matplotlib.figure import Figure

    kept = ("ship", "aspect", "vigilance", "phase", "order")
    here = nominal(classified[["training_category", "training_confused"]], keep=kept)
    here = here.sel(vigilance=VIGILANCE, method="nearest").sortby("aspect")
    first = here.isel(phase=0, order=0)
    ships = [str(name) for name in first.ship.values]

    height = 0.6 * len(ships) + 0.35
    figure = Figure(figsize=(10.0, 1.5 * height + 1.9), dpi=DPI, layout="constrained")
    strips, share = figure.subplots(2, 1, sharex=True, height_ratios=[1.0, 0.5])
    _show_runs(strips, runs_of(first))
    _show_sharing(share, here)
    for axes in (strips, share):
        axes.set_yticks(range(len(ships)), [name.capitalize() for name in ships])
        for label, k in zip(axes.get_yticklabels(), range(len(ships)), strict=True):
            label.set_color(_ship_colour(k))
            label.set_weight("bold")
        axes.set_ylim(len(ships) - 0.5, -0.5)
        axes.tick_params(axis="y", length=0)
        axes.spines[["left", "right", "top", "bottom"]].set_visible(False)
    strips.tick_params(axis="x", length=0)
    counts = here.training_category.max(("ship", "aspect")).values + 1
    answered = int((first.training_category >= 0).sum())
    source = source_figures()
    title = f"{counts.flat[0]} categories of {answered} silhouettes"
    title += f", ACN at vigilance {first.vigilance.item():g}"
    notes = []
    counts = counts[counts > 0]  # a training that failed formed none
    if counts.size > 1:
        notes.append(f"the first of {counts.size} trainings, which form {_span(counts)}")
    theirs = source["table5_percent_correct"]
    if (answered, first.vigilance.item()) == (source["experiment"]["views"], theirs["vigilance"]):
        notes.append(f"the source forms {theirs['categories']}")
    figure.suptitle("\n".join([title, *(["; ".join(notes)] if notes else [])]), fontsize=11.5)
    return figure


def _span(counts: np.ndarray) -> str:
    low, high = counts.min(), counts.max()
    return f"{low}" if low == high else f"{low} to {high}"


def _ship_colour(ship: int) -> str:
    return SHIP_COLOURS[ship % len(SHIP_COLOURS)]


def _tint(colour: str, share: float) -> Colour:
    """So much of a colour, and white for the rest."""
    from matplotlib.colors import to_rgb

    red, green, blue = (1 - share * (1 - part) for part in to_rgb(colour))
    return red, green, blue


def tints_of(runs: list[Run]) -> dict[tuple[int, int], Colour]:
    """Colours of categories by ship and category: a ship's own, and shared ones, whatever the ship.

    Red, green and blue; white where there was no answer.
    """
    families: dict[str, list[int]] = {}
    for run in runs:
        family = families.setdefault(_family(run), [])
        if run.category not in family:
            family.append(run.category)
    tints = {}
    for run in runs:
        family = families[_family(run)]
        # Neighbours are far apart: every other one is dark.
        rank = family.index(run.category)
        step = rank // 2 / max(1, (len(family) + 1) // 2)
        share = (0.38 if rank % 2 else 0.74) + 0.26 * step
        tints[run.ship, run.category] = _tint(_family(run), share if run.category >= 0 else 0.0)
    return tints


def _family(run: Run) -> str:
    return SHARED_COLOUR if run.confused else _ship_colour(run.ship)


def _show_runs(axes: Axes, runs: list[Run]) -> None:
    """Strips of runs, each with the number of its category."""
    from matplotlib.patches import Patch

    tints = tints_of(runs)
    for run in runs:
        colour = tints[run.ship, run.category]
        axes.barh(
            run.ship,
            run.stop - run.start,
            left=run.start,
            height=0.78,
            color=colour,
            edgecolor="white",
            linewidth=1.4,
            hatch="////" if run.confused else None,
        )
        if run.category < 0:
            continue
        label = {"fc": colour, "ec": "none", "boxstyle": "round,pad=0.15"}
        axes.text(
            (run.start + run.stop) / 2,
            run.ship,
            str(run.category + 1),
            ha="center",
            va="center",
            fontsize=10 if run.stop - run.start > 4 else 8,
            color="white" if sum(colour) < 1.75 else "black",
            bbox=label if run.confused else None,
        )
    axes.set_xlim(min(run.start for run in runs), max(run.stop for run in runs))
    shared = _tint(SHARED_COLOUR, 0.8)
    keys = [
        Patch(color="0.6", label="a ship's own category, a tint each"),
        Patch(fc=shared, ec="white", hatch="////", label="a category that ships share"),
    ]
    axes.legend(
        handles=keys,
        ncols=2,
        frameon=False,
        fontsize=9,
        loc="lower center",
        bbox_to_anchor=(0.5, 0.99),
        borderaxespad=0.0,
    )


def _show_sharing(axes: Axes, training: xr.Dataset) -> None:
    """Share of all trainings in which a view's category is another ship's, too."""
    from matplotlib.colors import LinearSegmentedColormap

    draws = training.sizes["phase"] * training.sizes["order"]
    known = training.training_confused.where(training.training_category >= 0)
    share = 100 * known.mean(("phase", "order")).transpose("ship", "aspect")
    mesh = axes.pcolormesh(
        _edges(share.aspect.values),
        np.arange(share.sizes["ship"] + 1) - 0.5,
        share.values,
        cmap=LinearSegmentedColormap.from_list("shared", ["#f1eef6", SHARED_COLOUR]),
        vmin=0,
        vmax=100,
        edgecolor="white",
        linewidth=0.8,
    )
    axes.set_xlabel("aspect [°], 0 bow-on, 90 port beam")
    axes.set_xticks(np.arange(0, float(share.aspect.max()) + 1, 15))
    what = "one training" if draws == 1 else f"{draws} trainings"
    axes.set_title(f"Share of {what} in which another ship has the view's category", fontsize=10)
    bar = axes.figure.colorbar(mesh, ax=axes, pad=0.01, aspect=12)
    bar.outline.set_visible(False)
    bar.set_label("shared [%]", fontsize=9)


def draw_table5(tables: xr.Dataset, *, ships: int) -> Figure:
    """Percent correct against range, one panel an aspect bin, one line a resolution.

    Means over phases and orders with their 95 % intervals (thin) and standard deviation (thick),
    the source's where it has one, and a guess among so many ships.
    """
    from matplotlib.lines import Line2D

    kept = ("vigilance", "range", "super_resolution", "frame_count", "aspect_bin", "phase", "order")
    here = nominal(tables, keep=kept)
    here = here.sel(vigilance=[VIGILANCE], method="nearest")
    here = here.sel(frame_count=[FRAMES], method="nearest")
    rows = silhouette_accuracy_rows(here)
    beside = has_source_views(here) and any(row["source_percent"] is not None for row in rows)
    ranges = sorted(here.range.values.tolist())
    figure, every, bins = by_bin(rows, high=4.5)
    for axes, label in zip(every, bins, strict=True):
        of_bin = [row for row in rows if row[BIN] == label]
        _accuracy(axes, of_bin, ranges, beside=beside)
        axes.axhline(100 / ships, color="0.6", lw=0.9, ls=":", label=f"guess among {ships}")
        axes.set_xlabel("slant range [km]")
    keys: dict[str, Any] = {}
    for axes in every:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            keys.setdefault(label, handle)
    draws = here.sizes["phase"] * here.sizes["order"]
    keys["95 % interval"] = Line2D([], [], color="0.4", lw=1.4, marker="|", ms=7)
    keys[f"± spread of {draws} trainings"] = Line2D([], [], color="0.4", lw=6, alpha=0.3)
    if beside:
        keys["source, same resolution"] = Line2D([], [], ls="", marker="D", mfc="w", mec="0.3")
    figure.legend(
        keys.values(),
        keys.keys(),
        title=source_figures()["table5_percent_correct"]["note"] if beside else None,
        title_fontsize=8,
        frameon=False,
        fontsize=8.5,
        ncols=4,
        loc="outside lower center",
    )
    vigilance, frames = here.vigilance.item(), here.frame_count.item()
    taken = f"{frames} frames"
    if "shifted" in here.super_resolution.values:
        taken += f" ({positions('shifted')} × {frames} where shifted)"
    figure.suptitle(
        f"Silhouettes identified by the ACN, {taken}, vigilance {vigilance:g}", fontsize=12
    )
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
        style = {"color": COLOURS.get(way, "0.3"), "label": WAYS.get(way, way)}
        mean, spread = ([row[key] for row in known] for key in ("percent_correct", "spread"))
        axes.errorbar(x, mean, spread, fmt="none", ecolor=style["color"], elinewidth=6, alpha=0.3)
        with_intervals(axes, dict(zip(x, known, strict=True)), "o-", ms=4.5, **style)
        theirs = [(at - 0.1, row["source_percent"]) for at, row in zip(x, known, strict=True)]
        theirs = [(at, percent) for at, percent in theirs if beside and percent is not None]
        if theirs:
            axes.plot(
                *zip(*theirs, strict=True), "D", mfc="white", mec=style["color"], mew=1.6, zorder=4
            )
    axes.set_xticks(range(len(ranges)), [f"{value:g}" for value in ranges])
    axes.set(xlim=(-0.5, len(ranges) - 0.5))

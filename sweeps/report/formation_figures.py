"""Pictures of categories: views of range profiles, or of silhouettes, that the ACN joins."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from sweeps.report.axes import nominal
from sweeps.report.rows import source_figures
from sweeps.report.style import HEADING, LABEL, SHIP_COLOURS, SMALL, TITLE

# A category is a tint of its ship's colour, as in the source's Figure 20, or of this one.
SHARED_COLOUR = "#54278f"

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Run:
    """Neighbouring aspects of one ship that share a category.

    `ship` is an index; start and stop are half-way to the neighbours [deg]; category
    -1 is no answer; `confused` is whether views of another ship share it.
    """

    ship: int
    start: float
    stop: float
    category: int
    confused: bool

    @property
    def family(self) -> str:
        """Base colour of its category's tint."""
        return SHARED_COLOUR if self.confused else _ship_colour(self.ship)


def runs_of(training: xr.Dataset) -> list[Run]:
    """Return runs of aspects of one category, ship by ship, aspects ascending."""
    ordered = training.transpose("ship", "aspect")
    edges = _edges(ordered.aspect.values).tolist()
    every = zip(ordered.training_category.values, ordered.training_confused.values, strict=True)
    runs = []
    for ship, (categories, confused) in enumerate(every):
        begins = np.flatnonzero(np.diff(categories, prepend=categories[0] - 1))
        for begin, end in zip(begins, [*begins[1:], categories.size], strict=True):
            category, shared = int(categories[begin]), bool(confused[begin] == 1)
            runs.append(Run(ship, edges[begin], edges[end], category, shared))
    return runs


def _edges(aspect: NDArray[Any]) -> NDArray[Any]:
    """Return edges half-way between aspects, and as far beyond the first and the last [deg]."""
    if aspect.size == 1:
        return np.array([aspect[0] - 1.0, aspect[0] + 1.0])
    between = (aspect[1:] + aspect[:-1]) / 2
    return np.array([2 * aspect[0] - between[0], *between, 2 * aspect[-1] - between[-1]])


@dataclass(frozen=True)
class Subject:
    """Vectors that form the categories of a picture.

    The settings nearest to the source's are drawn; draws are axes along which the same views are
    clustered again.
    """

    views: str
    settings: dict[str, float]
    draws: tuple[str, ...]


PROFILES = Subject("range profiles", {"vigilance": 0.95, "pulse_width": 30.0}, ("pulse_width",))
SILHOUETTES = Subject("silhouettes", {"vigilance": 0.87}, ("phase", "order"))


def draw_formation(classified: xr.Dataset, subject: Subject) -> Figure:
    """Draw views that share a category, from bow to beam, one strip per ship, and how often.

    Strips are of the training at the source's settings, or the first one; shares, if there are
    several, of all trainings.
    """
    here, first = _trainings(classified, subject)
    several = here.sizes["aspect"] * here.sizes["ship"] < here.training_category.size
    ships = [str(name) for name in first.ship.values]
    height = 0.6 * len(ships) + 0.35
    tall = height * (1.5 if several else 1.0) + 2.0
    figure = Figure(figsize=(10.0, tall), dpi=140, layout="constrained")
    panels = figure.subplots(
        2 if several else 1, 1, sharex=True, squeeze=False, height_ratios=[1.0, 0.5][: 1 + several]
    )[:, 0]
    _show_runs(panels[0], runs_of(first))
    if several:
        _show_sharing(panels[1], here, subject.draws)
    for axes in panels:
        axes.set_yticks(range(len(ships)), [name.capitalize() for name in ships])
        for k, label in enumerate(axes.get_yticklabels()):
            label.set(color=_legible(_ship_colour(k)), weight="bold")
        axes.set_ylim(len(ships) - 0.5, -0.5)
        axes.tick_params(axis="y", length=0)
        axes.spines[["left", "right", "top", "bottom"]].set_visible(False)
    if several:
        panels[0].tick_params(axis="x", length=0)
    panels[-1].set_xlabel("aspect [°], 0 bow-on, 90 port beam")
    panels[-1].set_xticks(np.arange(0, float(here.aspect.max()) + 1, 15))
    figure.suptitle(_title(here, first, subject), fontsize=TITLE)
    if subject is PROFILES:
        _show_statement(figure, panels[0], here, first)
    return figure


def _trainings(classified: xr.Dataset, subject: Subject) -> tuple[xr.Dataset, xr.Dataset]:
    """Return all trainings of a subject at the training aspects, and the one shown as strips."""
    kept = ("ship", "aspect", *subject.settings, *subject.draws)
    here = nominal(classified[["training_category", "training_confused"]], keep=kept)
    drawn = {name: here.sizes[name] for name in subject.draws}
    for name, value in subject.settings.items():
        if name not in drawn:
            here = here.sel({name: value}, method="nearest")
    learned = (here.training_category >= 0).any([dim for dim in here.dims if dim != "aspect"])
    here = here.isel(aspect=learned.values).sortby("aspect")
    first = here.isel({name: 0 for name in drawn if name not in subject.settings})
    first = first.sel(
        {name: value for name, value in subject.settings.items() if name in drawn},
        method="nearest",
    )
    return here, first


def _title(here: xr.Dataset, first: xr.Dataset, subject: Subject) -> str:
    """Return a title: numbers of categories here, in other trainings and in the source."""
    counts = here.training_category.max(("ship", "aspect")).values + 1
    answered = int((first.training_category >= 0).sum())
    formed = int(first.training_category.max()) + 1
    title = f"{formed} categories of {answered} {subject.views}"
    title += f", ACN at vigilance {first.vigilance.item():g}"
    if "pulse_width" in first.coords:
        title += f", {first.pulse_width.item():g} ns"
    notes = []
    counts = counts[counts > 0]  # a training that failed formed none
    if counts.size > 1 and "pulse_width" not in subject.draws:
        low, high = counts.min(), counts.max()
        every = f"{low}" if low == high else f"{low} to {high}"
        notes.append(f"the first of {counts.size} trainings, which form {every}")
    if (theirs := _source_count(first, answered)) is not None:
        notes.append(f"the source forms {theirs}")
    return "\n".join([title, *(["; ".join(notes)] if notes else [])])


def _source_count(first: xr.Dataset, answered: int) -> int | None:
    """Return the source's number of categories for as many views at the same settings, if known."""
    source = source_figures()
    vigilance = first.vigilance.item()
    if answered != source["experiment"]["views"]:
        return None
    count: int | None = None
    if "pulse_width" in first.coords:
        profiles = source["table3_categories"]
        if vigilance == profiles["vigilance"]:
            count = profiles["categories"].get(first.pulse_width.item())
    elif vigilance == source["table5_percent_correct"]["vigilance"]:
        count = source["table5_percent_correct"]["categories"]
    return count


def _show_statement(figure: Figure, axes: Axes, here: xr.Dataset, first: xr.Dataset) -> None:
    """Mark the aspect from which the source's ship is confused, and quote both results below."""
    theirs = source_figures()["figure19_formation"]
    if theirs["ship"] not in first.ship.values:
        return
    ship, begins = theirs["ship"], theirs["confused_from"]
    axes.axvline(begins, 0, 0.97, color="0.15", lw=1.2, ls=(0, (4, 2)))
    place: Any = {"xytext": (0, -2), "textcoords": "offset points", "ha": "center", "va": "top"}
    what = f"source: confused from about {begins}°"
    axes.annotate(
        what, (begins, -0.02), xycoords=("data", "axes fraction"), fontsize=SMALL, **place
    )
    own, name = first.sel(ship=ship), str(ship).capitalize()
    bow = own.training_category.where(own.aspect <= begins, drop=True)
    others = [
        f"{width:g} ns: {_first_confused(here.sel(ship=ship, pulse_width=width))}"
        for width in np.atleast_1d(here.pulse_width.values).tolist()
        if width != first.pulse_width.item()
    ]
    any_confused = confused_aspects(own).size > 0
    confused = f"the first confused one {_first_confused(own)}" if any_confused else "none confused"
    said = f"{name} in the source's Figure 19: {theirs['own']} categories from the bow to about "
    said += f"{begins}°, and confused ones from there.\n{name} here: {np.unique(bow.values).size} "
    said += f"categories from the bow to {begins}°, {confused}"
    said += f" ({'; '.join(others)})" if others else ""
    figure.supxlabel(said, fontsize=LABEL)


def confused_aspects(training: xr.Dataset) -> NDArray[np.float64]:
    """Return the aspects [deg] of one ship at which another ship shares its category, ascending."""
    ordered = training.sortby("aspect")
    found: NDArray[np.float64] = ordered.aspect.values[ordered.training_confused.values == 1]
    return found


def _first_confused(training: xr.Dataset) -> str:
    found = confused_aspects(training)
    return f"from {found[0]:g}°" if found.size else "none"


def _ship_colour(ship: int) -> str:
    return SHIP_COLOURS[ship % len(SHIP_COLOURS)]


def _legible(colour: str) -> Colour:
    """Return a colour dark enough for text on white."""
    red, green, blue = (0.75 * part for part in to_rgb(colour))
    return red, green, blue


def _tint(colour: str, share: float) -> Colour:
    """Return a colour mixed with white."""
    red, green, blue = (1 - share * (1 - part) for part in to_rgb(colour))
    return red, green, blue


def tints_of(runs: list[Run]) -> dict[tuple[int, int], Colour]:
    """Return colours of categories by ship and category; white without an answer."""
    families: dict[str, list[int]] = {}
    for run in runs:
        family = families.setdefault(run.family, [])
        if run.category not in family:
            family.append(run.category)
    tints = {}
    for run in runs:
        family = families[run.family]
        # Neighbours differ strongly: every other one is dark.
        rank = family.index(run.category)
        step = rank // 2 / max(1, (len(family) + 1) // 2)
        share = (0.38 if rank % 2 else 0.74) + 0.26 * step
        tints[run.ship, run.category] = _tint(run.family, share if run.category >= 0 else 0.0)
    return tints


def _show_runs(axes: Axes, runs: list[Run]) -> None:
    """Draw strips of runs, each with the number of its category."""
    tints = tints_of(runs)
    for run in runs:
        colour, width = tints[run.ship, run.category], run.stop - run.start
        style: Any = {"color": colour, "edgecolor": "white", "linewidth": 1.4}
        hatch = "////" if run.confused else None
        axes.barh(run.ship, width, left=run.start, height=0.78, hatch=hatch, **style)
        if run.category >= 0:
            axes.text(
                (run.start + run.stop) / 2,
                run.ship,
                str(run.category + 1),
                ha="center",
                va="center",
                fontsize=10 if width > 4 else 8,
                color="white" if sum(colour) < 1.75 else "black",
                bbox={"fc": colour, "ec": "none", "boxstyle": "round,pad=0.15"} if hatch else None,
            )
    axes.set_xlim(min(run.start for run in runs), max(run.stop for run in runs))
    shared = _tint(SHARED_COLOUR, 0.8)
    keys = [
        Patch(color="0.6", label="category of one ship, a tint each"),
        Patch(fc=shared, ec="white", hatch="////", label="confused: category shared by ships"),
    ]
    place: Any = {"loc": "lower center", "bbox_to_anchor": (0.5, 0.99), "borderaxespad": 0.0}
    axes.legend(handles=keys, ncols=2, frameon=False, fontsize=LABEL, **place)


def _show_sharing(axes: Axes, training: xr.Dataset, draws: tuple[str, ...]) -> None:
    """Draw the share of trainings in which another ship shares a view's category."""
    known = training.training_confused.where(training.training_category >= 0)
    share = 100 * known.mean(draws).transpose("ship", "aspect")
    colours = LinearSegmentedColormap.from_list("shared", ["#f1eef6", SHARED_COLOUR])
    edges = _edges(share.aspect.values), np.arange(share.sizes["ship"] + 1) - 0.5
    style: Any = {"vmin": 0, "vmax": 100, "edgecolor": "white", "linewidth": 0.8}
    mesh = axes.pcolormesh(*edges, share.values, cmap=colours, **style)
    what = f"{math.prod(training.sizes[name] for name in draws)} trainings"
    if "pulse_width" in draws:
        what += " (" + ", ".join(f"{width:g}" for width in training.pulse_width.values) + " ns)"
    axes.set_title(
        f"Share of {what} in which another ship has the view's category", fontsize=HEADING
    )
    bar = axes.figure.colorbar(mesh, ax=axes, pad=0.01, aspect=12)
    bar.outline.set_visible(False)
    bar.set_label("shared [%]", fontsize=LABEL)

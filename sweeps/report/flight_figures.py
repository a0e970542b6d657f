"""Pictures of flights: stages of the corrections, profiles, and what wrong parameters cost.

    python -m sweeps.report.figures flight STORE PICTURE
    python -m sweeps.report.figures validation STORE PICTURE
    python -m sweeps.report.figures sensitivity STORE PICTURE
    python -m sweeps.report.figures measured STORE PICTURE

They need matplotlib, from the `plot` extra.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sweeps.report import stored
from sweeps.report.axes import nominal, which
from sweeps.report.flight_again import Place, draw_flight, flights_of
from sweeps.report.flights import SISTERS, STERN, TITLED, flown_past, put_in
from sweeps.report.panels import plain_percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

KINDS = {
    "flight": "every stage of the corrections of a flight, beside the truth",
    "validation": "measured near-stern profiles beside noiseless and synthetic ones",
    "sensitivity": "what wrong flight parameters cost, with and without autofocus",
    "measured": "measured profiles named right by who learned synthetic ones",
}
OURS, THEIRS, TRUTH = "#1f4e79", "#c1440e", "0.75"
MARKED = (  # m past the hangar, height, what is there
    *((-26, 0.44, "transom"), (-14, 0.24, "flight deck"), (5, 0.9, "hangar")),
    *((45, 0.76, "main mast"), (61, 0.32, "bridge")),
)
UNITS = {
    "aircraft_speed": "%",
    "ship_speed": "m/s",
    "aircraft_heading": "deg",
    "ship_heading": "deg",
    "pointing": "deg",
}


def draw(kind: str, path: Path) -> Figure:
    """A picture of a store, of one of `KINDS`. Raises ValueError if it lacks what is drawn."""
    if kind == "measured":
        return draw_measured(stored.read(path, "tables/measured").load())
    flights = stored.read(path, "validation")
    if kind == "flight":
        return draw_flight(stored.attributes(path), flights, flights_of(flights)[0])
    return (draw_validation if kind == "validation" else draw_sensitivity)(flights)


def draw_validation(flights: xr.Dataset) -> Figure:
    """Near-stern profiles: measured over noiseless, and a ship over its synthetic sister.

    The source's Figures 14 to 16; the first draw of the noise, of each ship at the range that suits
    the source, unit the hangar's peak.
    """
    from matplotlib.figure import Figure

    near = flights.sel(aspect=STERN, method="nearest")
    near = near.isel(replicate=0, missing_dims="ignore")
    draws = flights.sizes.get("replicate", 1)
    ships = flown_past(flights)
    shown = [(name, km) for name, km in (("connole", 3.0), SISTERS[2:]) if name in ships]
    sisters = set(SISTERS[::2]) <= set(ships)
    if not shown:
        shown = [(ships[0], float(np.atleast_1d(near.range)[0]))]
    count = len(shown) + sisters
    figure = Figure(figsize=(11.0, 2.7 * count), dpi=140, layout="constrained")
    panels = figure.subplots(count, 1, squeeze=False)[:, 0]
    for axes, (name, km) in zip(panels, shown, strict=False):
        one = put_in(near.sel(ship=name).sel(range=km, method="nearest"))
        place, profile = one.down_range.values, one.profile
        _filled(axes, place, profile.sel(source="noiseless"), "noiseless")
        _line(axes, place, profile.sel(source="measured"), OURS, "flown past and corrected")
        likeness = float(one.profile_correlation)
        axes.set_title(
            f"{_titled(one)}{which(one, flights, but=TITLED)}, "
            + (f"first of {draws} draws, " if draws > 1 else "")
            + ("nothing seen" if math.isnan(likeness) else f"correlation {likeness:.3f}"),
            fontsize=9,
        )
    if sisters:
        _sisters(panels[-1], near, flights)
    for axes in panels:
        axes.set(ylabel="over the highest peak", ylim=(0, 1.08))
        axes.legend(frameon=False, fontsize=8, loc="upper right")
        axes.spines[["right", "top"]].set_visible(False)
    for axes in panels[: len(shown)]:
        axes.set(xlim=(-80, 80), xlabel="down-range from the ship's origin [m]")
    return figure


def _titled(one: xr.Dataset) -> str:
    """Ship, range and aspect."""
    return Place(str(one.ship.item()), float(one.aspect), float(one.range)).title


def _sisters(axes: Axes, near: xr.Dataset, flights: xr.Dataset) -> None:
    """The source's Figure 16, with what it put its differences down to put in."""
    drawn = put_in(near.sel(ship=SISTERS[0]).sel(range=SISTERS[1], method="nearest"))
    flown = near.sel(ship=SISTERS[2]).sel(range=SISTERS[3], method="nearest")
    glint = float(np.max(np.atleast_1d(flown.mast_gain.values)))
    dark = float(np.min(np.atleast_1d(flown.transom_gain.values)))
    lines = [
        (drawn, "point", TRUTH, "Duncan, synthetic, point sampled"),
        (put_in(flown), "measured", OURS, "Roberts, flown past"),
    ]
    if glint != 1 or dark != 1:
        changed = put_in(flown, transom_gain=dark, mast_gain=glint)
        label = f"the same, transom x {dark:g} and masts x {glint:g} put in"
        lines.append((changed, "measured", THEIRS, label))
    for one, source, colour, label in lines:
        profile = one.profile.sel(source=source).values
        place = one.down_range.values - one.down_range.values[profile.argmax()]
        if source == "point":
            _filled(axes, place, profile, label)
        else:
            _line(axes, place, profile, colour, label)
    for place, height, name in MARKED:
        axes.annotate(name, (place, height), fontsize=8, ha="center", color="0.3")
    others = which(put_in(flown), flights, but=(*TITLED, "transom_gain", "mast_gain"))
    ranges = " and ".join(dict.fromkeys(f"{float(one.range):g}" for one in (drawn, flown)))
    axes.set_title(f"Sister ships near the stern, {ranges} km{others}", fontsize=9)
    axes.set(xlim=(-40, 100), xlabel="down-range from the hangar [m]")


def draw_sensitivity(flights: xr.Dataset) -> Figure:
    """Correlation with the noiseless profile against the error of each flight parameter.

    Means over draws with their standard deviation; without error in every panel. Raises ValueError
    if there are no errors.
    """
    from matplotlib.figure import Figure

    if flights.sizes.get("error", 1) < 2:
        raise ValueError("irar.errors is empty, but must name parameters and their errors")
    first = flights.sel(ship=flown_past(flights)[0]).isel(aspect=0, range=0)
    one = nominal(first, keep=("error", "autofocus", "replicate"))
    one = one[["profile_correlation", "closing_speed_error"]].load()
    names = one.error_parameter.values.tolist()
    parameters = [name for name in dict.fromkeys(names) if name in UNITS]
    figure = Figure(figsize=(2.6 * len(parameters) + 0.8, 3.2), dpi=140, layout="constrained")
    panels = figure.subplots(1, len(parameters), sharey=True, squeeze=False)[0]
    ways = [(False, OURS, "as believed"), (True, THEIRS, "with autofocus")]
    for axes, name in zip(panels, parameters, strict=True):
        there = [named == name or named not in UNITS for named in names]
        part = one.isel(error=there).sortby("error_value")
        for on, colour, label in ways:
            if "autofocus" not in part.dims and bool(part.autofocus) != on:
                continue
            here = part.sel(autofocus=on) if "autofocus" in part.dims else part
            values = here.profile_correlation
            over = [dim for dim in values.dims if dim == "replicate"]
            scatter = values.std(over, ddof=1) if over else 0 * values
            axes.errorbar(
                here.error_value.values,
                values.mean(over).values,
                scatter.values,
                color=colour,
                fmt="o-",
                ms=3,
                label=label,
            )
        axes.set_xlabel(f"error of {name.replace('_', ' ')} [{UNITS[name]}]", fontsize=8)
        axes.grid(color="0.92")
        axes.spines[["right", "top"]].set_visible(False)
    panels[0].set_ylabel("correlation with the noiseless profile", fontsize=8)
    panels[0].legend(frameon=False, fontsize=8, loc="lower center")
    figure.suptitle(
        f"{_titled(one)}{which(one, flights.looks, but=(*TITLED, 'autofocus'))}", fontsize=10
    )
    return figure


def draw_measured(tables: xr.Dataset) -> Figure:
    """Percent named right by aspect bin: measured profiles beside synthetic ones.

    One panel a classifier and pulse width, the ship alone, with 95 % intervals; the nominal one of
    several flights and vigilances, as the title says.
    """
    from matplotlib.figure import Figure

    one = nominal(tables, keep=("pulse_width", "classifier", "kind", "aspect_bin"))
    rows, columns = one.sizes["pulse_width"], one.sizes["classifier"]
    figure = Figure(figsize=(3.0 * columns + 0.6, 2.5 * rows + 0.4), dpi=140, layout="constrained")
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    labels = one.aspect_bin.values.tolist()
    for row, column in np.ndindex(rows, columns):
        axes: Any = panels[row, column]
        here = one.isel(pulse_width=row, classifier=column)
        for shift, kind, colour in (
            (-0.2, "learned", "0.7"),
            (0.0, "test", "0.4"),
            (0.2, "measured", OURS),
        ):
            part = 100 * here.sel(kind=kind)
            middle = part.ship_accuracy.values
            ends = [middle - part.ship_ci_low.values, part.ship_ci_high.values - middle]
            place = np.arange(len(labels)) + shift
            shown = {"learned": "synthetic, learned", "test": "synthetic, noisy"}.get(kind, kind)
            axes.errorbar(place, middle, ends, fmt="o", color=colour, capsize=3, label=shown)
        axes.set_xticks(np.arange(len(labels)), labels, fontsize=8)
        plain_percent(axes)
        axes.set_title(f"{here.classifier.item()}, {here.pulse_width.item():g} ns", fontsize=9)
    for axes in panels[:, 0]:
        axes.set_ylabel("ships right [%]", fontsize=8)
    for axes in panels[-1]:
        axes.set_xlabel("aspect [deg]", fontsize=8)
    panels[0, 0].legend(frameon=False, fontsize=7, loc="lower left")
    which_one = which(one, tables)
    if which_one:
        figure.suptitle(which_one.removeprefix(", "), fontsize=10)
    return figure


def _filled(axes: Axes, place: Any, profile: Any, label: str) -> None:
    axes.fill_between(place, 0, _over_peak(profile), step="mid", color=TRUTH, lw=0, label=label)


def _line(axes: Axes, place: Any, profile: Any, colour: str, label: str) -> None:
    axes.step(place, _over_peak(profile), where="mid", color=colour, lw=1.1, label=label)


def _over_peak(profile: Any) -> NDArray[np.float64]:
    """A profile with its peak as unit; flat where nothing returns."""
    values = np.asarray(profile, dtype=float)
    peak = values.max()
    return values / peak if peak > 0 else np.zeros_like(values)

"""Picture of run time against error: one curve an engine."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from sweeps.stages.run_time_tables import BIN_WIDTH, TARGET

COLOURS = {"osmesa": "#1f4e79", "egl": "#6aa5d8", "embree": "#c1440e", "lines": "#2a9d5c"}
MARKERS = {"osmesa": "s", "egl": "x", "embree": "^", "lines": "o"}
Points = list[tuple[float, float, float]]  # time [ms], error [%], pixel [m]


def draw_run_time(table: xr.Dataset) -> Figure:
    """Draw median error against run time, of the whole ship without a pulse and after each.

    Every sampling is a faint mark. A curve joins those of an engine than which no other of its
    samplings is both quicker and more exact; the worst views of these are dashed.
    """
    here = table.sel(bin_width=BIN_WIDTH, method="nearest")
    widths = np.atleast_1d(here.pulse_width.values)
    kinds = [("extent_error", "no pulse", here.isel(pulse_width=0))]
    kinds += [
        ("profile_error", f"{width:g} ns pulse", here.sel(pulse_width=width)) for width in widths
    ]
    engines = here.engine.values.tolist() if "engine" in here.dims else [here.engine.item()]
    figure = Figure(figsize=(3.0 * len(kinds) + 0.4, 4.1), dpi=130, layout="constrained")
    panels = figure.subplots(1, len(kinds), sharex=True, sharey=True, squeeze=False)[0]
    for axes, (name, title, part) in zip(panels, kinds, strict=True):
        for engine in engines:
            of_one = part.sel(engine=engine) if "engine" in part.dims else part
            _curve(axes, of_one, name, engine)
        axes.axhline(100 * TARGET, color="0.5", lw=0.8, ls=":")
        axes.set(xscale="log", yscale="log", xlabel="run time of a view [ms]")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.set_title(title, fontsize=10)
        axes.grid(True, color="0.92", lw=0.6)
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("error of the ship's range extent [%]")
    keys: list[Any] = [
        Line2D([], [], color=_colour(engine), marker=MARKERS.get(engine, "o"), ms=4, label=engine)
        for engine in engines
    ]
    keys.append(Line2D([], [], color="0.4", lw=0.9, ls="--", label="worst view"))
    keys.append(Line2D([], [], color="0.6", ls="", marker=".", label="other rolls and spreads"))
    figure.legend(handles=keys, loc="outside lower center", ncols=len(keys), frameon=False)
    said = "Run time against error: median of views"
    figure.suptitle(f"{said}, labels are pixels or distances of lines [m]", fontsize=11)
    return figure


def _curve(axes: Axes, part: xr.Dataset, name: str, engine: str) -> None:
    """Draw all samplings of an engine, and the best of them joined."""
    median, worst = points_of(part, f"{name}_median"), points_of(part, f"{name}_worst")
    colour, marker = _colour(engine), MARKERS.get(engine, "o")
    milliseconds, percent, _ = np.array(median).T
    axes.plot(milliseconds, percent, ".", color=colour, alpha=0.25, ms=4)
    best = front(median)
    x, y, pixels = np.array([median[place] for place in best]).T
    axes.plot(x, y, "-", color=colour, marker=marker, ms=4, lw=1.5)
    axes.plot(x, [worst[place][1] for place in best], "--", color=colour, lw=0.9, alpha=0.8)
    if engine == "lines":
        for at, error, pixel in zip(x, y, pixels, strict=True):
            axes.annotate(
                f"{pixel:g}", (at, error), (-4, -9), textcoords="offset points", fontsize=6.5,
                ha="right", color=colour,
            )  # fmt: skip


def points_of(part: xr.Dataset, name: str) -> Points:
    """Return run time [ms], error [%] and pixel [m] of every sampling, known ones only."""
    error, run_time, pixel = (
        array.values.ravel() for array in xr.broadcast(part[name], part.run_time, part.pixel)
    )
    known = np.isfinite(error) & np.isfinite(run_time)
    columns = (1e3 * run_time[known], 100 * error[known], pixel[known])
    return [(float(x), float(y), float(z)) for x, y, z in zip(*columns, strict=True)]


def front(points: Points) -> list[int]:
    """Return numbers of the points that no other is both quicker and more exact than, by time."""
    found: list[int] = []
    for place in sorted(range(len(points)), key=lambda one: points[one]):
        if not found or points[place][1] < points[found[-1]][1]:
            found.append(place)
    return found


def _colour(engine: str) -> str:
    return COLOURS.get(engine, "0.3")

"""Picture of run time against error: one curve an engine."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from sweeps.stages.run_time_tables import BIN_WIDTH, TARGET, nominal

COLOURS = {"osmesa": "#1f4e79", "egl": "#6aa5d8", "embree": "#c1440e", "lines": "#2a9d5c"}
MARKERS = {"osmesa": "s", "egl": "x", "embree": "^", "lines": "o"}
LABELLED = {"lines": (-8, -10), "embree": (8, 5)}  # whose pixels are written, and where
Floats = NDArray[np.float64]


def draw_run_time(table: xr.Dataset) -> Figure:
    """Draw median error against run time, of the whole ship without a pulse and after each.

    Every sampling is a faint mark. A curve joins the pixels of an engine, rolled and spread as by
    default; the worst views of these are dashed.
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
    """Draw all samplings of an engine, and join those rolled and spread as by default."""
    style: dict[str, Any] = {"color": _colour(engine)}
    axes.plot(*points_of(part, f"{name}_median")[:2], ".", alpha=0.25, ms=4, **style)
    here = nominal(part)
    x, y, pixels = points_of(here, f"{name}_median")
    axes.plot(x, y, "-", marker=MARKERS.get(engine, "o"), ms=4, lw=1.5, label=engine, **style)
    axes.plot(*points_of(here, f"{name}_worst")[:2], "--", lw=0.9, alpha=0.8, **style)
    for at, error, pixel in zip(x, y, pixels, strict=True):
        if engine in LABELLED:
            where: dict[str, Any] = {"xytext": LABELLED[engine], "textcoords": "offset points"}
            axes.annotate(f"{pixel:g}", (at, error), fontsize=6.5, ha="center", **where, **style)


def points_of(part: xr.Dataset, name: str) -> tuple[Floats, Floats, Floats]:
    """Return run time [ms], error [%] and pixel [m] of every sampling, by pixel."""
    arrays = xr.broadcast(part.run_time, part[name], part.pixel)
    run_time, error, pixel = (array.values.ravel() for array in arrays)
    order = np.argsort(pixel, kind="stable")
    return 1e3 * run_time[order], 100 * error[order], pixel[order]


def _colour(engine: str) -> str:
    return COLOURS.get(engine, "0.3")

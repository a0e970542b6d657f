"""Picture of run time against error: one curve for each engine."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from sweeps.report.style import (
    BELOW,
    BLUE,
    GREEN,
    HALO,
    HEADING,
    LABEL,
    RUST,
    SKY,
    SMALL,
    bare,
    titled,
)
from sweeps.stages.run_time_tables import BIN_WIDTH, TARGET, nominal

COLOURS = {"osmesa": BLUE, "egl": SKY, "embree": RUST, "lines": GREEN}
MARKERS = {"osmesa": "s", "egl": "D", "embree": "^", "lines": "o"}
WIDTHS = {"egl": 3.0}  # osmesa, with the same errors, is drawn over it
LABELLED = {"lines": (-8, -11), "embree": (9, 5)}  # engines with labels, and their offsets
COLUMNS = 2  # of panels
Floats = NDArray[np.float64]


def draw_run_time(table: xr.Dataset) -> Figure:
    """Draw median error against run time, of the whole ship without a pulse and with each.

    Every sampling is a faint mark. A curve joins the pixels of an engine, rolled and spread as by
    default; the worst views of these are dashed. Raises ValueError if there is only one engine.
    """
    if "engine" not in table.dims:
        raise ValueError("the store has one engine, but must have at least two to compare")
    here = table.sel(bin_width=BIN_WIDTH, method="nearest")
    widths = np.atleast_1d(here.pulse_width.values)
    kinds = [("extent_error", "no pulse", here.isel(pulse_width=0))]
    kinds += [
        ("profile_error", f"{width:g} ns pulse", here.sel(pulse_width=width)) for width in widths
    ]
    engines = sorted(np.atleast_1d(here.engine.values).tolist())
    rows, columns = math.ceil(len(kinds) / COLUMNS), min(COLUMNS, len(kinds))
    size = (4.3 * columns + 0.4, 2.7 * rows + 1.4)
    figure = Figure(figsize=size, dpi=150, layout="constrained")
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axes, (name, title, part) in zip(panels, kinds, strict=False):
        for engine in engines:
            of_one = part.sel(engine=engine) if "engine" in part.dims else part
            _curve(axes, of_one, name, engine)
        axes.axhline(100 * TARGET, color="0.4", lw=1.0, ls=":")
        axes.set(xscale="log", yscale="log")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.tick_params(labelsize=SMALL)
        axes.set_title(title, fontsize=HEADING)
        axes.grid(True, color="0.92", lw=0.6)
        axes.set_axisbelow(True)
        axes.margins(0.09)
        bare(axes)
    for spare in panels[len(kinds) :]:
        spare.remove()
    for axes in panels[: len(kinds) : columns]:
        axes.set_ylabel("error of the range extent [%]", fontsize=LABEL)
    for axes in panels[max(0, len(kinds) - columns) : len(kinds)]:
        axes.set_xlabel("run time of one view [ms]", fontsize=LABEL)
        axes.tick_params(labelbottom=True)
    keys: list[Any] = [
        Line2D([], [], color=_colour(engine), marker=MARKERS.get(engine, "o"), ms=5, label=engine)
        for engine in engines
    ]
    keys.append(Line2D([], [], color="0.4", lw=0.9, ls="--", label="worst view"))
    keys.append(Line2D([], [], color="0.6", ls="", marker=".", label="other rolls and spreads"))
    keys.append(Line2D([], [], color="0.4", lw=1.0, ls=":", label=f"target, {100 * TARGET:g} %"))
    figure.legend(handles=keys, ncols=4, fontsize=SMALL, **BELOW)
    titled(
        figure,
        "Run time against error, median of views",
        "numbers are pixels, or spacings of lines [m]",
    )
    return figure


def _curve(axes: Axes, part: xr.Dataset, name: str, engine: str) -> None:
    """Draw all samplings of an engine, and join those rolled and spread as by default."""
    style: dict[str, Any] = {"color": _colour(engine)}
    axes.plot(*points_of(part, f"{name}_median")[:2], ".", alpha=0.25, ms=4, **style)
    here = nominal(part)
    x, y, pixels = points_of(here, f"{name}_median")
    axes.plot(
        x,
        y,
        "-",
        marker=MARKERS.get(engine, "o"),
        ms=5,
        lw=WIDTHS.get(engine, 1.4),
        label=engine,
        **style,
    )
    axes.plot(*points_of(here, f"{name}_worst")[:2], "--", lw=0.9, alpha=0.8, **style)
    for at, error, pixel in zip(x, y, pixels, strict=True):
        if engine in LABELLED:
            where: dict[str, Any] = {"xytext": LABELLED[engine], "textcoords": "offset points"}
            where |= {"fontsize": SMALL, "ha": "center", "path_effects": HALO}
            axes.annotate(f"{pixel:g}", (at, error), **where, **style)


def points_of(part: xr.Dataset, name: str) -> tuple[Floats, Floats, Floats]:
    """Return run time [ms], error [%] and pixel [m] of every sampling, by pixel."""
    arrays = xr.broadcast(part.run_time, part[name], part.pixel)
    run_time, error, pixel = (array.values.ravel() for array in arrays)
    order = np.argsort(pixel, kind="stable")
    return 1e3 * run_time[order], 100 * error[order], pixel[order]


def _colour(engine: str) -> str:
    return COLOURS.get(engine, "0.3")

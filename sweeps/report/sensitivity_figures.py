"""Picture of the sensitivity of measured profiles to wrong flight parameters."""

from __future__ import annotations

import math
from typing import Any

import xarray as xr
from matplotlib.figure import Figure

from sweeps.report.axes import nominal, which
from sweeps.report.flights import TITLED, flown_past, titled_place
from sweeps.report.style import LABEL, OURS, SMALL, THEIRS, bare, key_below, nested, titled

UNITS = {"aircraft_speed": "%", "ship_speed": "m/s"} | dict.fromkeys(
    ("aircraft_heading", "ship_heading", "pointing"), "°"
)
ACROSS = 3  # panels of one row
FOCUSED = (  # autofocus, colour, style, name
    (False, OURS, "o-", "parameters as recorded"),
    (True, THEIRS, "s--", "with autofocus"),
)


def draw_sensitivity(flights: xr.Dataset) -> Figure:
    """Draw mean correlation with the noiseless profile against the error of each parameter.

    Raises ValueError if there are no errors.
    """
    if flights.sizes.get("error", 1) < 2:
        raise ValueError("irar.errors is empty, but must name parameters and their errors")
    first = flights.sel(ship=flown_past(flights)[0]).isel(aspect=0, range=0)
    one = nominal(first, keep=("error", "autofocus", "replicate"))[["profile_correlation"]].load()
    names = one.error_parameter.values.tolist()
    parameters = [name for name in dict.fromkeys(names) if name in UNITS]
    columns = min(ACROSS, len(parameters))
    rows = math.ceil(len(parameters) / columns)
    size = (3.1 * columns + 0.6, 2.5 * rows + 1.1)
    figure = Figure(figsize=size, dpi=150, layout="constrained")
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
    for axes, name in zip(panels, parameters, strict=False):
        there = [named == name or named not in UNITS for named in names]
        part = one.isel(error=there).sortby("error_value")
        for place, (on, colour, style, label) in enumerate(FOCUSED):
            here = part.sel(autofocus=on) if "autofocus" in part.dims else part
            if bool(here.autofocus) != on:
                continue
            values = here.profile_correlation
            over = [dim for dim in values.dims if dim == "replicate"]
            scatter = (values.std(over, ddof=1) if over else 0 * values).values
            how: dict[str, Any] = {"color": colour, "mfc": "white", "label": label}
            how |= nested(place, len(FOCUSED))
            means = values.mean(over).values
            axes.errorbar(here.error_value.values, means, scatter, fmt=style, **how)
        axes.set_xlabel(f"error of {name.replace('_', ' ')} [{UNITS[name]}]", fontsize=LABEL)
        axes.tick_params(labelsize=SMALL)
        axes.grid(color="0.92")
        axes.set_axisbelow(True)
        bare(axes)
    for axes in panels[::columns]:
        axes.set_ylabel("correlation", fontsize=LABEL)
    for spare in panels[len(parameters) :]:
        spare.remove()
    draws = flights.sizes.get("replicate", 1)
    bars = f"mean ± standard deviation over {draws} draws of the noise" if draws > 1 else ""
    key_below(figure, panels[0], title=bars)
    others = which(one, flights.looks, but=(*TITLED, "autofocus")).removeprefix(", ")
    title = "Simulated flights: correlation with noiseless profiles, one parameter wrong"
    titled(figure, title, titled_place(one), others)
    return figure

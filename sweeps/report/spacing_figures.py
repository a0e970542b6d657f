"""Picture of how densely ships must be learned."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from sweeps.report.axes import NOMINAL
from sweeps.report.score_figures import BELOW, OURS, THEIRS, THIN, plain_percent

KEPT = ("template_spacing", "range", "aspect_bin")
SHOWN = ("overall", "60")
"""Bins that are drawn, by how their names begin: near the beam ships turn fastest."""

LINES: dict[str, tuple[str, str, str, dict[str, Any]]] = {
    "profile, ACN": ("acn", OURS, "o-", {}),
    "profile, correlation": ("correlation", "#2a9d5c", "^-", {}),
    "profile, maximum likelihood": ("fusion", "0.45", "D-", {"channel": "range"}),
    "silhouette, ACN": ("acn_infrared", THEIRS, "s--", {}),
    "silhouette, every one learned": ("fusion", "#b8860b", "v--", {"channel": "infrared"}),
    "both": ("fusion", "black", "D-", {"channel": "both"}),
}
"""By its name, a line's table, colour, style, and place on an axis of that table."""


def draw_spacing(tables: Mapping[str, xr.Dataset]) -> Figure:
    """Draw percent correct at aspects drawn at random against the spacing of the templates.

    Raises
    ------
    ValueError
        If there are not several spacings, or no such aspects.
    """
    lines = {
        name: (_at_random(tables[table], chosen), colour, style)
        for name, (table, colour, style, chosen) in LINES.items()
        if table in tables
    }
    if not lines:
        raise ValueError(f"it has none of the tables {', '.join(sorted(tables))}")
    first = next(iter(lines.values()))[0]
    ranges, spacings = first.range.values.tolist(), first.template_spacing.values
    bins = [name for name in first.aspect_bin.values.tolist() if name.startswith(SHOWN)]
    figure = Figure(figsize=(2.9 * len(ranges) + 0.6, 2.6 * len(bins) + 0.9), dpi=140)
    figure.set_layout_engine("constrained")
    panels = figure.subplots(len(bins), len(ranges), sharex=True, sharey=True, squeeze=False)
    for row, column in np.ndindex(len(bins), len(ranges)):
        axes: Any = panels[row, column]
        where = {"range": ranges[column], "aspect_bin": bins[row]}
        for name, (table, colour, style) in lines.items():
            here = table.sel(where)
            middle = here.accuracy.values
            ends = 100 * np.abs([here.ci_low.values - middle, here.ci_high.values - middle])
            axes.errorbar(spacings, 100 * middle, ends, fmt=style, color=colour, label=name, **THIN)
        axes.set_xscale("log", base=2)
        axes.set_xticks(spacings, [f"{one:g}" for one in spacings])
        axes.set_title(f"{ranges[column]:g} km, {_words(bins[row])}", fontsize=10)
        plain_percent(axes)
    for axes in panels[:, 0]:
        axes.set_ylabel("percent correct")
    for axes in panels[-1]:
        axes.set_xlabel("template spacing [deg]")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, ncols=3, fontsize=8, **BELOW)
    figure.suptitle("Ships named right at aspects that nobody learned, 95 % intervals", fontsize=11)
    return figure


def _at_random(table: xr.Dataset, chosen: Mapping[str, Any]) -> xr.Dataset:
    """Return a table's scores by spacing, range and bin; the nominal or first of all other axes."""
    if "template_spacing" not in table.dims or "aspects" not in table.dims:
        raise ValueError("it lacks several values of classifier.template_spacing, or grid.fresh")
    here = table[["accuracy", "ci_low", "ci_high"]].sel({"aspects": "random", **chosen})
    for name in [name for name in here.dims if name not in KEPT]:
        there = here[name].values.tolist()
        wanted = NOMINAL.get(str(name))
        here = here.isel({name: there.index(wanted) if wanted in there else 0})
    return here.transpose(..., "template_spacing")


def _words(label: str) -> str:
    return label if label == "overall" else f"aspect {label.replace('-', '–')}°"

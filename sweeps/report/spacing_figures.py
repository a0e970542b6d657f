"""Picture of percent correct against the spacing of training aspects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from sweeps.report.axes import NOMINAL
from sweeps.report.style import (
    BLACK,
    BLUE,
    GOLD,
    GREEN,
    HEADING,
    LABEL,
    OFFSET_NOTE,
    ORCHID,
    RUST,
    SMALL,
    aspect_title,
    key_below,
    nested,
    offset,
    plain_percent,
    titled,
)

KEPT = ("template_spacing", "range", "aspect_bin")
SHOWN = ("overall", "60")
"""Lower ends of the bins drawn: near the beam, profiles change fastest with aspect."""

LINES: dict[str, tuple[str, str, str, dict[str, Any]]] = {
    "silhouette, ACN": ("acn_infrared", RUST, "s:", {}),
    "silhouette, nearest of all learned": ("fusion", GOLD, "v:", {"channel": "infrared"}),
    "profile, ACN": ("acn", BLUE, "o-", {}),
    "profile, correlation": ("correlation", GREEN, "^-", {}),
    "profile, maximum likelihood": ("fusion", ORCHID, "P-", {"channel": "range"}),
    "both sensors, maximum likelihood": ("fusion", BLACK, "D--", {"channel": "both"}),
}
"""Of each line the table, colour, style, and selection along the table's axes."""


def draw_spacing(tables: Mapping[str, xr.Dataset]) -> Figure:
    """Draw percent correct at random aspects against the spacing of the templates.

    Raises
    ------
    ValueError
        If there is only one spacing, or there are no random aspects.
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
    size = (2.9 * len(ranges) + 0.6, 2.4 * len(bins) + 1.3)
    figure = Figure(figsize=size, dpi=150, layout="constrained")
    panels = figure.subplots(len(bins), len(ranges), sharex=True, sharey=True, squeeze=False)
    for row, column in np.ndindex(len(bins), len(ranges)):
        axes: Any = panels[row, column]
        where = {"range": ranges[column], "aspect_bin": bins[row]}
        for place, (name, (table, colour, style)) in enumerate(lines.items()):
            here = table.sel(where)
            middle = here.accuracy.values
            ends = 100 * np.abs([here.ci_low.values - middle, here.ci_high.values - middle])
            x = offset(spacings, place, len(lines))
            how: dict[str, Any] = {"color": colour, "label": name, "mfc": "white"}
            axes.errorbar(x, 100 * middle, ends, fmt=style, **how, **nested(place, len(lines)))
        axes.set_xscale("log", base=2)
        axes.set_xticks(spacings, [f"{one:g}" for one in spacings])
        axes.tick_params(labelsize=SMALL)
        axes.set_title(f"{ranges[column]:g} km, {aspect_title(bins[row])}", fontsize=HEADING)
        plain_percent(axes)
    for axes in panels[:, 0]:
        axes.set_ylabel("percent correct", fontsize=LABEL)
    for axes in panels[-1]:
        axes.set_xlabel("template spacing [°]", fontsize=LABEL)
    key_below(figure, panels[0, 0], title=f"95 % intervals. {OFFSET_NOTE}")
    titled(figure, "Percent correct at random aspects, absent from training")
    return figure


def _at_random(table: xr.Dataset, chosen: Mapping[str, Any]) -> xr.Dataset:
    """Return a table's scores by spacing, range and bin, nominal or first on all other axes."""
    if "template_spacing" not in table.dims or "aspects" not in table.dims:
        raise ValueError("it lacks several values of classifier.template_spacing, or grid.fresh")
    here = table[["accuracy", "ci_low", "ci_high"]].sel({"aspects": "random", **chosen})
    for name in [name for name in here.dims if name not in KEPT]:
        there = here[name].values.tolist()
        wanted = NOMINAL.get(str(name))
        here = here.isel({name: there.index(wanted) if wanted in there else 0})
    return here.transpose(..., "template_spacing")

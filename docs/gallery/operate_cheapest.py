"""Least cost of a laser radar that suffices, against range: operate_cheapest.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt
import numpy as np

from sweeps.report.frames import frame

store, picture = sys.argv[1:]
rows = frame(store, "operate_cheapest")
for name in ("target_free_ifovs", "gain_sigma"):
    if name in rows:
        rows = rows[rows[name] == rows[name].iloc[0]]
fleets = sorted(rows.fleet.unique())
fleets = sorted({fleets[0], fleets[len(fleets) // 4], fleets[-1]})
size = {"figsize": (9, 4.4), "layout": "constrained", "sharey": True}
figure, panels = plt.subplots(1, 2, **size)
for axes, channel in zip(panels, ("profile", "both"), strict=True):
    for number, fleet in enumerate(fleets):
        line = rows[(rows.channel == channel) & (rows.fleet == fleet)].sort_values("range_km")
        line = line[np.isfinite(line.cost)]
        high = line.ci_high.replace(np.inf, np.nan).fillna(1e4)
        ends = [line.cost - line.ci_low, high - line.cost]
        ranges = line.range_km * 1.015 ** (number - 1.5)
        colour = f"C{number}"
        axes.errorbar(ranges, line.cost, ends, fmt="o-", ms=4, color=colour, capsize=2, label=fleet)
        for x, y, row in zip(ranges, line.cost, line.itertuples(), strict=True):
            text = f"{row.best_pulse_width:g} ns\n{row.best_ifov:g} µrad"
            if fleet == fleets[-1]:
                axes.annotate(text, (x, y), (3, -14), textcoords="offset points", fontsize=6)
    axes.axhline(1, color="0.6", ls=":")
    axes.set(xscale="log", yscale="log", title=channel, xlabel="slant range [km]")
    ticks = sorted(rows.range_km.unique())
    axes.set_xticks(ticks, [f"{value:g}" for value in ticks], rotation=45)
    axes.minorticks_off()
    axes.margins(x=0.12)
panels[0].set_ylabel("energy × aperture area, over the article's sensor")
panels[0].legend(title="ships")
figure.savefig(picture, dpi=150)

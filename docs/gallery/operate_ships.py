"""Percent identified against the number of ships: operate_ships.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

store, picture = sys.argv[1:]
operated = xr.open_zarr(store, group="operate").load()
near = operated.sel(ifov=150, cnr=32, method="nearest").sel(frame_count=16, method="nearest")
ranges = operated.range.sel(range=[25, 50, 100], method="nearest").values
size = {"figsize": (10, 4.2), "layout": "constrained", "sharey": True}
figure, panels = plt.subplots(1, 3, **size)
pulses = near.pulse_width.values
styles = dict(zip(sorted({pulses[0], 30.0} & {*pulses}), ("-", "--"), strict=False))
for axes, slant_range in zip(panels, ranges, strict=True):
    for channel, colour in (("silhouette", "C2"), ("profile", "C0"), ("both", "C3")):
        for pulse, style in styles.items():
            if channel == "silhouette" and style == "--":
                continue
            curve = near.sel(range=slant_range, channel=channel, pulse_width=pulse)
            resampled = curve.resampled.transpose("resample", "fleet")
            low, high = 100 * np.quantile(resampled, [0.025, 0.975], axis=0)
            axes.fill_between(near.fleet, low, high, color=colour, alpha=0.15, lw=0)
            label = channel if channel == "silhouette" else f"{channel}, {pulse:g} ns"
            axes.plot(
                near.fleet, 100 * curve.share, color=colour, ls=style, marker=".", label=label
            )
    axes.plot(near.fleet, 100 / near.fleet, color="0.6", ls=":", label="chance")
    axes.axhline(95, color="0.8", lw=0.8)
    axes.set(title=f"{slant_range:g} km", xscale="log", ylim=(0, 102), xlabel="ships told apart")
    ticks = near.fleet.sel(fleet=[4, 6, 10, 20, 30, 60], method="nearest").values
    axes.set_xticks(ticks, [f"{value:g}" for value in ticks])
    axes.minorticks_off()
panels[0].set_ylabel(f"percent identified, {near.frame_count.item():g} frames")
handles = panels[0].get_legend_handles_labels()
figure.legend(*handles, loc="outside lower center", ncols=6)
figure.savefig(picture, dpi=150)

"""Frames by which 95 % are identified, against range: operate_contours.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

from ncti.evaluate import crossing

store, picture = sys.argv[1:]
operated = xr.open_zarr(store, group="operate").load()
near = operated.sel(ifov=150, cnr=32, method="nearest")
fleets, pulses = operated.fleet.values[[0, len(operated.fleet) // 2, -1]], near.pulse_width.values
size = {"figsize": (10, 4.2), "layout": "constrained", "sharex": True, "sharey": True}
figure, panels = plt.subplots(1, 3, **size)
frames, most = near.frame_count.values, near.frame_count.values.max()
lines = [("silhouette", pulses[0], "C2", "-")]
for style, pulse in zip(("-", "--"), sorted({pulses[0], 30.0} & {*pulses}), strict=False):
    lines += [("profile", pulse, "C0", style), ("both", pulse, "C3", style)]
for axes, fleet in zip(panels, fleets, strict=True):
    for channel, pulse, colour, style in lines:
        at = {"fleet": fleet, "channel": channel, "pulse_width": pulse}
        share = near.share.sel(at).transpose("range", ...)
        again = near.resampled.sel(at).transpose("range", "resample", ...)
        low, high = np.quantile(crossing(again, frames), [0.025, 0.975], 1, method="inverted_cdf")
        inside = np.isfinite(low)
        where, ends = near.range.values[inside], np.minimum([low, high], 4 * most)[:, inside]
        axes.fill_between(where, *ends, color=colour, alpha=0.15, lw=0)
        label = channel if channel == "silhouette" else f"{channel}, {pulse:g} ns"
        axes.plot(
            near.range, crossing(share, frames), color=colour, ls=style, marker=".", label=label
        )
    title = f"{fleet} ships"
    axes.set(xscale="log", yscale="log", title=title, ylim=(0.8 * frames.min(), 1.6 * most))
    axes.set_xticks(near.range.values[::2], [f"{value:g}" for value in near.range.values[::2]])
    axes.set_xticks([], minor=True)
    axes.set_yticks(frames, [f"{value:g}" for value in frames])
    axes.set_yticks([], minor=True)
    axes.set_xlabel("slant range [km]")
panels[0].set_ylabel("frames by which 95 % are identified")
handles = panels[0].get_legend_handles_labels()
figure.legend(*handles, loc="outside lower center", ncols=5)
figure.savefig(picture, dpi=150)

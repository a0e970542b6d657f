"""Frames by which 95 % are identified, against range: operate_contours.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

from studies.operate.sufficiency import crossing

store, picture = sys.argv[1:]
operated = xr.open_zarr(store, group="operate").load()
near = operated.sel(ifov=150, cnr=32, method="nearest")
fleets, pulses = operated.fleet.values[[0, len(operated.fleet) // 2, -1]], near.pulse_width.values
frames = near.frame_count.values
lines = [("silhouette", pulses[0], "C2", "-")]
for style, pulse in zip(("-", "--"), (pulses[0], 30.0), strict=True):
    lines += [("profile", pulse, "C0", style), ("both", pulse, "C3", style)]
size = {"figsize": (10, 4.2), "layout": "constrained", "sharex": True, "sharey": True}
figure, panels = plt.subplots(1, 3, **size)
for axes, fleet in zip(panels, fleets, strict=True):
    for channel, pulse, colour, style in lines:
        curve = near.sel(fleet=fleet, channel=channel, pulse_width=pulse)
        needed = crossing(curve.share.transpose("range", ...), frames)
        resampled = crossing(curve.resampled.transpose("range", "resample", ...), frames)
        ends = np.quantile(resampled, [0.025, 0.975], axis=1, method="inverted_cdf")
        ends = np.minimum(ends, 9e9)  # of a contour that the most frames do not reach
        axes.fill_between(near.range, *ends, where=ends[0] < 9e9, color=colour, alpha=0.15, lw=0)
        label = channel if channel == "silhouette" else f"{channel}, {pulse:g} ns"
        axes.plot(near.range, needed, color=colour, ls=style, marker=".", label=label)
    axes.set(xscale="log", yscale="log", title=f"{fleet} ships", xlabel="slant range [km]")
    axes.set_ylim(0.8 * frames.min(), 1.6 * frames.max())
    axes.set_xticks(near.range.values[::2], [f"{value:g}" for value in near.range.values[::2]])
    axes.set_yticks(frames, [f"{value:g}" for value in frames])
    axes.minorticks_off()
panels[0].set_ylabel("frames by which 95 % are identified")
handles = panels[0].get_legend_handles_labels()
figure.legend(*handles, loc="outside lower center", ncols=5)
figure.savefig(picture, dpi=150)

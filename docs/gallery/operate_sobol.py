"""Sobol indices of percent identified, by setting: operate_sobol.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

from ncti.evaluate import grid_interpolant, sobol_indices

AXES = ("range", "ifov", "cnr", "pulse_width", "frame_count", "fleet")
store, picture = sys.argv[1:]
operated = xr.open_zarr(store, group="operate").load().transpose("channel", *AXES, "resample")
# CNR is in dB, a logarithm already.
places = [operated[name].values.astype(float) for name in AXES]
places[2] = 10 ** (places[2] / 10)
bounds = {name: tuple(np.log(at[[0, -1]])) for name, at in zip(AXES, places, strict=True)}
figure, panels = plt.subplots(1, 3, figsize=(10, 3.8), layout="constrained", sharey=True)
for axes, channel in zip(panels, operated.channel.values, strict=True):
    here, resamples = operated.sel(channel=channel), range(min(20, operated.sizes["resample"]))
    whole = sobol_indices(grid_interpolant(places, here.share.values), bounds, samples=1024)
    again = [
        sobol_indices(grid_interpolant(places, here.resampled[..., k].values), bounds, samples=256)
        for k in resamples
    ]
    at = np.arange(len(AXES))
    for shift, kind, colour in ((-0.2, "first", "C0"), (0.2, "total", "C1")):
        noise = np.std([getattr(one, kind) for one in again], axis=0)
        ends = np.hypot(getattr(whole, f"{kind}_interval"), 1.96 * noise)
        value, words = getattr(whole, kind), {"capsize": 2, "label": f"{kind} index"}
        axes.bar(at + shift, value, 0.4, yerr=ends, color=colour, **words)
    axes.set_xticks(at, [name.replace("_", " ") for name in AXES], rotation=60)
    axes.set(title=channel, ylim=(0, 1))
panels[0].set_ylabel("share of the variance of percent identified")
panels[-1].legend()
figure.savefig(picture, dpi=150)

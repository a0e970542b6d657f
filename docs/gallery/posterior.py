"""Posterior of the parameters that the article leaves open: posterior.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

from studies.reproduction.assumptions import PRIORS, Choice

FITS = {"2, 3": ("C0", "Tables 2, 3"), "4, 5": ("C1", "Tables 4, 5"), "all": ("0.2", "all tables")}
store, picture = sys.argv[1:]
weight = xr.open_zarr(store, group="tables/reproduction_fits").weight
value = xr.open_zarr(store, group="reproduction").value.sel(setting=weight.setting).load()
size = {"figsize": (13, 11), "layout": "constrained"}
figure, panels = plt.subplots(5, 6, sharey=True, **size)
for axes, (name, prior) in zip(panels.flat, PRIORS.items(), strict=True):
    classes = prior.classes(value.sel(parameter=name).values)
    count = len(prior.values) if isinstance(prior, Choice) else int(classes.max()) + 1
    places = np.arange(count + 1)
    for fit, (colour, tables) in FITS.items():
        share = np.bincount(classes, weight.sel(fitted=fit).values, count) * count
        axes.stairs(share, places, color=colour, lw=1.6, label=f"fitted to {tables}")
    axes.axhline(1, color="0.6", ls=":", label="prior")
    axes.set_title(f"{prior.group}: {prior.label}", fontsize=8)
    words = getattr(prior, "values", ())
    if words and len(words) < 4:
        axes.set_xticks(places[:-1] + 0.5, [str(word).replace("_", "\n") for word in words])
    elif words:
        axes.set_xticks(places[:-1:2] + 0.5, words[::2])
    else:
        ends = [prior.at(share) for share in (0, 0.25, 0.5, 0.75, 1 - 1e-9)]
        labels = [f"{end:.3g}" if end < 100 else f"{end:.0f}" for end in ends]
        axes.set_xticks(np.linspace(0, count, 5), labels)
    axes.tick_params(labelsize=7)
for axes in panels[:, 0]:
    axes.set_ylabel("posterior over prior", fontsize=8)
figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4)
figure.savefig(picture, dpi=120)

"""Figures of the article beside the values that settings reach: reached.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

FITS = {"2, 3": "C0", "4, 5": "C1"}
store, picture = sys.argv[1:]
table = xr.open_zarr(store, group="tables/reproduction").load()
names = table.figure.values
tables = np.array([int(name.split()[1].rstrip(",")) for name in names])
counts = np.array(["categories" in name for name in names])
parts = [(f"Table {number}, percent correct", (tables == number) & ~counts) for number in (2, 4, 5)]
parts.append(("Categories, Tables 3 and 5", counts))
size = {"figsize": (12, 8), "layout": "constrained"}
figure, panels = plt.subplots(2, 2, **size)
for axes, (title, mask) in zip(panels.flat, parts, strict=True):
    part = table.isel(figure=np.flatnonzero(mask))
    places = -np.arange(part.sizes["figure"])
    axes.barh(places, part.largest - part.least, 0.8, part.least, color="0.9", label="all settings")
    for offset, (fit, colour) in zip((0.15, -0.15), FITS.items(), strict=True):
        fitted = part.sel(fitted=fit)
        axes.hlines(places + offset, fitted.percent_low, fitted.percent_high, color=colour)
        label = f"fitted to Tables {fit}, 95 %"
        axes.plot(fitted.percent, places + offset, "o", ms=3, color=colour, label=label)
    axes.plot(part.article, places, "kx", label="article")
    axes.set_yticks(places, [name.split(", ", 1)[1] for name in part.figure.values], fontsize=7)
    axes.set_title(title, fontsize=9)
figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4)
figure.savefig(picture, dpi=120)

"""Categories by ship and aspect, as in Figures 19 and 20: categories.py STORE GROUP PICTURE.

GROUP is acn for range profiles, or acn_infrared for silhouettes.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

store, group, picture = sys.argv[1:]
classified = xr.open_zarr(store, group=f"classification/{group}")
formed = classified[["training_category"]]
nearest = {"pulse_width": 30, "vigilance": 0.95 if group == "acn" else 0.87}
formed = formed.sel({k: v for k, v in nearest.items() if k in formed.dims}, method="nearest")
first = dict.fromkeys(set(formed.dims) - {"ship", "aspect"}, 0)
category = formed.isel(first).training_category.transpose("ship", "aspect").values
ships, aspects = formed.ship.values, formed.aspect.values
used, number = np.unique(category, return_inverse=True)
number = number.reshape(category.shape)
# A category that views of several ships joined is marked: there, ships are confused.
shared = np.array([len(np.unique(np.nonzero(category == label)[0])) > 1 for label in used])

figure, axes = plt.subplots(figsize=(9, 0.6 * len(ships) + 1.4), layout="constrained")
edges = np.concatenate([[aspects[0]], (aspects[1:] + aspects[:-1]) / 2, [aspects[-1]]])
axes.pcolormesh(edges, np.arange(len(ships) + 1), number, cmap="tab20", ec="white", lw=0.2)
for row, column in zip(*np.nonzero(shared[number] & (category >= 0)), strict=True):
    axes.plot((edges[column] + edges[column + 1]) / 2, row + 0.5, "kx", ms=4)
axes.set_yticks(np.arange(len(ships)) + 0.5, [str(ship) for ship in ships])
axes.set(xlabel="aspect [°], 0 bow-on, 90 the port beam")
what = f"{int((used >= 0).sum())} categories, {int((shared & (used >= 0)).sum())} shared (crosses)"
axes.set_title(what, fontsize="medium")
figure.savefig(picture, dpi=150)

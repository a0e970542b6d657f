"""Infrared images and log-polar maps by range and resolution: silhouettes.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

store, picture = sys.argv[1:]
images = xr.open_zarr(store, group="infrared")
nearest = {"aspect": 60, "frame_count": 16}
view = images.sel({k: v for k, v in nearest.items() if k in images.dims}, method="nearest")
ship = "spruance" if "spruance" in view.ship.values else str(view.ship.values[0])
dims = {"range", "super_resolution", "row", "col", "angle", "radius"}
view = view.sel(ship=ship)
view = view.isel(dict.fromkeys(set(view.dims) - dims, 0)).load()
ranges, ways = view.range.values, view.super_resolution.values
size = {"figsize": (5 * len(ways), 1.6 * len(ranges)), "layout": "constrained"}
widths = [3, 1] * len(ways)
figure, panels = plt.subplots(len(ranges), len(widths), squeeze=False, width_ratios=widths, **size)
looks = [(slant_range, way) for slant_range in ranges for way in ways]
for (left, right), (slant_range, way) in zip(panels.reshape(-1, 2), looks, strict=True):
    look = view.sel(range=slant_range, super_resolution=way)
    image = look.image.transpose("row", "col").values
    rows, columns = np.isfinite(image).any(axis=1), np.isfinite(image).any(axis=0)
    across, up = look.horizontal.values[columns], look.vertical.values[rows]
    extent = (across[0], across[-1], up[0], up[-1])
    drawn = left.imshow(image[np.ix_(rows, columns)], origin="lower", extent=extent, cmap="inferno")
    figure.colorbar(drawn, ax=left, label="K")
    left.set_title(f"{slant_range:g} km, {way}")
    cells = look.log_polar.transpose("radius", "angle").values
    right.imshow(cells, origin="lower", extent=(0, 360, 0, 1), aspect="auto", cmap="Blues")
for axes in panels[-1]:
    axes.set_xlabel("angle [°]" if axes in panels[-1, 1::2] else "across [m]")
figure.suptitle(f"{ship}, aspect {float(view.aspect):g}°: images and log-polar maps")
figure.savefig(picture, dpi=110)

"""Near-stern profiles of flights, as in Figures 14 to 16: near_stern.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt
import xarray as xr

store, picture = sys.argv[1:]
flights = xr.open_zarr(store, group="validation").sel(aspect=175, method="nearest")
nominal = {"transom_gain": 1, "mast_gain": 1}
flights = flights.sel({k: v for k, v in nominal.items() if k in flights.dims}, method="nearest")
dims = {"ship", "range", "source", "down_range"}
profiles = flights.profile.isel(dict.fromkeys(set(flights.profile.dims) - dims, 0)).load()
likeness = flights.profile_correlation
likeness = likeness.isel(dict.fromkeys(set(likeness.dims) - dims, 0)).load()
flown = [s for s in profiles.ship.values if likeness.sel(ship=s).notnull().any()]
figure, panels = plt.subplots(
    len(flown), 1, figsize=(10, 2.6 * len(flown)), squeeze=False, layout="constrained"
)
for axes, ship in zip(panels[:, 0], flown, strict=True):
    slant_range = profiles.range.values[-1] if ship != "connole" else profiles.range.values[0]
    profile = profiles.sel(ship=ship, range=slant_range)
    profile = profile / profile.max("down_range")
    noiseless = profile.sel(source="noiseless")
    axes.fill_between(profile.down_range, 0, noiseless, step="mid", color="0.75", label="noiseless")
    axes.step(
        profile.down_range,
        profile.sel(source="measured"),
        where="mid",
        label="measured in a flight",
    )
    correlation = float(likeness.sel(ship=ship, range=slant_range))
    axes.set(
        title=f"{ship} at {slant_range:g} km, aspect {float(flights.aspect):g}°: {correlation:.3f}"
    )
    axes.set(xlim=(-80, 80), ylim=(0, 1.08), ylabel="relative to the peak")
panels[0, 0].legend(frameon=False)
panels[-1, 0].set_xlabel("down-range from the ship origin [m]")
figure.suptitle("Simulated flights near the stern, with the correlation of both profiles")
figure.savefig(picture, dpi=150)

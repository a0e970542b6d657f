"""Near-stern profiles of flights, as in Figures 14 to 16: near_stern.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt
import xarray as xr

store, picture = sys.argv[1:]
flights = xr.open_zarr(store, group="validation").sel(aspect=175, method="nearest")
plain = {"transom_gain": 1, "mast_gain": 1}
flights = flights.sel({k: v for k, v in plain.items() if k in flights.dims}, method="nearest")
kept = {"ship", "range", "source", "down_range"}
profiles = flights.profile.isel(dict.fromkeys(set(flights.profile.dims) - kept, 0)).load()
likeness = flights.profile_correlation
likeness = likeness.isel(dict.fromkeys(set(likeness.dims) - kept, 0)).load()
flown = [s for s in profiles.ship.values if likeness.sel(ship=s).notnull().any()]
figure, panels = plt.subplots(
    len(flown), 1, figsize=(10, 2.6 * len(flown)), squeeze=False, layout="constrained"
)
for axes, ship in zip(panels[:, 0], flown, strict=True):
    at = profiles.range.values[-1] if ship != "connole" else profiles.range.values[0]
    one = profiles.sel(ship=ship, range=at)
    one = one / one.max("down_range")
    noiseless = one.sel(source="noiseless")
    axes.fill_between(one.down_range, 0, noiseless, step="mid", color="0.75", label="noiseless")
    axes.step(one.down_range, one.sel(source="measured"), where="mid", label="measured in a flight")
    correlation = float(likeness.sel(ship=ship, range=at))
    axes.set(title=f"{ship} at {at:g} km, aspect {float(flights.aspect):g}°: {correlation:.3f}")
    axes.set(xlim=(-80, 80), ylim=(0, 1.08), ylabel="relative to the peak")
panels[0, 0].legend(frameon=False)
panels[-1, 0].set_xlabel("down-range from the ship origin [m]")
figure.suptitle("Simulated flights near the stern, with the correlation of both profiles")
figure.savefig(picture, dpi=150)

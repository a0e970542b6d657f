"""Profiles by aspect, by ship and by number of frames: range_profiles.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt
import xarray as xr

store, picture = sys.argv[1:]
profiles = xr.open_zarr(store, group="range_profile")[["expected", "averaged"]]
nearest = {"range": 100, "pulse_width": 30}
profiles = profiles.sel({k: v for k, v in nearest.items() if k in profiles.dims}, method="nearest")
others = set(profiles.dims) - {"ship", "aspect", "frame_count", "down_range"}
profiles = profiles.isel(dict.fromkeys(others, 0)).load()
quarter = profiles.sel(aspect=30, method="nearest")
ship = str(profiles.ship[0].item())


def stack(axes, lines, title):
    """Draw lines above one another, each above its noise floor and relative to its peak."""
    for number, (_, line) in enumerate(lines):
        line = (line - line.quantile(0.2)) / (line.max() - line.quantile(0.2))
        axes.plot(line.down_range, line.values - 1.2 * number)
    axes.set(title=title, xlabel="down-range from the ship origin [m]")
    axes.set_yticks([-1.2 * place for place in range(len(lines))], [label for label, _ in lines])
    axes.spines[["left", "right", "top"]].set_visible(False)


size = {"figsize": (11, 4.6), "layout": "constrained"}
figure, (by_aspect, by_ship, by_frames) = plt.subplots(1, 3, **size)
turned = [profiles.expected.sel(ship=ship).sel(aspect=a, method="nearest") for a in (0, 30, 60, 90)]
stack(by_aspect, [(f"{float(line.aspect):g}°", line) for line in turned], f"{ship}, bow to beam")
ships = [quarter.expected.sel(ship=name) for name in profiles.ship.values]
stack(by_ship, [(str(line.ship.item()), line) for line in ships], f"at {float(quarter.aspect):g}°")
means = [quarter.averaged.sel(ship=ship, frame_count=n) for n in profiles.frame_count.values]
stack(by_frames, [(f"{int(line.frame_count)} frames", line) for line in means], f"{ship}, averaged")
setting = f"{float(profiles.range):g} km, {float(profiles.pulse_width):g} ns"
figure.suptitle(f"Range profiles at {setting}")
figure.savefig(picture, dpi=150)

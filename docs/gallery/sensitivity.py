"""Effect of wrong flight parameters, with and without autofocus: sensitivity.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt

from sweeps.report.frames import frame

UNITS = {"aircraft_speed": "%", "ship_speed": "m/s"}  # all others in degrees
store, picture = sys.argv[1:]
rows = frame(store, "flights")
rows = rows[rows.profile_correlation.notna()]
names = [name for name in rows.error_parameter.unique() if name != "none"]
columns = min(3, len(names))
lines = -(-len(names) // columns)
size = {"figsize": (3.4 * columns, 2.7 * lines + 0.6), "layout": "constrained"}
figure, panels = plt.subplots(lines, columns, sharey=True, squeeze=False, **size)
for axes, name in zip(panels.ravel(), names, strict=False):
    cell = rows[rows.error_parameter.isin([name, "none"])]
    for focused, curve in cell.groupby("autofocus"):
        curve = curve.sort_values("error_value")
        spread = curve.get("profile_correlation_spread", 0)
        label = "with autofocus" if focused else "parameters as recorded"
        axes.errorbar(
            curve.error_value, curve.profile_correlation, spread, fmt="o-", capsize=2, label=label
        )
    axes.set_xlabel(f"error of {name.replace('_', ' ')} [{UNITS.get(name, '°')}]")
    axes.grid(color="0.92")
for spare in panels.ravel()[len(names) :]:
    spare.remove()
panels[0, 0].set_ylabel("correlation")
figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
figure.suptitle("Correlation of a simulated flight's profile with the noiseless one")
figure.savefig(picture, dpi=150)

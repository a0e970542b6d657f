"""Run time of a view against the error of its extent: run_time.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt

from sweeps.report.frames import frame

store, picture = sys.argv[1:]
rows = frame(store, "run_time_samplings")
if "engine" not in rows:
    rows["engine"] = "all"
if "pixel_m" not in rows:
    rows["pixel_m"] = 0.25
widths = sorted(rows.pulse_width_ns.unique())
kinds = [("no pulse", "extent_error", rows[rows.pulse_width_ns == widths[0]])]
kinds += [
    (f"{one:g} ns pulse", "profile_error", rows[rows.pulse_width_ns == one]) for one in widths
]
size = {"figsize": (9, 6.5), "layout": "constrained"}
figure, panels = plt.subplots(2, -(-len(kinds) // 2), sharex=True, sharey=True, **size)
for axes, (title, name, here) in zip(panels.ravel(), kinds, strict=False):
    for place, (engine, part) in enumerate(here.groupby("engine")):
        colour, part = f"C{place}", part.sort_values("pixel_m")
        error, time = 100 * part[f"{name}_median"], 1e3 * part.run_time
        axes.plot(time, error, ".", color=colour, alpha=0.3)  # of all rolls and spreads
        for setting in part.columns.intersection(["roll_deg", "spread"]):
            part = part[part[setting] == part[setting].max()]  # the defaults
        at = 1e3 * part.run_time, 100 * part[f"{name}_median"]
        axes.plot(*at, "o-", color=colour, label=engine)
        for x, y, pixel in zip(*at, part.pixel_m, strict=True):
            if engine in ("lines", "embree"):
                axes.annotate(f"{pixel:g} m", (x, y), fontsize="x-small", color=colour)
    axes.axhline(0.1, color="0.4", ls=":", label="0.1 %")
    axes.set(title=title, xscale="log", yscale="log")
figure.supxlabel("run time of one view [ms]")
figure.supylabel("median error of the range extent [%]")
figure.legend(*panels.ravel()[0].get_legend_handles_labels(), loc="outside right upper")
figure.savefig(picture, dpi=150)

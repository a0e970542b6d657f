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
    (f"{width:g} ns pulse", "profile_error", rows[rows.pulse_width_ns == width]) for width in widths
]
size = {"figsize": (9, 6.5), "layout": "constrained"}
figure, panels = plt.subplots(2, -(-len(kinds) // 2), sharex=True, sharey=True, **size)
for axes, (title, name, timings) in zip(panels.ravel(), kinds, strict=False):
    for number, (engine, curve) in enumerate(timings.groupby("engine")):
        colour, curve = f"C{number}", curve.sort_values("pixel_m")
        error, time = 100 * curve[f"{name}_median"], 1e3 * curve.run_time
        axes.plot(time, error, ".", color=colour, alpha=0.3)  # of all rolls and spreads
        for setting in curve.columns.intersection(["roll_deg", "spread"]):
            curve = curve[curve[setting] == curve[setting].max()]  # the defaults
        points = 1e3 * curve.run_time, 100 * curve[f"{name}_median"]
        axes.plot(*points, "o-", color=colour, label=engine)
        for x, y, pixel in zip(*points, curve.pixel_m, strict=True):
            if engine in ("lines", "embree"):
                axes.annotate(f"{pixel:g} m", (x, y), fontsize="x-small", color=colour)
    axes.axhline(0.1, color="0.4", ls=":", label="0.1 %")
    axes.set(title=title, xscale="log", yscale="log")
figure.supxlabel("run time of one view [ms]")
figure.supylabel("median error of the range extent [%]")
figure.legend(*panels.ravel()[0].get_legend_handles_labels(), loc="outside right upper")
figure.savefig(picture, dpi=150)

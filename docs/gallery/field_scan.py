"""Ships found in a field of regard, and the time that it takes: field_scan.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt

from sweeps.report.frames import frame
from sweeps.report.stores import attributes, open_store

SHARES = {
    "percent_detected": "ships detected",
    "percent_right": "identified, of the detected",
    "percent_rejected": "decoys rejected",
}
PARTS = {"imaging": "imager", "slewing": "moves", "dwelling": "visits"}
store, picture = sys.argv[1:]
rows = frame(store, "scan").sort_values(["frame_count", "range_km"])
figure, (share, time) = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
last = rows[rows.frame_count == rows.frame_count.max()]
for name, label in SHARES.items():
    low, high = last[f"{name}_ci_low"], last[f"{name}_ci_high"]
    ends = [(last[name] - low).clip(0), (high - last[name]).clip(0)]
    share.errorbar(last.range_km, last[name], ends, fmt="o-", capsize=2, label=label)
share.plot(last.range_km, last.percent_detected_in_closed_form, "k:", label="detected, closed form")
ships = attributes(open_store(store))["configuration"]["grid"]["ship"]
share.axhline(100 / len(ships), color="0.6", ls=":", label=f"chance, one of {len(ships)} ships")
share.set(xlabel="slant range [km]", ylabel="percent, 95 % intervals", ylim=(0, 104))
share.set_title(f"{int(last.draws.max())} draws, {int(last.frame_count.max())} frames")
share.legend(frameon=False, fontsize="small")
places, left = range(len(rows)), 0 * rows["imaging"].to_numpy()
for name, label in PARTS.items():
    time.barh(places, rows[name], left=left, label=label)
    left = left + rows[name].to_numpy()
time.barh(places, rows.exhaustive, color="none", ec="0.5", label="laser radar alone")
time.set_yticks(
    places, [f"{r:g} km, {n}" for r, n in zip(rows.range_km, rows.frame_count, strict=True)]
)
time.set(xlabel="mean time [s], by range and frames")
time.legend(frameon=False, fontsize="small")
figure.savefig(picture, dpi=150)

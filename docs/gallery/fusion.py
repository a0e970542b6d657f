"""Percent correct of profile, silhouette and both by range: fusion.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt

from sweeps.report.frames import frame

store, picture = sys.argv[1:]
rows = frame(store, "scores")
rows = rows[(rows.classifier == "fusion") & (rows.super_resolution == "none")]
rows = rows[rows.gain_sigma == rows.gain_sigma.max()]
rows = rows[rows.infrared_frame_count == rows.frame_count]
if "aspects" in rows:
    rows = rows[rows.aspects.isna() | (rows.aspects != "learned")]
bins, counts = rows.aspect_bin_deg.unique(), sorted(rows.frame_count.unique())
size = {"figsize": (2.8 * len(bins), 2.6 * len(counts) + 0.6), "layout": "constrained"}
figure, panels = plt.subplots(len(counts), len(bins), sharey=True, squeeze=False, **size)
for line, frames in zip(panels, counts, strict=True):
    for axes, name in zip(line, bins, strict=True):
        cell = rows[(rows.aspect_bin_deg == name) & (rows.frame_count == frames)]
        for number, channel in enumerate(("range", "infrared", "both")):
            part = cell[cell.channel == channel].drop_duplicates("range_km").sort_values("range_km")
            ends = [part.percent_correct - part.ci_low, part.ci_high - part.percent_correct]
            x = part.range_km + 1.5 * (number - 1)
            axes.errorbar(x, part.percent_correct, ends, fmt="o-", capsize=2, label=channel)
        axes.axhline(rows.percent_correct_by_chance.iloc[0], color="0.6", ls=":", label="chance")
        axes.set(title=f"{frames} frames, aspect {name} [°]", ylim=(0, 104))
        axes.set_xlabel("slant range [km]")
    line[0].set_ylabel("percent correct")
figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
figure.savefig(picture, dpi=150)

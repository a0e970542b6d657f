"""Percent correct of silhouettes by range beside Table 5: infrared_scores.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt

from sweeps.report.frames import frame

store, picture = sys.argv[1:]
rows = frame(store, "scores")
rows = rows[(rows.classifier == "acn") & (rows.channel == "infrared") & (rows.kind == "test")]
for name, value in {"vigilance": 0.87, "frame_count": 16}.items():
    rows = rows[(rows[name] - value).abs() == (rows[name] - value).abs().min()]
bins = rows.aspect_bin_deg.unique()
figure, panels = plt.subplots(1, len(bins), figsize=(11, 3.6), sharey=True, layout="constrained")
for axes, name in zip(panels, bins, strict=True):
    cell = rows[rows.aspect_bin_deg == name]
    for number, (way, part) in enumerate(cell.groupby("super_resolution")):
        part = part.drop_duplicates("range_km").sort_values("range_km")
        ends = [part.percent_correct - part.ci_low, part.ci_high - part.percent_correct]
        x, colour = part.range_km + 1.5 * (number - 1), f"C{number}"
        axes.errorbar(x, part.percent_correct, ends, fmt="o-", color=colour, capsize=2, label=way)
        if "article_percent_correct" in part:
            axes.plot(x, part.article_percent_correct, "x", color=colour, ms=8)
    axes.axhline(cell.percent_correct_by_chance.iloc[0], color="0.6", ls=":", label="chance")
    axes.set(title=f"aspect {name} [°]", xlabel="slant range [km]", ylim=(0, 104))
panels[0].set_ylabel("percent correct, 95 % intervals")
panels[0].legend(title="super-resolution; crosses: article", frameon=False, fontsize="small")
figure.savefig(picture, dpi=150)

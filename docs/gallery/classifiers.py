"""Percent correct of all classifiers of range profiles: classifiers.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt

from sweeps.report.frames import frame

LINES = {  # columns that select the rows of a curve
    "MNN, ship and aspects": {"classifier": "mnn", "scored": "ship and aspects"},
    "ACN": {"classifier": "acn", "learn_in_test": False},
    "correlation": {"classifier": "correlation"},
    "maximum likelihood, gain unknown": {"classifier": "likelihood", "gain_sigma": 1.0},
    "maximum likelihood, gain known": {"classifier": "likelihood", "gain_sigma": 0.0},
}
store, picture = sys.argv[1:]
rows = frame(store, "scores")
rows = rows[(rows.channel == "range") & (rows.kind == "test") & (rows.classifier != "fusion")]
rows = rows[(rows.pulse_width_ns - 30).abs() == (rows.pulse_width_ns - 30).abs().min()]
rows = rows[rows.vigilance.isna() | (rows.vigilance == 0.95)].astype({"frame_count": float})
bins = rows.aspect_bin_deg.unique()
figure, panels = plt.subplots(1, len(bins), figsize=(11, 3.8), sharey=True, layout="constrained")
for axes, name in zip(panels, bins, strict=True):
    for label, selection in LINES.items():
        curve = rows[rows.aspect_bin_deg == name]
        for column, value in selection.items():
            curve = curve[curve[column] == value]
        curve = curve.drop_duplicates("frame_count").sort_values("frame_count")
        ends = [curve.percent_correct - curve.ci_low, curve.ci_high - curve.percent_correct]
        axes.errorbar(
            curve.frame_count, curve.percent_correct, ends, fmt="o-", capsize=2, label=label
        )
    axes.axhline(rows.percent_correct_by_chance.max(), color="0.6", ls=":", label="chance, ship")
    axes.set(title=f"aspect {name} [°]", xlabel="frames averaged", xscale="log", ylim=(0, 104))
    counts = sorted(rows.frame_count.unique())
    axes.set_xticks(counts, [f"{count:g}" for count in counts])
    axes.minorticks_off()
panels[0].set_ylabel("percent correct, 95 % intervals")
figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
figure.savefig(picture, dpi=150)

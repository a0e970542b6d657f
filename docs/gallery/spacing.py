"""Percent correct at random aspects by the spacing of templates: spacing.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt

from sweeps.report.frames import frame

store, picture = sys.argv[1:]
rows = frame(store, "scores")
rows = rows[(rows.kind == "test") & (rows.aspects == "random")]
rows = rows[rows.super_resolution.isna() | (rows.super_resolution == "none")]
rows = rows[rows.gain_sigma.isna() | (rows.gain_sigma == rows.gain_sigma.max())]
rows = rows[(rows.classifier != "likelihood")]  # that of fusion, on profiles alone
ranges, bins = sorted(rows.range_km.dropna().unique()), rows.aspect_bin_deg.unique()[-2:]
size = {"figsize": (3.2 * len(ranges), 5.4), "layout": "constrained"}
figure, panels = plt.subplots(len(bins), len(ranges), sharey=True, squeeze=False, **size)
for line, name in zip(panels, bins, strict=True):
    for axes, slant_range in zip(line, ranges, strict=True):
        cell = rows[(rows.aspect_bin_deg == name) & (rows.range_km == slant_range)]
        for (classifier, channel), part in cell.groupby(["classifier", "channel"]):
            part = part.drop_duplicates("template_spacing_deg").sort_values("template_spacing_deg")
            ends = [part.percent_correct - part.ci_low, part.ci_high - part.percent_correct]
            spacing, label = part.template_spacing_deg, f"{classifier}, {channel}"
            axes.errorbar(spacing, part.percent_correct, ends, fmt="o-", capsize=2, label=label)
        axes.axhline(rows.percent_correct_by_chance.iloc[0], color="0.6", ls=":", label="chance")
        axes.set(title=f"{slant_range:g} km, aspect {name} [°]", ylim=(0, 104))
        axes.set_xlabel("spacing of templates [°]")
    line[0].set_ylabel("percent correct")
figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
figure.savefig(picture, dpi=150)

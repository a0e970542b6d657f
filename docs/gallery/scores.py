"""Percent correct by frames and aspect beside the article's Table 4: scores.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt

from sweeps.report.frames import frame

store, picture = sys.argv[1:]
rows = frame(store, "scores")
rows = rows[(rows.classifier == "acn") & (rows.channel == "range") & (rows.kind == "test")]
nearest = {"pulse_width_ns": 30, "vigilance": 0.95}
for name, value in nearest.items():
    rows = rows[(rows[name] - value).abs() == (rows[name] - value).abs().min()]
bins = rows.aspect_bin_deg.unique()
figure, panels = plt.subplots(1, len(bins), figsize=(11, 3.4), sharey=True, layout="constrained")
for axes, name in zip(panels, bins, strict=True):
    cell = rows[rows.aspect_bin_deg == name].astype({"frame_count": float})
    for learning, part in cell.groupby("learn_in_test"):
        part = part.drop_duplicates("frame_count").sort_values("frame_count")
        ends = [part.percent_correct - part.ci_low, part.ci_high - part.percent_correct]
        label = "learning in the test" if learning else "ours"
        axes.errorbar(
            part.frame_count, part.percent_correct, ends, fmt="o-", capsize=2, label=label
        )
    if "article_percent_correct" in cell:
        article = cell.dropna(subset="article_percent_correct").sort_values("frame_count")
        axes.plot(
            article.frame_count, article.article_percent_correct, "s--", label="article, Table 4"
        )
    axes.axhline(cell.percent_correct_by_chance.iloc[0], color="0.6", ls=":", label="chance")
    axes.set(title=f"aspect {name} [°]", xlabel="frames averaged", xscale="log", ylim=(0, 104))
    counts = sorted(cell.frame_count.unique())
    axes.set_xticks(counts, [f"{count:g}" for count in counts], minor=False)
    axes.minorticks_off()
panels[0].set_ylabel("percent correct, 95 % intervals")
figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
figure.savefig(picture, dpi=150)

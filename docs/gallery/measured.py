"""Percent correct of profiles of simulated flights, by training: measured.py STORE PICTURE."""

import sys

import matplotlib.pyplot as plt

from sweeps.report.frames import frame

store, picture = sys.argv[1:]
rows = frame(store, "scores")
rows = rows[(rows.scored == "ship") & rows.kind.isin(["learned", "test", "measured"])]
rows = rows[rows.aspect_bin_deg == "overall"]
if "vigilance" in rows:
    rows = rows[rows.vigilance.isna() | (rows.vigilance == rows.vigilance.max())]
classifiers, kinds = rows.classifier.unique(), ["learned", "test", "measured"]
words = {"learned": "learned", "test": "synthetic, noisy", "measured": "simulated flight"}
figure, panels = plt.subplots(
    1, len(classifiers), figsize=(10, 3.6), sharey=True, squeeze=False, layout="constrained"
)
for axes, name in zip(panels[0], classifiers, strict=True):
    cell = rows[rows.classifier == name]
    for number, kind in enumerate(kinds):
        part = cell[cell.kind == kind].drop_duplicates("pulse_width_ns")
        part = part.sort_values("pulse_width_ns")
        ends = [part.percent_correct - part.ci_low, part.ci_high - part.percent_correct]
        x = part.pulse_width_ns + 1.2 * (number - 1)
        axes.errorbar(x, part.percent_correct, ends, fmt="o-", capsize=2, label=words[kind])
    axes.axhline(cell.percent_correct_by_chance.iloc[0], color="0.6", ls=":", label="chance")
    axes.set(title=name, xlabel="pulse width [ns]", ylim=(0, 104))
panels[0, 0].set_ylabel("ships identified correctly [%]")
figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
figure.savefig(picture, dpi=150)

"""Percent correct of every classifier by split, of a published table: benchmark.py CSV PICTURE."""

import sys

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

table, picture = sys.argv[1:]
rows = pd.read_csv(table, index_col=0)
places = np.arange(len(rows.columns))
figure, axes = plt.subplots(figsize=(10, 4.6), layout="constrained")
for number, (classifier, cells) in enumerate(rows.iterrows()):
    # A cell has a mean and its interval, such as `72 [70-73]`.
    mean, low, high = cells.str.extract(r"(\d+) \[(\d+)-(\d+)\]").astype(float).to_numpy().T
    beside = places + 0.08 * (number - (len(rows) - 1) / 2)
    axes.errorbar(beside, mean, [mean - low, high - mean], fmt="o", capsize=2, label=classifier)
axes.axhline(25, color="0.6", ls=":", label="chance")
axes.set_xticks(places, rows.columns)
axes.set(xlabel="split", ylabel="percent correct, 95 % intervals", ylim=(0, 80))
figure.legend(loc="outside right center")
figure.savefig(picture, dpi=150)

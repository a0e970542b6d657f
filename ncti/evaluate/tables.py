"""Scores as tables of pandas and xarray, and their pictures, for notebooks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.labels import labelled_array

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes

    from ncti.evaluate.rows import Scores
    from ncti.evaluate.scores import AspectAccuracy

BIN = "aspect_bin"


def accuracy_dataset(accuracy: AspectAccuracy) -> xr.Dataset:
    """Return accuracies as a data set; leading axes are `dim_0`, `dim_1` and so on."""
    import xarray as xr

    dims = (*(f"dim_{axis}" for axis in range(accuracy.fraction.ndim - 1)), BIN)
    columns = {
        "fraction": (accuracy.fraction, "fraction of correct answers"),
        "ci_low": (accuracy.ci_low, "lower end of the 95 % interval"),
        "ci_high": (accuracy.ci_high, "upper end of the 95 % interval"),
        "n": (accuracy.n, "answers"),
    }
    return xr.Dataset(
        {
            name: labelled_array(dims, values, "1", label)
            for name, (values, label) in columns.items()
        },
        {BIN: labelled_array(BIN, np.array(accuracy.labels), "1", "aspects of the bin [deg]")},
    )


def percent_table(accuracy: AspectAccuracy) -> pd.DataFrame:
    """Return percent correct with its interval as text, one row per bin."""
    frame = accuracy.to_pandas()
    percent = [
        f"{100 * row.fraction:.0f} [{100 * row.ci_low:.0f}-{100 * row.ci_high:.0f}]"
        if row.n
        else ""
        for row in frame.itertuples()
    ]
    return frame.assign(**{"percent correct": percent})[["percent correct", "n"]]


def plot_accuracy(accuracy: AspectAccuracy, ax: Axes | None) -> Axes:
    """Draw percent correct of one classifier by aspect bin, with 95 % intervals."""
    if accuracy.fraction.ndim > 1:
        shape = accuracy.fraction.shape
        raise ValueError(f"fraction has shape {shape}, but must have bins alone to be drawn")
    ax = _axes(ax)
    percent, low, high = (
        100 * values for values in (accuracy.fraction, accuracy.ci_low, accuracy.ci_high)
    )
    ax.errorbar(accuracy.labels, percent, (percent - low, high - percent), fmt="o", capsize=3)
    ax.set(xlabel="aspect [deg]", ylabel="correct answers [%]", ylim=(0, 105))
    return ax


def confusion_table(scores: Scores) -> pd.DataFrame:
    """Return the number of answers by true class, down, and class named, across."""
    import pandas as pd

    down, across = (pd.Index(scores.classes, name=name) for name in ("true", "named"))
    return pd.DataFrame(scores.confusion, down, across)


def plot_confusion(scores: Scores, ax: Axes | None) -> Axes:
    """Draw the percentages of answers by true class and class named."""
    ax = _axes(ax)
    counts = scores.confusion
    share = 100 * counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    ax.imshow(share, vmin=0, vmax=100, cmap="Blues")
    for (row, column), value in np.ndenumerate(share):
        colour = "white" if value > 60 else "black"
        ax.text(column, row, f"{value:.0f}", ha="center", va="center", color=colour)
    ticks: NDArray[Any] = np.arange(len(scores.classes))
    ax.set_xticks(ticks, scores.classes, rotation=30)
    ax.set_yticks(ticks, scores.classes)
    ax.set(xlabel="named", ylabel="true", title="answers [%]")
    return ax


def _axes(ax: Axes | None) -> Axes:
    if ax is None:
        from matplotlib import pyplot as plt

        ax = plt.subplots(layout="constrained")[1]
    return ax

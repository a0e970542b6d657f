"""Panels of percent correct, one an aspect bin, that several pictures are made of."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from sweeps.report.rows import BIN, Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 150


def by_bin(rows: Iterable[Row], *, high: float = 3.9) -> tuple[Figure, list[Axes], list[str]]:
    """A figure so many inches high, its empty panels, and the bins that they are of."""
    from matplotlib.figure import Figure

    bins = list(dict.fromkeys(row[BIN] for row in rows))
    figure = Figure(figsize=(2.65 * len(bins) + 0.6, high), dpi=DPI, layout="constrained")
    panels: list[Axes] = list(figure.subplots(1, len(bins), sharey=True, squeeze=False)[0])
    for axes, label in zip(panels, bins, strict=True):
        title = label if label == "overall" else f"aspect {label.replace('-', '–')}°"
        axes.set_title(title, fontsize=10)
        plain_percent(axes)
    panels[0].set_ylabel("percent correct")
    return figure, panels, bins


def plain_percent(axes: Axes) -> None:
    """Lines of a percentage across, and no frame but left and below."""
    axes.set(ylim=(0.0, 104.0))
    axes.grid(axis="y", color="0.92")
    axes.spines[["right", "top"]].set_visible(False)


def with_intervals(axes: Axes, line: Mapping[Any, Row], style: str, **how: Any) -> None:
    """Percent correct against anything, with 95 % intervals, of what there is."""
    known = {x: row for x, row in sorted(line.items()) if row["percent_correct"] is not None}
    if known:
        middle = [row["percent_correct"] for row in known.values()]
        low, high = ([row[name] for row in known.values()] for name in ("ci_low", "ci_high"))
        ends = np.abs(np.subtract([low, high], middle))
        axes.errorbar(list(known), middle, ends, fmt=style, **{"capsize": 2} | how)

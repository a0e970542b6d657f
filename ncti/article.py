"""The figures of the article."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
import yaml
from numpy.typing import ArrayLike, NDArray

from ncti.evaluate import aspect_bins

SHIPS = ("duncan", "horne", "spruance", "texas")
ASPECTS = tuple(range(0, 91, 3))  # deg
BINS = ("0-27", "30-57", "60-90")  # deg


@cache
def article_figures() -> dict[str, Any]:
    """Return the content of `article.yaml`: the article's figures by its tables and figures."""
    text = files("ncti").joinpath("article.yaml").read_text(encoding="utf-8")
    return yaml.safe_load(text)


@dataclass(frozen=True)
class Figure:
    """A figure of the article's Tables 2 to 5, percent correct or a number of categories.

    `trials` is the number of views behind the percentage, 0 for categories. `frames` is the number
    of frames averaged in its tests; other figures share their first frames. It is 0 for a figure
    that shares no frames.
    """

    table: int
    name: str
    value: float
    trials: int
    frames: int = 0


def figures(aspects: ArrayLike = ASPECTS) -> tuple[Figure, ...]:
    """Return the figures of Tables 2 to 5 of the article, in the order of `figure_order`.

    Trials are views of four ships at `aspects` (aspect,) [deg], which must lie in all three bins.
    """
    labels, group = aspect_bins(aspects)
    if len(labels) != len(BINS):
        raise ValueError(f"aspects lie in {len(labels)} bins, but must lie in the article's three")
    trials = len(SHIPS) * np.bincount(group)
    article = article_figures()
    table5 = article["table5_percent_correct"]
    looks: dict[str | int, Sequence[float]] = {
        "25 km": table5["none"][25],
        "50 km, half pixels": table5["perfect"][50],
        "50 km": table5["none"][50],
    }
    entries: list[Figure] = []

    def add(table: int, rows: Mapping[str | int, Sequence[float]]) -> None:
        """Add rows of a table, each by its name or the number of frames averaged."""
        for row, values in rows.items():
            name, frames = (row, 0) if isinstance(row, str) else (f"{row} frames", row)
            entries.extend(
                Figure(table, f"{name}, {label}°", float(value), int(count), frames)
                for label, value, count in zip(BINS, values, trials, strict=True)
            )

    def scores(table: dict[str, Any]) -> dict[str | int, Sequence[float]]:
        return {"training": table["training"], **table["frames"]}

    add(2, scores(article["table2_percent_correct"]))
    entries += (
        Figure(3, f"categories, {width} ns", float(count), 0)
        for width, count in article["table3_categories"]["categories"].items()
    )
    add(4, scores(article["table4_percent_correct"]))
    add(5, looks)
    entries.append(Figure(5, "categories", float(table5["categories"]), 0))
    return tuple(entries)


def figure_order(tables: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the (figure,) numbers of simulated tables in the order of `figures`."""
    names = ("table2", "table3", "table4", "table5", "categories5")
    return np.concatenate([np.ravel(tables[name]) for name in names])

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
    """Return the figures of the article [1]_, by its tables and figures.

    Returns
    -------
    dict
        The content of `article.yaml` beside this module, not to be changed.

    See Also
    --------
    figures : Those of Tables 2 to 5 in one list.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, Tables 2 to 5.

    Examples
    --------
    >>> from ncti.article import article_figures
    >>> article_figures()["table3_categories"]["categories"]
    {10: 26, 30: 18, 50: 16}
    """
    text = files("ncti").joinpath("article.yaml").read_text(encoding="utf-8")
    figures: dict[str, Any] = yaml.safe_load(text)
    return figures


@dataclass(frozen=True)
class Figure:
    """Hold a figure of the article's Tables 2 to 5 [1]_.

    Attributes
    ----------
    table : int
        Number of its table.
    name : str
        Row and column.
    value : float
        Percent correct, or a number of categories.
    trials : int
        Views of which it is the percentage; 0 of a number of categories.
    frames : int
        Frames averaged in its tests, the first of those of other figures; 0 of one by itself.

    See Also
    --------
    figures : All of them.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, Tables 2 to 5.

    Examples
    --------
    >>> from ncti.article import Figure
    >>> Figure(3, "categories, 30 ns", 18.0, 0).value
    18.0
    """

    table: int
    name: str
    value: float
    trials: int
    frames: int = 0


def figures(aspects: ArrayLike = ASPECTS) -> tuple[Figure, ...]:
    """Return the figures of Tables 2 to 5 of the article [1]_, in the order of `in_order`.

    Parameters
    ----------
    aspects : (aspect,) array_like
        Aspects at which four ships are seen [deg], in all three bins; the article's 31.

    Returns
    -------
    tuple of Figure
        With as many trials as there are such views in a bin.

    Raises
    ------
    ValueError
        If the aspects are not within the article's three bins, or one of these has none.

    See Also
    --------
    reproduce : The same figures simulated.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, Tables 2 to 5.

    Examples
    --------
    >>> from ncti.article import figures
    >>> first = figures()[0]
    >>> first.table, first.name, first.value, first.trials
    (2, 'training, 0-27°', 100.0, 40)
    """
    labels, group = aspect_bins(aspects)
    if len(labels) != len(BINS):
        raise ValueError(f"aspects lie in {len(labels)} bins, but must lie in the article's three")
    trials = len(SHIPS) * np.bincount(group)
    article = article_figures()
    seen = article["table5_percent_correct"]
    looks: dict[str | int, Sequence[float]] = {
        "25 km": seen["none"][25],
        "50 km, half pixels": seen["perfect"][50],
        "50 km": seen["none"][50],
    }
    several: list[Figure] = []

    def add(table: int, rows: Mapping[str | int, Sequence[float]]) -> None:
        """Add rows of a table, each by its name or the number of frames averaged."""
        for row, values in rows.items():
            name, frames = (row, 0) if isinstance(row, str) else (f"{row} frames", row)
            several.extend(
                Figure(table, f"{name}, {label}°", float(value), int(count), frames)
                for label, value, count in zip(BINS, values, trials, strict=True)
            )

    def scores(table: dict[str, Any]) -> dict[str | int, Sequence[float]]:
        return {"training": table["training"], **table["frames"]}

    add(2, scores(article["table2_percent_correct"]))
    several += (
        Figure(3, f"categories, {width} ns", float(count), 0)
        for width, count in article["table3_categories"]["categories"].items()
    )
    add(4, scores(article["table4_percent_correct"]))
    add(5, looks)
    several.append(Figure(5, "categories", float(seen["categories"]), 0))
    return tuple(several)


def in_order(tables: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the numbers of simulated tables in the order of `figures`.

    Parameters
    ----------
    tables : mapping of str to ndarray
        Numbers of each table, by the names of `reproduce`.

    Returns
    -------
    (figure,) float64 ndarray
        All of them.

    See Also
    --------
    figures : The figures of the source.

    Examples
    --------
    >>> import numpy as np
    >>> from ncti.article import in_order
    >>> shapes = {"table2": (5, 3), "table3": 3, "table4": (5, 3), "table5": (3, 3)}
    >>> tables = {name: np.zeros(shape) for name, shape in shapes.items()}
    >>> in_order(tables | {"categories5": np.ones(1)}).shape
    (43,)
    """
    names = ("table2", "table3", "table4", "table5", "categories5")
    return np.concatenate([np.ravel(tables[name]) for name in names])

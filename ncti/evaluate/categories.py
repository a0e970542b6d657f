"""How categories lie over ships and aspects: which are confused, and what they save."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, eq=False)
class CategoryFormation:
    """The category of every ship and aspect.

    Attributes
    ----------
    ships : (ship,) ndarray
        Ships, sorted.
    aspects : (aspect,) float64 ndarray
        Aspects [deg], increasing.
    category : (ship, aspect) intp ndarray
        Category of the view; -1 where there is no such view or it has no category.
    confused : (ship, aspect) bool ndarray
        Whether views of another ship share the category.
    """

    ships: NDArray
    aspects: NDArray[np.float64]
    category: NDArray[np.intp]
    confused: NDArray[np.bool_]


def category_formation(
    labels: ArrayLike, ships: ArrayLike, aspects: ArrayLike
) -> CategoryFormation:
    """Lay the categories of views out over ships and aspects.

    Parameters
    ----------
    labels : (view,) array_like of int
        Category of each view; negative where it has none.
    ships : (view,) array_like
        Ship of each view.
    aspects : (view,) array_like
        Aspect of each view [deg].

    Returns
    -------
    CategoryFormation
        Categories and their confusion on the grid of ships and aspects.

    Raises
    ------
    ValueError
        When the three differ in shape, the labels are not integers, or a ship appears twice
        at one aspect.

    Notes
    -----
    The pie charts of the source's Figures 19 and 20: a ship's wedge is a run of aspects in one
    category, coloured as confused where another ship's views fall into it too.
    """
    number, ship, aspect = np.asarray(labels), np.asarray(ships), np.asarray(aspects, float)
    if not number.shape == ship.shape == aspect.shape or number.ndim != 1:
        raise ValueError(
            "labels, ships and aspects must be sequences of one length, got shapes "
            f"{number.shape}, {ship.shape} and {aspect.shape}."
        )
    if not np.issubdtype(number.dtype, np.integer):
        raise ValueError(f"labels must be integers, got {number.dtype}.")
    ship_names, row = np.unique(ship, return_inverse=True)
    aspect_values, column = np.unique(aspect, return_inverse=True)
    views = np.zeros((len(ship_names), len(aspect_values)), dtype=np.intp)
    np.add.at(views, (row, column), 1)
    if views.max(initial=0) > 1:
        twice, where = np.unravel_index(views.argmax(), views.shape)
        raise ValueError(
            "every ship must appear once at an aspect, got "
            f"{ship_names[twice]} {views.max()} times at {aspect_values[where]:g} deg."
        )
    category = np.full(views.shape, -1, dtype=np.intp)
    category[row, column] = np.maximum(number, -1)

    names, place = np.unique(category, return_inverse=True)
    holds = np.zeros((len(ship_names), len(names)), dtype=bool)
    holds[np.arange(len(ship_names))[:, None], place.reshape(category.shape)] = True
    shared = (holds.sum(axis=0) > 1) & (names >= 0)
    return CategoryFormation(
        ship_names, aspect_values, category, shared[place.reshape(category.shape)]
    )


def compression(n_vectors: int, n_categories: int) -> float:
    """Memory saved by keeping categories in place of vectors.

    Parameters
    ----------
    n_vectors, n_categories : int
        Vectors learned and categories they formed, at least one.

    Returns
    -------
    float
        Vectors a category; the source rounds 124/26, 124/18 and 124/16 to 5, 7 and 8.

    Raises
    ------
    ValueError
        When there are no categories, or more than vectors.
    """
    if not 1 <= n_categories <= n_vectors:
        raise ValueError(
            f"n_categories must lie between 1 and n_vectors = {n_vectors}, got {n_categories}."
        )
    return n_vectors / n_categories

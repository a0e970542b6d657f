"""Category formation: the categories of ships by aspect, and which of them are confused."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require_all, require_labels


@dataclass(frozen=True, eq=False)
class CategoryFormation:
    """Category of each ship and aspect, as returned by `category_formation`.

    Attributes
    ----------
    ships : (ship,) ndarray
        Ships, sorted.
    aspects : (aspect,) float64 ndarray
        Aspects [deg], increasing.
    category : (ship, aspect) intp ndarray
        Category of the view; -1 if the view is missing or has no category.
    confused : (ship, aspect) bool ndarray
        True if views of another ship share the category.

    See Also
    --------
    category_formation : The function that makes it.

    Examples
    --------
    >>> from ncti.evaluate import category_formation
    >>> formation = category_formation([0, 0, 1, 0], ["mast", "mast", "hull", "hull"], [0, 3, 0, 3])
    >>> formation.ships.tolist(), formation.aspects.tolist()
    (['hull', 'mast'], [0.0, 3.0])
    """

    ships: NDArray
    aspects: NDArray[np.float64]
    category: NDArray[np.intp]
    confused: NDArray[np.bool_]


def category_formation(
    labels: ArrayLike, ships: ArrayLike, aspects: ArrayLike
) -> CategoryFormation:
    """Return the categories of views on a grid of ships and aspects, with their confusion.

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
        If the three differ in shape, the labels are not integers, or a ship appears twice at one
        aspect.

    See Also
    --------
    ncti.classify.AdaptiveClusteringNetwork : Network whose `labels_` are such categories.

    Notes
    -----
    The pie charts of [1]_: a wedge is a run of aspects of a ship in one category, marked as
    confused if views of another ship fall into it too.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, Figures 19 and 20.

    Examples
    --------
    Two ships at three aspects. They share category 1, the first ship at 6 degrees only:

    >>> from ncti.evaluate import category_formation
    >>> ships = ["duncan"] * 3 + ["roberts"] * 3
    >>> formation = category_formation([0, 0, 1, 1, 1, 2], ships, [0, 3, 6, 0, 3, 6])
    >>> formation.category
    array([[0, 0, 1],
           [1, 1, 2]])
    >>> formation.confused
    array([[False, False,  True],
           [ True,  True, False]])
    """
    number, ship = require_labels("labels", labels), require_labels("ships", ships)
    aspect = require_all("aspects", aspects)
    if not number.shape == ship.shape == aspect.shape or number.ndim != 1:
        raise ValueError(
            f"labels, ships and aspects have shapes {number.shape}, {ship.shape} and "
            f"{aspect.shape}, but must be sequences of one length"
        )
    if not np.issubdtype(number.dtype, np.integer):
        raise ValueError(f"labels has dtype {number.dtype}, but must be integers")
    ship_names, row = np.unique(ship, return_inverse=True)
    aspect_values, column = np.unique(aspect, return_inverse=True)
    views = np.zeros((len(ship_names), len(aspect_values)), dtype=np.intp)
    np.add.at(views, (row, column), 1)
    if views.max(initial=0) > 1:
        i, j = np.unravel_index(views.argmax(), views.shape)
        raise ValueError(
            f"ships has {ship_names[i]} {views.max()} times at {aspect_values[j]:g} deg, "
            "but must have each ship at most once per aspect"
        )
    category = np.full(views.shape, -1, dtype=np.intp)
    category[row, column] = np.maximum(number, -1)

    # A category is confused if views of more than one ship fall into it.
    names, place = np.unique(category, return_inverse=True)
    holds = np.zeros((len(ship_names), len(names)), dtype=bool)
    holds[np.arange(len(ship_names))[:, None], place.reshape(category.shape)] = True
    shared = (holds.sum(axis=0) > 1) & (names >= 0)
    return CategoryFormation(
        ship_names, aspect_values, category, shared[place.reshape(category.shape)]
    )

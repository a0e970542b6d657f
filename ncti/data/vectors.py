"""Vectors, labels and groups of data sets, as classifiers take them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.features import map_vector, profile_vector

if TYPE_CHECKING:
    import xarray as xr

Vectors = tuple[NDArray[Any], NDArray[np.str_], NDArray[np.int64]]

VECTORS: dict[str, Callable[[Any], NDArray[Any]]] = {
    "profile": profile_vector,
    "silhouette": map_vector,
}

GROUP = ("ship", "aspect", "depression")
"""Coordinates in which the rows of a group agree."""


def to_numpy(rows: xr.Dataset) -> Vectors:
    """Return the vectors of rows, their ships, and groups that must not be split.

    Parameters
    ----------
    rows : xarray.Dataset
        Rows of `dataset`, or some of them.

    Returns
    -------
    X : (row, feature) ndarray
        Profile vectors, as the project's classifiers take them: the noise floor, read off the edges
        of the window, removed and the peak set to 1. For an imager, vectors of its maps; for both
        sensors, both vectors concatenated, the profile's first.
    y : (row,) str ndarray
        Names of the ships.
    groups : (row,) int64 ndarray
        Smallest view number among rows of the same ship, aspect and depression, at any range. Rows
        of a group share a view, so they must not be split between training and test.

    Raises
    ------
    ValueError
        If they are not rows of a data set, or have neither a profile nor a silhouette.

    See Also
    --------
    dataset : Makes rows.
    ncti.features.profile_vector : The vector of a profile.
    ncti.features.map_vector : The vector of a map.

    Examples
    --------
    Aspects from a list are drawn again and again, so views may be alike:

    >>> import ncti
    >>> rows = ncti.dataset(["duncan"], 5, seed=1, rows_per_view=1, aspect=[30.0, 60.0])
    >>> X, y, groups = ncti.to_numpy(rows)
    >>> rows.aspect.values.tolist()
    [30.0, 60.0, 60.0, 60.0, 30.0]
    >>> groups.tolist()
    [0, 1, 1, 1, 0]
    """
    import xarray as xr

    if not isinstance(rows, xr.Dataset):
        text = " ".join(repr(rows).split())
        raise ValueError(f"rows is {text:.60}, but must be a data set of rows")
    if lacking := [name for name in (*GROUP, "view") if name not in rows.coords]:
        raise ValueError(f"rows has no {lacking[0]}, but must be rows of a data set")
    parts = [convert(rows[name].values) for name, convert in VECTORS.items() if name in rows]
    if not parts:
        raise ValueError(
            f"rows has {', '.join(map(str, rows)) or 'nothing'}, but must have a profile or a "
            "silhouette"
        )
    X = parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)
    return X, rows.ship.values.astype(str), groups_of(rows)


def groups_of(rows: xr.Dataset) -> NDArray[np.int64]:
    """Return for each row the least view number of rows of its ship, aspect and depression."""
    codes = np.stack([np.unique(rows[name], return_inverse=True)[1] for name in GROUP])
    _, group = np.unique(codes, axis=1, return_inverse=True)
    group = group.reshape(-1)
    first_view = np.full(group.max(initial=-1) + 1, np.iinfo(np.int64).max)
    np.minimum.at(first_view, group, rows.view.values)
    return first_view[group]

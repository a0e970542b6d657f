"""Looks: the overlapping samples of an overscanned image, gathered pixel by pixel."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all, require_shape


def gather_looks(
    row: ArrayLike,
    column: ArrayLike,
    *,
    rows: ArrayLike,
    columns: int,
) -> NDArray[np.intp]:
    """Return the samples that fall into each pixel of an image.

    Parameters
    ----------
    row, column : (...) array_like
        Place of each sample in the image [pixel]; NaN for a sample without a place.
    rows : (k,) array_like
        Centres of the image's rows [pixel], ascending: `np.arange(n)` for separate pixels, or finer
        steps for pixels that overlap, as at line rate.
    columns : int
        Number of columns, centred on 0, 1, ...

    Returns
    -------
    (k, columns, look) intp ndarray
        Indices into the flattened samples by ascending row (samples of one row in their own order),
        then -1 up to the depth of the fullest pixel, which is at least 1.

    Raises
    ------
    ValueError
        If the shapes differ, the rows are not finite and ascending, or the columns are not a
        whole number of at least 1.

    See Also
    --------
    average : Mean over the looks.
    median : Median over the looks.

    Notes
    -----
    Overlapping samples of a pixel are its looks [1]_. Pixel (k, c) holds the samples with
    rows[k] - 1/2 <= row < rows[k] + 1/2 and c - 1/2 <= column < c + 1/2.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, 'Data Enhancement and Compensation'.

    Examples
    --------
    >>> gather_looks([0.0, 0.2, 1.1], [0.0, 0.1, 0.0], rows=[0, 1], columns=1)
    array([[[ 0,  1]],
    <BLANKLINE>
           [[ 2, -1]]])
    """
    row, column = np.asarray(row, dtype=np.float64), np.asarray(column, dtype=np.float64)
    require_shape("column", column, row.shape)
    centres = require_all("rows", rows)
    if centres.ndim != 1 or (np.diff(centres) < 0).any():
        raise ValueError(
            f"rows is {np.array2string(centres, threshold=6)}, but must be ascending centres"
        )
    require("columns", columns, whole=True, minimum=1)
    wide, high = int(columns), len(centres)
    # Column of each sample, and the range of rows whose windows contain it.
    place = np.searchsorted(np.arange(wide + 1) - 0.5, column.ravel(), side="right") - 1
    # A sample belongs to windows first to last - 1: begun and not yet ended.
    first = np.searchsorted(centres + 0.5, row.ravel(), side="right")
    last = np.searchsorted(centres - 0.5, row.ravel(), side="right")
    inside = (place >= 0) & (place < wide) & (first < last)
    samples = np.flatnonzero(inside)
    samples = samples[np.lexsort((row.ravel()[samples], place[samples]))]
    # Sorted by column and row, a window's samples are contiguous: counts give where each begins.
    offset = place[samples] * (high + 1)
    begin, end = (
        np.cumsum(np.bincount(offset + window[samples], minlength=wide * (high + 1)))
        .reshape(wide, high + 1)[:, :high]
        .T
        for window in (last, first)
    )
    depth = max(1, int((end - begin).max(initial=0)))
    at = begin[..., None] + np.arange(depth)
    at[at >= end[..., None]] = len(samples)
    index: NDArray[np.intp] = np.append(samples, -1)[at]
    return index


def looks_of(values: ArrayLike, index: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the looks of each pixel.

    Parameters
    ----------
    values : (...) array_like
        One value per sample, in any unit.
    index : (row, column, look) intp ndarray
        As from `gather_looks`.

    Returns
    -------
    (row, column, look) float64 ndarray
        Values in the unit given; NaN where there is no further look.

    Raises
    ------
    ValueError
        If the index points beyond the samples.

    See Also
    --------
    average : Their mean.

    Examples
    --------
    >>> looks_of([4.0, 6.0, 1.0], np.array([[[0, 1], [2, -1]]]))
    array([[[ 4.,  6.],
            [ 1., nan]]])
    """
    flat = np.asarray(values, dtype=np.float64).ravel()
    if index.max(initial=-1) >= flat.size:
        raise ValueError(
            f"index is {int(index.max())} at most, but must be below the {flat.size} values"
        )
    return np.append(flat, math.nan)[index]  # -1 is the last


def average(values: ArrayLike, index: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the mean over the looks of each pixel.

    Parameters
    ----------
    values : (...) array_like
        One value per sample, in any unit; NaN marks no look.
    index : (row, column, look) intp ndarray
        As from `gather_looks`.

    Returns
    -------
    (row, column) float64 ndarray
        Means, NaN where there is no look.

    Raises
    ------
    ValueError
        If the index points beyond the samples.

    See Also
    --------
    median : More robust against false values.

    Notes
    -----
    Frame averaging [1]_. N independent looks improve the signal-to-noise ratio, which for fully
    developed speckle is 1, by sqrt(N). Looks that share their speckle gain less, and equal ones
    gain nothing.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, 'Data Enhancement and Compensation'.

    Examples
    --------
    >>> import numpy as np
    >>> average([4.0, 6.0, 1.0], np.array([[[0, 1], [2, -1]]]))
    array([[5., 1.]])
    """
    looks = looks_of(values, index)
    valid = ~np.isnan(looks)
    count = valid.sum(axis=-1)
    total = np.where(valid, looks, 0.0).sum(axis=-1)
    return np.where(count > 0, total / np.maximum(count, 1), math.nan)


def median(values: ArrayLike, index: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the median over the looks of each pixel.

    Parameters
    ----------
    values : (...) array_like
        One value per sample, in any unit; NaN marks no look.
    index : (row, column, look) intp ndarray
        As from `gather_looks`.

    Returns
    -------
    (row, column) float64 ndarray
        Medians, the mean of the middle two of an even number; NaN where there is no look.

    Raises
    ------
    ValueError
        If the index points beyond the samples.

    See Also
    --------
    average : Mean over the looks.

    Notes
    -----
    Not in the article; a reference for `ncti.irar.clusters.histogram_cluster_average`.

    Examples
    --------
    >>> import numpy as np
    >>> median([4.0, 6.0, 90.0], np.array([[[0, 1, 2]]]))
    array([[6.]])
    """
    looks = np.sort(looks_of(values, index), axis=-1)  # NaN last
    count = np.count_nonzero(~np.isnan(looks), axis=-1)[..., None]
    low = np.take_along_axis(looks, np.maximum(count - 1, 0) // 2, axis=-1)
    high = np.take_along_axis(looks, np.minimum(count // 2, looks.shape[-1] - 1), axis=-1)
    return ((low + high) / 2)[..., 0]

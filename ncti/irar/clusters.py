"""Histogram-cluster average: one range from several looks, some of them false."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require
from ncti.irar.flight import Flight

CLUSTER = 4.0
"""Width of a cluster, in standard deviations of a range."""

_BLOCK = 4096  # pixels at a time, which fit into a processor's cache


def cluster_width(flight: Flight) -> float:
    """Return the widest cluster of ranges that one surface gives [m], at least 4 mm."""
    return CLUSTER * max(flight.range_sigma, 1e-3)


def histogram_cluster_average(ranges: ArrayLike, *, window: float) -> NDArray[np.float64]:
    """Return the mean of the most populated cluster of ranges.

    Parameters
    ----------
    ranges : (..., look) array_like
        Ranges of the looks [m], corrected for motion; NaN marks no look.
    window : float
        Widest cluster [m], such as four standard deviations of a range measurement.

    Returns
    -------
    (...) float64 ndarray
        Ranges [m], NaN where there is no look.

    Raises
    ------
    ValueError
        If a range is infinite or the window not positive.

    Notes
    -----
    The article names the filter and does not define it [1]_. Here a window of fixed width slides
    over the sorted ranges, and the window that holds the most ranges is averaged; of equally many,
    the tightest, then the nearest. Without false ranges a window of four standard deviations
    occasionally omits a true look: the error is 5 % above that of the mean at 8 looks. A false
    range counts only where it falls beside true ones. Two looks that disagree have no majority, and
    the nearer one is taken.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, 'Data Enhancement and Compensation'.

    Examples
    --------
    Three looks agree, and the fourth is a false range:

    >>> print(f"{histogram_cluster_average([4000.1, 4000.3, 3999.9, 3912.0], window=4.0):.1f} m")
    4000.1 m
    """
    require("window", window, positive=True)
    looks = np.asarray(ranges, dtype=np.float64)
    if looks.ndim == 0:
        raise ValueError("ranges is one number, but must have an axis of looks")
    if np.isinf(looks).any():
        raise ValueError("ranges holds an infinite value, but must be finite or NaN")
    if not looks.size:
        return np.full(looks.shape[:-1], np.nan)
    ordered = np.sort(looks, axis=-1).reshape(-1, looks.shape[-1])  # NaN last
    average = np.empty(len(ordered))
    for block in range(0, len(ordered), _BLOCK):
        average[block : block + _BLOCK] = _densest(ordered[block : block + _BLOCK].T, window)
    return average.reshape(looks.shape[:-1])


def _densest(looks: NDArray[np.float64], window: float) -> NDArray[np.float64]:
    """Return the mean of the densest window, (pixel,), of sorted ranges (look, pixel)."""
    looks = np.ascontiguousarray(looks)
    depth = len(looks)
    # Number of looks in the window that begins at each look, including itself.
    size = np.zeros(looks.shape, dtype=np.int32)
    for lag in range(depth):
        held = looks[lag:] - looks[: depth - lag] <= window
        if not held.any():
            break
        size[: depth - lag] += held.view(np.int8)
    # Fullest window of each pixel, and the tightest of equally full ones.
    most = size.max(axis=0)
    rank = np.arange(depth)[:, None]
    reach = np.take_along_axis(looks, np.minimum(rank + most - 1, depth - 1), axis=0) - looks
    begin = np.where(size == most, reach, np.inf).argmin(axis=0)
    inside = (rank >= begin) & (rank < begin + most)
    nearest = np.take_along_axis(looks, begin[None], axis=0)[0]
    # Mean relative to the nearest, so that equal ranges give exactly that range.
    beyond = np.where(inside, looks - nearest, 0.0).sum(axis=0)
    return np.where(most > 0, nearest + beyond / np.maximum(most, 1), np.nan)

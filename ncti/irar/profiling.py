"""Range profile of a resolved image: intensity summed into range bins."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require

RANGE_BIN = 1.0  # m; the down-range resolution of the sensor


def range_profile(
    intensity: ArrayLike,
    down_range: ArrayLike,
    *,
    start: float,
    bins: int,
    bin_width: float = RANGE_BIN,
) -> NDArray[np.float64]:
    """Intensity against range.

    Parameters
    ----------
    intensity : (...) array_like
        Intensity of each pixel in any unit.
    down_range : (...) array_like
        Range of the same pixels [m]; NaN is no return.
    start : float
        Near edge of the first bin [m].
    bins : int
        Number of bins.
    bin_width : float
        Width of a bin [m].

    Returns
    -------
    (bin,) float64 ndarray
        Summed intensity in the unit given. Bin n holds what lies in
        start + [n, n + 1) bin_width.

    Raises
    ------
    ValueError
        If the shapes differ, a pixel with a range has no intensity, or a parameter is out of
        range.

    Notes
    -----
    Article, 'Range Profiling'. All intensity with a range inside the window is counted once;
    what lies outside it is not counted. A pixel counts as a point, so that bins narrower than a
    pixel of a grazing deck is long in range show it as a comb (article, Figure 16).
    """
    power = np.asarray(intensity, dtype=np.float64)
    distance = np.asarray(down_range, dtype=np.float64)
    if power.shape != distance.shape:
        raise ValueError(
            f"down_range has shape {distance.shape}, but must have that of intensity, {power.shape}"
        )
    require("start", start)
    require("bins", bins, whole=True, minimum=1)
    require("bin_width", bin_width, positive=True)
    edges = start + bin_width * np.arange(int(bins) + 1)
    place = np.searchsorted(edges, distance.ravel(), side="right") - 1  # NaN beyond the last
    inside = (place >= 0) & (place < int(bins))
    counted = power.ravel()[inside]
    if not np.isfinite(counted).all():
        raise ValueError("intensity holds a value that is not finite where there is a range")
    return np.bincount(place[inside], weights=counted, minlength=int(bins)).astype(np.float64)

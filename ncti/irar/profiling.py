"""Range profile of a resolved image: its intensity summed by range bin."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_shape

RANGE_BIN = 1.0  # m; the down-range resolution of the sensor


def range_profile(
    intensity: ArrayLike,
    down_range: ArrayLike,
    *,
    start: float,
    bins: int,
    bin_width: float = RANGE_BIN,
) -> NDArray[np.float64]:
    """Return the intensity summed by range bin.

    Parameters
    ----------
    intensity : (...) array_like
        Intensity of each pixel in any unit.
    down_range : (...) array_like
        Range of the same pixels [m]; NaN marks no return.
    start : float
        Near edge of the first bin [m].
    bins : int
        Number of bins.
    bin_width : float
        Width of a bin [m].

    Returns
    -------
    (bin,) float64 ndarray
        Summed intensity in the unit given. Bin n covers start + [n, n + 1) bin_width.

    Raises
    ------
    ValueError
        If the shapes differ, a pixel with a range has no intensity, or a parameter is out of
        range.

    See Also
    --------
    ncti.irar.profile : Profile of a segmented snapshot.

    Notes
    -----
    Each intensity with a range inside the window is counted once [1]_. A pixel counts as a point:
    if bins are narrower than the range that a pixel spans on a grazing deck, the deck appears as a
    comb (Figure 16).

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, 'Range Profiling'.

    Examples
    --------
    >>> range_profile([1.0, 2.0, 4.0], [0.2, 1.7, 1.9], start=0.0, bins=3)
    array([1., 6., 0.])
    """
    power = np.asarray(intensity, dtype=np.float64)
    distance = np.asarray(down_range, dtype=np.float64)
    require_shape("down_range", distance, power.shape)
    require("start", start)
    require("bins", bins, whole=True, minimum=1)
    require("bin_width", bin_width, positive=True)
    edges = start + bin_width * np.arange(int(bins) + 1)
    place = np.searchsorted(edges, distance.ravel(), side="right") - 1  # NaN sorts beyond the last
    inside = (place >= 0) & (place < int(bins))
    counted = power.ravel()[inside]
    if not np.isfinite(counted).all():
        raise ValueError("intensity holds a value that is not finite where there is a range")
    return np.bincount(place[inside], weights=counted, minlength=int(bins)).astype(np.float64)

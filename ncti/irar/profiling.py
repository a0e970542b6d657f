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
    """Return the (bin,) intensity summed by range bin.

    `intensity` (...) counts once at its `down_range` (...) [m], NaN for no return; bin n covers
    `start` [m] + [n, n + 1) `bin_width` [m]. A pixel counts as a point: if bins are narrower than
    the range that a pixel spans on a grazing deck, the deck appears as a comb (Figure 16 of the
    article).
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

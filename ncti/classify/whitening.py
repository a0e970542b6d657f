"""Whitening of many vectors by a banded factor, as a compiled loop."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncti.compiled import compiled

Floats = NDArray[np.float64]

AT_ONCE = 64
"""Vectors that are solved together: what a band spans of them stays in the nearest memory."""


@compiled
def solve_band(factor: Floats, vectors: Floats) -> Floats:
    """Return L^-1 times each of some vectors, as if it were alone.

    Parameters
    ----------
    factor : (lag, bin) float64 ndarray
        Lower band of L, in contiguous memory.
    vectors : (vector, bin) float64 ndarray
        Right-hand sides, in contiguous memory.

    Returns
    -------
    (vector, bin) float64 ndarray
        By forward substitution, of several at a time: LAPACK's dtbtrs takes three times as long,
        since it solves one after the other.
    """
    lags, bins = factor.shape
    solved, some = np.empty(vectors.shape), np.zeros((bins, AT_ONCE))
    for first in range(0, len(vectors), AT_ONCE):
        count = min(AT_ONCE, len(vectors) - first)
        for v in range(count):
            for j in range(bins):
                some[j, v] = vectors[first + v, j]
        for j in range(bins):
            own = some[j]
            for v in range(AT_ONCE):
                own[v] /= factor[0, j]
            for lag in range(1, min(lags, bins - j)):
                below, share = some[j + lag], factor[lag, j]
                for v in range(AT_ONCE):
                    below[v] -= share * own[v]
        for v in range(count):
            for j in range(bins):
                solved[first + v, j] = some[j, v]
    return solved

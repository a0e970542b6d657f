"""Whitening of many vectors by a banded factor, as a compiled loop."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncti.compiled import compiled, inlined

Floats = NDArray[np.float64]

AT_ONCE = 64
"""Vectors solved together, few enough that the elements within a band stay in L1."""


@inlined
def _eliminate(factor: Floats, block: Floats, j: int) -> None:
    """Solve for element j of a (bin, vector) block, and subtract it from the elements below."""
    lags, bins = factor.shape
    row = block[j]
    for v in range(AT_ONCE):
        row[v] /= factor[0, j]
    for lag in range(1, min(lags, bins - j)):
        below, share = block[j + lag], factor[lag, j]
        for v in range(AT_ONCE):
            below[v] -= share * row[v]


@compiled
def solve_band(factor: Floats, vectors: Floats) -> Floats:
    """Return L^-1 times each of the (vector, bin) vectors, independent of the other vectors.

    `factor` (lag, bin) is the lower band of L. Forward substitution runs over blocks of vectors:
    LAPACK's dtbtrs, which solves vector by vector, takes three times as long.
    """
    bins = factor.shape[1]
    solved, block = np.empty(vectors.shape), np.zeros((bins, AT_ONCE))
    for first in range(0, len(vectors), AT_ONCE):
        count = min(AT_ONCE, len(vectors) - first)
        for v in range(count):
            for j in range(bins):
                block[j, v] = vectors[first + v, j]
        for j in range(bins):
            _eliminate(factor, block, j)
        for v in range(count):
            for j in range(bins):
                solved[first + v, j] = block[j, v]
    return solved


@compiled
def band_products(
    factor: Floats, vectors: Floats, mean: Floats, directions: Floats
) -> tuple[Floats, Floats]:
    """Return squared lengths (vector,) of whitened vectors, and their products with directions.

    It whitens `vectors` (vector, bin) to L^-1 (x - m) without storing them: `factor` (lag, bin) is
    the lower band of L, `mean` (bin,) m, and `directions` (bin, direction) are whitened. Products
    (vector, direction) of a vector do not depend on the other vectors.
    """
    bins, number = directions.shape
    squared, along = np.empty(len(vectors)), np.empty((len(vectors), number))
    block, sums = np.zeros((bins, AT_ONCE)), np.empty((number + 1, AT_ONCE))
    for first in range(0, len(vectors), AT_ONCE):
        count = min(AT_ONCE, len(vectors) - first)
        for v in range(count):
            for j in range(bins):
                block[j, v] = vectors[first + v, j] - mean[j]
        sums[:] = 0.0
        for j in range(bins):
            _eliminate(factor, block, j)
            white = block[j]
            for v in range(AT_ONCE):
                sums[number, v] += white[v] * white[v]
            for d in range(number):
                share, total = directions[j, d], sums[d]
                for v in range(AT_ONCE):
                    total[v] += share * white[v]
        for v in range(count):
            squared[first + v] = sums[number, v]
            for d in range(number):
                along[first + v, d] = sums[d, v]
    return squared, along

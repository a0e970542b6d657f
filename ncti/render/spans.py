"""First and last column of a ship in each row of an image, as compiled loops."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncti.compiled import compiled

Floats = NDArray[np.float64]

STRIP = 8
"""Rows that share their first and last column on a ship, to save time."""


@compiled
def row_spans(
    seen: Floats, faces: NDArray[np.int32], shape: tuple[int, int], margin: float
) -> NDArray[np.int64]:
    """Return (row, 2): the first column of each row that may see the ship, and one past the last.

    Arguments are as of `ncti.render.pixels.sampled_facets`, but facets count from either side.
    """
    rows, columns = shape
    strips = (rows - 1) // STRIP + 1
    reach = np.empty((strips, 2))
    reach[:, 0], reach[:, 1] = np.inf, -np.inf
    for f in range(len(faces)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay = seen[i, 0], seen[i, 1]
        bx, by = seen[j, 0], seen[j, 1]
        cx, cy = seen[k, 0], seen[k, 1]
        first, last = _strip_range(min(ay, min(by, cy)), max(ay, max(by, cy)), strips, margin)
        if first == last:  # the whole width of a facet within one strip
            reach[first, 0] = min(reach[first, 0], min(ax, min(bx, cx)) - margin)
            reach[first, 1] = max(reach[first, 1], max(ax, max(bx, cx)) + margin)
        elif first < last:
            _widen(reach, ax, ay, bx, by, margin)
            _widen(reach, bx, by, cx, cy, margin)
            _widen(reach, cx, cy, ax, ay, margin)
    span = np.zeros((rows, 2), np.int64)
    for row in range(rows):
        left, right = reach[row // STRIP]
        if left <= right:
            span[row, 0] = max(math.ceil(left), 0)
            span[row, 1] = max(min(math.floor(right) + 1, columns), span[row, 0])
    return span


@compiled
def _strip_range(low: float, high: float, strips: int, margin: float) -> tuple[int, int]:
    """Return the first and the last strip with a row between two places, or nearly."""
    first = max(math.ceil(low - margin), 0) // STRIP
    return first, min(math.floor(high + margin) // STRIP, strips - 1)


@compiled
def _widen(reach: Floats, x: float, y: float, u: float, v: float, margin: float) -> None:
    """Widen the reach of strips by a side from (x, y) to (u, v) that is moved by up to a margin."""
    left, right = min(x, u) - margin, max(x, u) + margin
    slope = (u - x) / (v - y) if abs(v - y) > 1e-9 else 0.0
    broad = abs(slope) * ((STRIP - 1) / 2 + margin) + margin if slope != 0.0 else np.inf
    first, last = _strip_range(min(y, v), max(y, v), len(reach), margin)
    for strip in range(first, last + 1):
        middle = x + (strip * STRIP + (STRIP - 1) / 2 - y) * slope
        reach[strip, 0] = min(reach[strip, 0], max(left, middle - broad))
        reach[strip, 1] = max(reach[strip, 1], min(right, middle + broad))

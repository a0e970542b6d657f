"""Unit directions of vectors, which clustering and correlation compare; depends only on numpy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NO_CATEGORY = -1
MAX_PASSES = 200  # presentations of a training set, by default

# Rounding leaves a cosine uncertain by some 1e-13. A vector that agrees with a category to this
# level joins it at any vigilance; otherwise it would found the same category in every pass.
SAME_DIRECTION = 1.0 - 1e-12

Floats = NDArray[np.float64]


def unit_vectors(vectors: Floats) -> tuple[Floats, Floats]:
    """Return unit directions and lengths of the rows; both are 0 for a zero row.

    Rows are scaled by their largest element first, so that no square over- or underflows. Lengths
    are clipped to the range of float64: near 1e308 and 1e-308 only the direction is exact.
    """
    peaks = np.abs(vectors).max(axis=1, keepdims=True)
    scaled = vectors / np.where(peaks == 0.0, 1.0, peaks)
    norms = np.sqrt(np.einsum("ij,ij->i", scaled, scaled))[:, None]
    directions = scaled / np.where(norms == 0.0, 1.0, norms)
    limits = np.finfo(np.float64)
    with np.errstate(over="ignore"):
        lengths = np.clip(peaks * norms, limits.tiny, limits.max / 2)
    return directions, np.where(peaks == 0.0, 0.0, lengths)[:, 0]

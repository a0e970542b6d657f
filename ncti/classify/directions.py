"""Directions of vectors: what clustering and correlation compare. Needs nothing but numpy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NO_CATEGORY = -1

# Rounding leaves a cosine uncertain by some 1e-13: whatever the vigilance, a vector that agrees
# with a category to this level joins it, or it would found the same category in every pass.
SAME_DIRECTION = 1.0 - 1e-12

Floats = NDArray[np.float64]


def polar(vectors: Floats) -> tuple[Floats, Floats]:
    """Unit directions and lengths of the rows; a zero row has direction and length 0.

    Rows are scaled by their largest element first, so that no square over- or underflows, and
    lengths are held off the ends of float64: at 1e308 and 1e-308 only the direction is exact.
    """
    peaks = np.abs(vectors).max(axis=1, keepdims=True)
    scaled = vectors / np.where(peaks == 0.0, 1.0, peaks)
    norms = np.sqrt(np.einsum("ij,ij->i", scaled, scaled))[:, None]
    directions = scaled / np.where(norms == 0.0, 1.0, norms)
    limits = np.finfo(np.float64)
    with np.errstate(over="ignore"):
        lengths = np.clip(peaks * norms, limits.tiny, limits.max / 2)
    return directions, np.where(peaks == 0.0, 0.0, lengths)[:, 0]

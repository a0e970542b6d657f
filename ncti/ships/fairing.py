"""Monotone cubics, which fair a hull between its stations without a bulge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class MonotoneCubic:
    """Piecewise cubic that is monotone wherever its knots are.

    It has the slopes of Fritsch and Butland (doi:10.1137/0905021), bit for bit those of SciPy's
    `PchipInterpolator`, without importing `scipy.interpolate`, which takes most of a second.
    """

    x: Floats  # (knot,)
    y: Floats  # (knot, curve)
    slopes: Floats  # (knot, curve)

    @classmethod
    def through(cls, x: ArrayLike, y: ArrayLike) -> MonotoneCubic:
        """Return the curves through at least two knots, (knot,) ascending and (knot, curve)."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        h = np.diff(x)[:, None]
        m = np.diff(y, axis=0) / h
        if len(x) == 2:
            return cls(x, y, np.repeat(m, 2, axis=0))
        slopes = np.zeros_like(y)
        w1, w2 = 2 * h[1:] + h[:-1], h[1:] + 2 * h[:-1]
        rising = m[1:] * m[:-1] > 0  # or falling, on both sides of the knot
        with np.errstate(divide="ignore", invalid="ignore"):
            harmonic = (w1 / m[:-1] + w2 / m[1:]) / (w1 + w2)
        slopes[1:-1][rising] = 1.0 / harmonic[rising]
        slopes[0] = _end_slope(h[0], h[1], m[0], m[1])
        slopes[-1] = _end_slope(h[-1], h[-2], m[-1], m[-2])
        return cls(x, y, slopes)

    def __call__(self, x: ArrayLike) -> Floats:
        """Return the curves (..., curve) at `x` between the knots."""
        x = np.asarray(x, float)
        piece = np.clip(np.searchsorted(self.x, x, side="right") - 1, 0, len(self.x) - 2)
        h, s = np.diff(self.x)[piece, None], (x - self.x[piece])[..., None]
        start, end = self.slopes[piece], self.slopes[piece + 1]
        square = s * s
        with np.errstate(over="ignore", invalid="ignore"):  # knots may nearly coincide
            mean = (self.y[piece + 1] - self.y[piece]) / h
            excess = (start + end - 2 * mean) / h
            curved = ((mean - start) / h - excess) * square
            return self.y[piece] + start * s + curved + excess / h * (square * s)


def _end_slope(h0: Floats, h1: Floats, m0: Floats, m1: Floats) -> Floats:
    """Return the slope at an end, from three knots, limited so that the curve keeps its shape."""
    slope = ((2 * h0 + h1) * m0 - h0 * m1) / (h0 + h1)
    steep = (np.sign(m0) != np.sign(m1)) & (np.abs(slope) > 3 * np.abs(m0))
    slope = np.where(steep, 3 * m0, slope)
    return np.where(np.sign(slope) != np.sign(m0), 0.0, slope)

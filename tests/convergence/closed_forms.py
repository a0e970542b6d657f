"""Closed forms of the range extents of a box and a sphere, bin by bin."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def axes_of(aspect: float, depression: float) -> Floats:
    """Return (3, 3) directions right, up and away from the sensor in the ship frame."""
    a, d = math.radians(aspect), math.radians(depression)
    return np.array(
        [
            [-math.sin(a), math.cos(a), 0.0],
            [-math.sin(d) * math.cos(a), -math.sin(d) * math.sin(a), math.cos(d)],
            [-math.cos(d) * math.cos(a), -math.cos(d) * math.sin(a), -math.sin(d)],
        ]
    )


def parallelogram(near: float, first: float, second: float, area: float, edges: Floats) -> Floats:
    """Return the area in each bin of a parallelogram whose nearest corner is at `near`.

    Its sides span `first` and `second` in range, so a uniform point lies at near + first s +
    second t with s and t uniform in [0, 1]: its distribution is the second difference of a square,
    or the first difference of a ramp if a side spans no range.
    """

    def ramp(x: Floats) -> Floats:
        return np.maximum(x, 0.0)

    x = edges - near
    if min(first, second) > 1e-9:
        corners = ramp(x) ** 2 - ramp(x - first) ** 2 - ramp(x - second) ** 2
        below = (corners + ramp(x - first - second) ** 2) / (2.0 * first * second)
    else:
        span = max(first, second)
        below = (ramp(x) - ramp(x - span)) / span if span > 1e-9 else 1.0 * (x > 0.0)
    return area * np.diff(below)


def box(
    extents: tuple[float, float, float],
    centre: tuple[float, float, float],
    *,
    aspect: float,
    depression: float,
    edges: Floats,
) -> Floats:
    """Return the visible area in each bin of a box along the ship's axes: three faces at most."""
    away = axes_of(aspect, depression)[2]
    size, middle = np.asarray(extents), float(away @ np.asarray(centre))
    span = np.abs(away) * size  # extent in range of each edge of the box
    area = np.zeros(len(edges) - 1)
    for normal in range(3):
        first, second = (normal + 1) % 3, (normal + 2) % 3
        # The face towards the sensor lies half a span nearer than the centre.
        near = middle - 0.5 * span.sum()
        visible = abs(away[normal]) * size[first] * size[second]
        area += parallelogram(near, span[first], span[second], visible, edges)
    return area


def sphere(radius: float, edges: Floats, slant_range: float = math.inf) -> Floats:
    """Return the visible area in each bin of a sphere about the ship origin, by growing discs.

    A point at angle t from the line of sight appears at radius sin t, over 1 - radius cos t / R at
    a finite range R, and has the distance sqrt(R^2 + radius^2 - 2 R radius cos t).
    """
    curvature = 1.0 / slant_range
    cosine = (radius**2 * curvature - 2.0 * edges - edges**2 * curvature) / (2.0 * radius)
    cosine = np.clip(cosine, radius * curvature, 1.0)
    disc = radius**2 * (1.0 - cosine**2) / (1.0 - radius * curvature * cosine) ** 2
    return np.diff(math.pi * disc)

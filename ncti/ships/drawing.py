"""Side view of a ship as SVG, for notebooks."""

from __future__ import annotations

import html

import numpy as np
from numpy.typing import NDArray

COLUMNS = 480  # of a drawing, in pixels

Floats = NDArray[np.float64]


def side_view(name: str, vertices: Floats, faces: NDArray[np.integer]) -> str:
    """Return the silhouette of a ship seen from starboard, bow to the right, as SVG."""
    (left, _, low), (right, _, high) = vertices.min(axis=0), vertices.max(axis=0)
    step = (right - left) / COLUMNS
    columns = left + step * (np.arange(COLUMNS) + 0.5)
    height = (high - low) / step
    path = "".join(
        f"M{column}.5 {(high - top) / step:.1f}V{(high - bottom) / step:.1f}"
        for column, spans in enumerate(spans_at(columns, vertices, faces))
        for bottom, top in spans
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{COLUMNS}" height="{height:.0f}" '
        f'viewBox="0 0 {COLUMNS} {height:.1f}" role="img"><title>{html.escape(name)}</title>'
        f'<path d="{path}" stroke="#7d94a8" stroke-width="1.1"/></svg>'
    )


def spans_at(columns: Floats, vertices: Floats, faces: NDArray[np.integer]) -> list[Floats]:
    """Return the (span, 2) heights from bottom to top that facets cover in planes of constant x."""
    corners = vertices[faces][..., [0, 2]]
    corners = np.take_along_axis(corners, corners[..., :1].argsort(axis=1), axis=1)
    (x0, z0), (x1, z1), (x2, z2) = (corners[:, k].T for k in range(3))
    spans = []
    for x in columns:
        inside = (x0 < x) & (x < x2)
        # The plane meets the longest side, and the one before or after the middle corner.
        a, b, c = x0[inside], x1[inside], x2[inside]
        long = z0[inside] + (x - a) / (c - a) * (z2 - z0)[inside]
        first = x < b
        start, end = np.where(first, a, b), np.where(first, b, c)
        bottom, top = (np.where(first, *(z[inside] for z in ends)) for ends in ((z0, z1), (z1, z2)))
        share = (x - start) / np.where(end > start, end - start, 1.0)
        short = bottom + share * (top - bottom)
        spans.append(_united(np.minimum(long, short), np.maximum(long, short)))
    return spans


def _united(low: Floats, high: Floats) -> Floats:
    """Return the union of some intervals as (span, 2) disjoint ones, in ascending order."""
    if not len(low):
        return np.empty((0, 2))
    order = low.argsort()
    low, reached = low[order], np.maximum.accumulate(high[order])
    apart = np.flatnonzero(low[1:] > reached[:-1] + 1e-9)
    return np.stack([low[np.r_[0, apart + 1]], reached[np.r_[apart, len(low) - 1]]], axis=-1)

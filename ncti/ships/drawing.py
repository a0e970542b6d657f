"""Side view of a ship as SVG, for notebooks."""

from __future__ import annotations

import html
from collections.abc import Iterable

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


def figure(name: str, vertices: Floats, faces: NDArray[np.integer], remarks: Iterable[str]) -> str:
    """Return a ship's silhouette above its measures and some remarks, as HTML."""
    caption = html.escape("; ".join((f"{name}: {measures(vertices, faces)}", *remarks)))
    picture = side_view(name, vertices, faces)
    return f"<figure>{picture}<figcaption>{caption}</figcaption></figure>"


def measures(vertices: Floats, faces: NDArray[np.integer]) -> str:
    """Return length x beam x height and the number of facets, as text."""
    length, beam, height = np.ptp(vertices, axis=0)
    return f"{length:.1f} x {beam:.1f} x {height:.1f} m, {len(faces):,} facets"


def spans_at(columns: Floats, vertices: Floats, faces: NDArray[np.integer]) -> list[Floats]:
    """Return the (span, 2) heights from bottom to top that facets cover in planes of constant x."""
    corners = vertices[faces][..., [0, 2]]
    corners = np.take_along_axis(corners, corners[..., :1].argsort(axis=1), axis=1)
    # The columns strictly inside each facet are neighbours in ascending order.
    order = columns.argsort()
    start = np.searchsorted(columns[order], corners[:, 0, 0], side="right")
    stop = np.searchsorted(columns[order], corners[:, 2, 0], side="left")
    count = np.maximum(stop - start, 0)
    # Pairs of facet and column, by column.
    facet = np.repeat(np.arange(len(faces)), count)
    place = np.arange(len(facet)) - np.repeat(count.cumsum() - count - start, count)
    column = order[place]
    facet = facet[column.argsort(kind="stable")]
    ends = np.bincount(column, minlength=len(columns)).cumsum()
    by_column = np.split(facet, ends[:-1])
    return [
        _unite_intervals(*_crossing_points(x, corners[facets]))
        for x, facets in zip(columns, by_column, strict=True)
    ]


def _crossing_points(x: float, corners: Floats) -> tuple[Floats, Floats]:
    """Return the lowest and highest points of facets, corners by x, in a plane of constant x."""
    (x0, z0), (x1, z1), (x2, z2) = (corners[:, k].T for k in range(3))
    # The plane meets the longest side, and the one before or after the middle corner.
    long = z0 + (x - x0) / (x2 - x0) * (z2 - z0)
    first = x < x1
    start, end = np.where(first, x0, x1), np.where(first, x1, x2)
    bottom, top = np.where(first, z0, z1), np.where(first, z1, z2)
    share = (x - start) / np.where(end > start, end - start, 1.0)
    short = bottom + share * (top - bottom)
    return np.minimum(long, short), np.maximum(long, short)


def _unite_intervals(low: Floats, high: Floats) -> Floats:
    """Return the union of some intervals as (span, 2) disjoint ones, in ascending order."""
    if not len(low):
        return np.empty((0, 2))
    order = low.argsort()
    low, reach = low[order], np.maximum.accumulate(high[order])
    gaps = np.flatnonzero(low[1:] > reach[:-1] + 1e-9)
    return np.stack([low[np.r_[0, gaps + 1]], reach[np.r_[gaps, len(low) - 1]]], axis=-1)

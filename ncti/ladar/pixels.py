"""Pixels of a range image, sorted into IFOVs and binned in range."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncti.render.image import RangeImage

Floats = NDArray[np.float64]

_POINT = 1e-3  # bins; a box narrower than this counts as a point
_ROUNDING = 1e-8  # pixels; slopes of 1/_POINT over hundreds of bins leave errors of some 1e-9


def places(image: RangeImage, slant_range: float) -> tuple[Floats, Floats, Floats]:
    """Return down-range, horizontal and vertical cross-range [m] of the pixels on the ship."""
    hit = np.nonzero(image.hit)
    r = image.down_range[hit]
    horizontal, vertical = image.cross_range_at(*hit)
    if image.slant_range is None:
        r = r + _sagitta(r, horizontal**2 + vertical**2, slant_range)
    return r, horizontal, vertical


def boxes(
    image: RangeImage, *, side: float, spread: float, lambertian: bool
) -> tuple[Floats, Floats]:
    """Return, for each pixel on the ship, its share of an IFOV and half its spread in range [m]."""
    slope = image.gradient[np.nonzero(image.hit)].astype(np.float64)
    area = np.full(len(slope), (image.pixel / side) ** 2)
    if lambertian:
        area /= np.sqrt(1 + slope[:, 0] ** 2 + slope[:, 1] ** 2)
    return area, spread * image.pixel * (np.abs(slope[:, 0]) + np.abs(slope[:, 1])) / 2


def _sagitta(
    r: NDArray[np.float64], cross_range_squared: NDArray[np.float64], slant_range: float
) -> NDArray[np.float64]:
    """Return the wavefront curvature sqrt((R0 + r)^2 + s^2) - (R0 + r) [m] without cancellation."""
    along = slant_range + r
    return cross_range_squared / (along + np.sqrt(along**2 + cross_range_squared))


def tile(
    horizontal: NDArray[np.float64], vertical: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.intp]]:
    """Return the occupied unit cells of the view (cell, 2), and the cell of each point (point,)."""
    column = np.floor(horizontal).astype(np.int64)
    row = np.floor(vertical).astype(np.int64)
    # Counted from the first cell of the ship, which may be far from the ship origin.
    left, bottom = (int(some.min()) if some.size else 0 for some in (column, row))
    columns = int(column.max()) - left + 1 if column.size else 1
    flat = (row - bottom) * columns + (column - left)
    seen = np.bincount(flat) > 0  # a few hundred cells: much faster than sorting the pixels
    occupied = np.flatnonzero(seen)
    cell = np.stack([occupied % columns + left, occupied // columns + bottom], axis=1)
    return cell, (np.cumsum(seen) - 1)[flat]


def bin_boxes(
    group: NDArray[np.intp],
    start: NDArray[np.float64],
    stop: NDArray[np.float64],
    area: NDArray[np.float64],
    *,
    group_count: int,
    bin_count: int,
) -> NDArray[np.float64]:
    """Return the area of uniform boxes [start, stop] in each (group, bin); bins have width 1."""
    # A box narrower than a point is widened to a point about its centre. A box that reaches beyond
    # the window is cut there and keeps its area.
    short = np.maximum(_POINT - (stop - start), 0.0) / 2
    start = np.clip(start - short, 0.0, bin_count - _POINT)
    stop = np.clip(stop + short, start + _POINT, bin_count)
    rate = area / (stop - start)
    # The area up to a bin edge is the sum of rate * (edge - start) over the ramps that have begun,
    # less that over those that have ended: slope * edge - offset, both cumulative sums.
    edges = bin_count + 1
    begun = group * edges + np.ceil(start).astype(np.int64)
    ended = group * edges + np.ceil(stop).astype(np.int64)
    at = np.concatenate([begun, ended])
    rates = np.concatenate([rate, -rate])
    offsets = rates * np.concatenate([start, stop])
    size = group_count * edges
    slopes = np.bincount(at, rates, size).reshape(group_count, edges).cumsum(axis=1)
    shifts = np.bincount(at, offsets, size).reshape(group_count, edges).cumsum(axis=1)
    binned = np.diff(slopes * np.arange(edges) - shifts, axis=1)
    # Ramps that cancel leave rounding errors, which must not count as occupied bins.
    binned[binned < _ROUNDING * area.max(initial=0.0)] = 0.0
    return binned

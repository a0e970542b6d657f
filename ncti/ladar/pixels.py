"""Pixels of a range image, sorted into IFOVs and binned in range."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncti.compiled import compiled
from ncti.render.image import RangeImage

Floats = NDArray[np.float64]
Hit = tuple[NDArray[np.intp], ...]
"""Rows and columns of the pixels on the ship."""

SUBLATTICES = 4
"""Every second row and column: four images of pixels twice as wide."""

_POINT = 1e-3  # bins; a box narrower than this counts as a point
_ROUNDING = 1e-8  # pixels; slopes of 1/_POINT over hundreds of bins leave errors of some 1e-9


def places(image: RangeImage, hit: Hit, slant_range: float) -> tuple[Floats, Floats, Floats]:
    """Return down-range, horizontal and vertical cross-range [m] of the pixels on the ship."""
    r = image.down_range[hit]
    horizontal, vertical = image.cross_range_at(*hit)
    if image.slant_range is None:  # the wavefront is curved: sqrt(along^2 + square) - along
        along, square = slant_range + r, horizontal**2 + vertical**2
        r = r + square / (along + np.sqrt(along**2 + square))
    return r, horizontal, vertical


def boxes(
    image: RangeImage, hit: Hit, *, side: float, spread: float, lambertian: bool
) -> tuple[Floats, Floats]:
    """Return, for each pixel on the ship, its share of an IFOV and half its spread in range [m]."""
    slope = image.gradient[hit].astype(np.float64)
    area = np.full(len(slope), (image.pixel / side) ** 2)
    if lambertian:
        # Slopes are per metre at the range of the ship origin; incidence needs metres at the pixel.
        near = 1.0 + image.down_range[hit] / (image.slant_range or np.inf)
        area /= np.sqrt(1 + (slope[:, 0] ** 2 + slope[:, 1] ** 2) / near**2)
    return area, spread * image.pixel * (np.abs(slope[:, 0]) + np.abs(slope[:, 1])) / 2


def tile(
    horizontal: NDArray[np.float64], vertical: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.intp]]:
    """Return the occupied unit cells of the view (cell, 2), and the cell of each point (point,)."""
    column = np.floor(horizontal).astype(np.int64)
    row = np.floor(vertical).astype(np.int64)
    # Counted from the first cell of the ship, which may be far from the ship origin.
    left, bottom = (int(index.min()) if index.size else 0 for index in (column, row))
    columns = int(column.max()) - left + 1 if column.size else 1
    flat = (row - bottom) * columns + (column - left)
    is_occupied = np.bincount(flat) > 0  # a few hundred cells: much faster than sorting the pixels
    occupied = np.flatnonzero(is_occupied)
    cell = np.stack([occupied % columns + left, occupied // columns + bottom], axis=1)
    return cell, (np.cumsum(is_occupied) - 1)[flat]


@compiled
def bin_boxes(
    group: NDArray[np.intp],
    middle: Floats,
    half: Floats,
    area: Floats,
    group_count: int,
    bin_count: int,
) -> Floats:
    """Return the area of uniform boxes, middle +- half, in each (group, bin) of bins of width 1."""
    # The area up to a bin edge is the sum of rate * (edge - start) over the ramps that have begun,
    # less the sum over ramps that have ended: slope * edge - offset, both cumulative sums.
    slope, offset = np.zeros((group_count, bin_count + 1)), np.zeros((group_count, bin_count + 1))
    largest = 0.0
    for i in range(len(group)):
        # A box narrower than a point is widened to a point about its centre. A box that reaches
        # beyond the window is cut there and keeps its area.
        reach = max(half[i], _POINT / 2)
        begin = min(max(middle[i] - reach, 0.0), bin_count - _POINT)
        end = min(max(middle[i] + reach, begin + _POINT), float(bin_count))
        rate = area[i] / (end - begin)
        # Clipped to the row, as a NaN slope would otherwise index beyond it.
        begun = min(max(int(np.ceil(begin)), 0), bin_count)
        ended = min(max(int(np.ceil(end)), 0), bin_count)
        slope[group[i], begun] += rate
        offset[group[i], begun] += rate * begin
        slope[group[i], ended] -= rate
        offset[group[i], ended] -= rate * end
        largest = max(largest, area[i])
    binned = np.empty((group_count, bin_count))
    for g in range(group_count):
        rate, start_sum, before = slope[g, 0], offset[g, 0], -offset[g, 0]
        for edge in range(1, bin_count + 1):
            rate += slope[g, edge]
            start_sum += offset[g, edge]
            total = rate * edge - start_sum
            # Ramps that cancel leave rounding errors, which must not count as occupied bins.
            binned[g, edge - 1] = 0.0 if total - before < _ROUNDING * largest else total - before
            before = total
    return binned


def strands(hit: Hit, middle: Floats, half: Floats, area: Floats, bin_count: int) -> Floats:
    """Return the area of every second row and column by bin, (4, bin), in boxes twice as long."""
    rows, columns = hit
    group = 2 * (rows & 1) + (columns & 1)
    return bin_boxes(group, middle, 2 * half, area, SUBLATTICES, bin_count)

"""Pieces of lines on a grid of square cells and range bins, as compiled loops."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncti.compiled import compiled, inlined
from ncti.render.lines import STRANDS

Floats = NDArray[np.float64]


NEGLIGIBLE_AREA = 1e-8
"""Area, in squares of the spacing, below which a cell counts as empty."""

EDGE_TOLERANCE = 1e-9
"""Distance [m] from the edge of a bin up to which a piece lies on it, and so in the bin behind,
regardless of rounding."""


class Parts(NamedTuple):
    """Area of a ship by square cell and range bin.

    `cell` (cell, 2) is column and row of the cells that see the ship, by rows; `area` (cell, bin)
    [m^2]; `strands` (16, bin) [m^2] the area of all cells by the lines 0, 16, 32 ..., by 1, 17, 33
    ..., and so on; `reach` the largest distance down-range from the ship origin, either way [m].
    """

    cell: NDArray[np.int64]
    area: Floats
    strands: Floats
    reach: float


class Grid(NamedTuple):
    """Square cells across a view.

    `turn` is cosine and sine of the roll, `side` that of a cell [m], and `shift` the position of
    the ship origin, right and up from the corner of its cell [cell].
    """

    turn: tuple[float, float]
    side: float
    shift: tuple[float, float]


class Depths(NamedTuple):
    """Parameters that turn the range along pieces into range bins.

    `curvature` is 1 / slant range of the view [1/m], 0 in the far field, with w = 1 / (1 -
    curvature q); `wavefront` is the curvature of the wavefront that defines down-range, 0 for plane
    waves; `edge` is the down-range of the first bin's edge [m], `bin_width` [m].
    """

    curvature: float
    wavefront: float
    edge: float
    bin_width: float
    bins: int


@compiled
def sagitta(r: float, square: float, wavefront: float) -> float:
    """Return sqrt((R0 + r)^2 + s^2) - (R0 + r), free of cancellation, with wavefront = 1 / R0."""
    near = 1.0 / (1.0 + wavefront * r)
    e = wavefront * wavefront * square * near * near
    if e < 1e-5:  # a series, exact to rounding, instead of a root
        return 0.5 * wavefront * square * near * (1.0 - 0.25 * e * (1.0 - 0.5 * e))
    return wavefront * square * near / (1.0 + np.sqrt(1.0 + e))


@inlined
def down_range(q: Any, x: Any, y: Any, curvature: Any, wavefront: Any) -> Any:
    """Return the down-range of a point with q = r/w at (x, y) along and across lines."""
    r = q
    if curvature > 0.0:
        r /= 1.0 - curvature * q
    if wavefront > 0.0:
        w = 1.0 + curvature * r
        r += sagitta(r, (x * x + y * y) * w * w, wavefront)
    return r


@inlined
def range_and_bin(q: Any, x: Any, y: Any, depths: Depths, bins_per_m: float) -> tuple[float, float]:
    """Return the down-range [m] of a point and its place among the bins [bin], limited to them."""
    r = down_range(q, x, y, depths.curvature, depths.wavefront)
    place = (r - (depths.edge - EDGE_TOLERANCE)) * bins_per_m
    return r, min(max(place, 0.0), depths.bins - 1e-9)


@inlined
def nearest_place(q: Any, slope: Any, y: Any, curvature: Any, wavefront: Any) -> Any:
    """Return the x of a line through q at x = 0 where a surface is nearest; inf for plane waves."""
    if wavefront == 0.0:
        return np.inf
    if curvature > 0.0:
        square = y * y * wavefront * wavefront
        return -slope * (1.0 + square) / (wavefront * (1.0 - curvature * q))
    return -slope * (1.0 + wavefront * q) / (wavefront * (1.0 + slope * slope))


@compiled
def bounds_of(
    line: NDArray[np.int32],
    piece: Floats,
    spacing: float,
    phase: float,
    turn: tuple[float, float],
    shift: tuple[float, float],
) -> tuple[float, float, float, float]:
    """Return the least and greatest column and row that pieces reach; `turn` is in [cell/m].

    Pieces of a line are in order: its first begin and its last end bound it.
    """
    cos, sin = turn
    left, right, bottom, top = np.inf, -np.inf, np.inf, -np.inf
    pieces = len(line)
    for p in range(pieces):
        y = (line[p] + phase) * spacing
        for end, neighbour in ((0, p - 1), (1, p + 1)):
            if neighbour < 0 or neighbour == pieces or line[p] != line[neighbour]:
                x = piece[p, end]
                h, v = x * cos - y * sin + shift[0], x * sin + y * cos + shift[1]
                left, right = min(left, h), max(right, h)
                bottom, top = min(bottom, v), max(top, v)
    if pieces == 0:
        return 0.0, 0.0, 0.0, 0.0
    return left, right, bottom, top


@compiled
def cells_reached(
    line: NDArray[np.int32],
    piece: Floats,
    spacing: float,
    phase: float,
    turn: tuple[float, float],
    shift: tuple[float, float],
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], int, tuple[float, float], int]:
    """Return the numbers of the cells that pieces may reach, -1 for others, which get no memory.

    Also returns the cells, by rows, in which each piece begins and ends; the number of cells; and
    the lower left corner [cell] and the number of columns of their bounding rectangle.
    """
    cos, sin = turn
    left, right, bottom, top = bounds_of(line, piece, spacing, phase, turn, shift)
    corner = np.floor(left), np.floor(bottom)
    origin = shift[0] - corner[0], shift[1] - corner[1]
    columns, rows = int(np.floor(right) - corner[0]) + 1, int(np.floor(top) - corner[1]) + 1
    pieces = len(line)
    number = np.full(rows * columns, -1, np.int32)
    first, last = np.empty(pieces, np.int32), np.empty(pieces, np.int32)
    for p in range(pieces):
        y = (line[p] + phase) * spacing
        across, up = origin[0] - y * sin, origin[1] + y * cos
        # Rounding may move an end on a border past it.
        i = min(int(piece[p, 0] * cos + across), columns - 1)
        j = min(int(piece[p, 0] * sin + up), rows - 1)
        last_i = min(int(piece[p, 1] * cos + across), columns - 1)
        last_j = min(int(piece[p, 1] * sin + up), rows - 1)
        first[p], last[p] = j * columns + i, last_j * columns + last_i
        number[first[p]] = 0
        if first[p] != last[p]:
            for row in range(min(j, last_j), max(j, last_j) + 1):
                for column in range(min(i, last_i), max(i, last_i) + 1):
                    number[row * columns + column] = 0
    cells = 0
    for c in range(rows * columns):
        if number[c] == 0:
            number[c] = cells
            cells += 1
    return number, first, last, cells, corner, columns


@compiled
def cells_seen(
    number: NDArray[np.int32], area: Floats, corner: tuple[float, float], columns: int, limit: float
) -> tuple[NDArray[np.int64], Floats]:
    """Return the cells with more than the least area, by rows, and their area by range bin.

    Rounding alone may give area to others.
    """
    count = 0
    for c in range(len(number)):
        if number[c] >= 0:
            total = 0.0
            for b in range(area.shape[1]):
                total += area[number[c], b]
            if total > limit:
                count += 1
            else:
                number[c] = -1
    cell, cell_area = np.empty((count, 2), np.int64), np.empty((count, area.shape[1]))
    n = 0
    for c in range(len(number)):
        if number[c] >= 0:
            cell[n, 0], cell[n, 1] = c % columns + int(corner[0]), c // columns + int(corner[1])
            for b in range(area.shape[1]):  # to assign a row takes numba seconds to compile
                cell_area[n, b] = area[number[c], b]
            n += 1
    return cell, cell_area


@inlined
def cell_exit(
    current: Any,
    goal: Any,
    columns: int,
    y: float,
    turn: tuple[float, float],
    origin: tuple[float, float],
) -> tuple[float, Any]:
    """Return the place where a line leaves a cell towards `goal`, and the number of the next cell.

    The line is at `y` [m] on a grid turned by a cosine and sine [cell/m], with the ship origin at
    `origin` from the lower left corner [cell].
    """
    (cos, sin), high, next_cell = turn, 0.0, goal
    i, j, last_i, last_j = current % columns, current // columns, goal % columns, goal // columns
    if i != last_i:
        side = (i + 1 if last_i > i else i) - origin[0]
        high = (side + y * sin) / cos
        next_cell = current + (1 if last_i > i else -1)
    if j != last_j:
        side = (j + 1 if last_j > j else j) - origin[1]
        upper = (side - y * cos) / sin
        if i == last_i or upper < high:
            high = upper
            next_cell = current + (columns if last_j > j else -columns)
    return high, next_cell


@inlined
def spread_over(
    area: Floats, into: Any, strands: Floats, strand: Any, share: float, before: float, after: float
) -> None:
    """Add an area evenly to the bins of a cell and a strand between two ranges [bin]."""
    near, far = min(before, after), max(before, after)
    m, n = int(near), int(far)
    if m == n:
        area[into, m] += share
        strands[strand, m] += share
    else:
        rate = share / (far - near)
        first_part, last_part = rate * (m + 1 - near), rate * (far - n)
        area[into, m] += first_part
        strands[strand, m] += first_part
        for between in range(m + 1, n):
            area[into, between] += rate
            strands[strand, between] += rate
        area[into, n] += last_part
        strands[strand, n] += last_part


@inlined
def spread_along(
    area: Floats,
    into: Any,
    strands: Floats,
    strand: Any,
    weight: float,
    start: tuple[float, float, float, float, float],
    end: tuple[float, float],
    depths: Depths,
) -> None:
    """Add a part of a line to the bins between two ranges [bin]; range is monotone along it.

    `start` has place, range [bin], r, q and the slope of q along the line at its beginning; `end`
    has place and range. Range is e at X beyond the start where p X^2 + 2 h X + c = 0, the equation
    of a sphere about the sensor.
    """
    curvature, wavefront, edge, bin_width, _ = depths
    low, before, r, q, slope = start
    high, after = end
    m, n = int(before), int(after)
    done, length = 0.0, high - low
    towards, side = (1, 1) if n > m else (-1, 0)
    while m != n:
        e = edge - EDGE_TOLERANCE + (m + side) * bin_width
        c = (r - e) * (2.0 + wavefront * (r + e))
        if curvature > 0.0:
            w, grown = 1.0 - curvature * q, (1.0 + curvature * e) ** 2 * slope
            c *= w * w
            p, h = wavefront * (1.0 - grown * slope), wavefront * low + grown * w
        else:
            p = wavefront * (1.0 + slope * slope)
            h = wavefront * low + slope * (1.0 + wavefront * q)
        root = np.sqrt(max(h * h - p * c, 0.0))
        to = min(-c / (h + towards * root), length)
        if not to > done:  # rounding, or 0 / 0 where it begins on the edge
            to = done
        area[into, m] += weight * (to - done)
        strands[strand, m] += weight * (to - done)
        done = to
        m += towards
    area[into, m] += weight * (length - done)
    strands[strand, m] += weight * (length - done)


@compiled
def bin_pieces(
    line: NDArray[np.int32],
    piece: Floats,
    weight: Floats,
    spacing: float,
    phase: float,
    grid: Grid,
    depths: Depths,
) -> tuple[NDArray[np.int64], Floats, Floats, float]:
    """Return the area that pieces cover by cell and range bin, as the fields of `Parts`.

    `line` (piece,) is the number k of each piece's line, y = (k + phase) spacing; `piece` (piece,
    4) has begin and end along it, and q = r/w there; `weight` (piece,) is the area of a metre of
    piece. Area beyond the bins counts in the first and the last.
    """
    curvature, wavefront, _, bin_width, bins = depths
    bins_per_m = 1.0 / bin_width
    turn = (grid.turn[0] / grid.side, grid.turn[1] / grid.side)
    number, first, last, cells, corner, columns = cells_reached(
        line, piece, spacing, phase, turn, grid.shift
    )
    origin = (grid.shift[0] - corner[0], grid.shift[1] - corner[1])
    area, strands = np.zeros((cells, bins)), np.zeros((STRANDS, bins))
    reach = 0.0
    # End of the previous piece: four pieces of five begin where the one before ended.
    x = y_before = q = np.nan
    before = 0.0
    for p in range(len(line)):
        y = (line[p] + phase) * spacing
        begin, end = piece[p, 0], piece[p, 1]
        current, goal = first[p], last[p]
        strand = line[p] % STRANDS
        slope = (piece[p, 3] - piece[p, 2]) / (end - begin)
        low = begin
        if not (begin == x and piece[p, 2] == q and y == y_before):
            q = piece[p, 2]
            r, before = range_and_bin(q, low, y, depths, bins_per_m)
            reach = max(reach, abs(r))
        y_before = y
        nearest = nearest_place(piece[p, 2] - slope * begin, slope, y, curvature, wavefront)
        while True:
            high, next_cell = end, goal
            if current != goal:
                high, next_cell = cell_exit(current, goal, columns, y, turn, origin)
                high = min(max(high, low), end)
            into = number[current]
            # Range falls along a line up to its nearest place, and then grows.
            x = nearest if low < nearest < high else high
            while True:
                start = (low, before, r, q, slope)
                q = piece[p, 3] if x >= end else piece[p, 2] + slope * (x - begin)
                r, after = range_and_bin(q, x, y, depths, bins_per_m)
                reach = max(reach, abs(r))
                if wavefront > 0.0:
                    spread_along(area, into, strands, strand, weight[p], start, (x, after), depths)
                else:
                    spread_over(area, into, strands, strand, (x - low) * weight[p], before, after)
                before, low = after, x
                if x == high:
                    break
                x = high
            if current == goal:
                break
            current = next_cell
    cell, cell_area = cells_seen(number, area, corner, columns, NEGLIGIBLE_AREA * spacing**2)
    return cell, cell_area, strands, reach

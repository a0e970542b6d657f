"""Facets, rays and surfaces of the pixels of a view, as compiled loops.

Most facets of a ship are smaller than a pixel or face away, and contain no pixel centre: an engine
draws the same image without them.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.compiled import compiled, inlined
from ncti.render.solid import MIN_COSINE, STEEP_COSINE

Floats = NDArray[np.float64]
Index = int | np.integer[Any]

BATCH = 256
"""Facets per batch, few enough that their corners stay in L1."""

ROWS = 4
"""Rows of a facet per test; four facets in five have no more."""

STRIP = 8
"""Rows that share their first and last column on a ship, to save time."""

COVERS, MORE_ROWS = 1, 2
"""State of a facet: it has a pixel centre in the rows tested; it has more rows."""


@compiled
def place(points: Floats, curvature: float, pixel: float, column: float, row: float) -> Floats:
    """Return (vertex, 2) positions of vertices, in pixels from the centre of pixel [0, 0].

    `points` (3, vertex) [m] are along the axes of the view; `curvature` [1/m] is the wavefront's,
    `pixel` [m] the side of a pixel, and `column`, `row` [pixel] the coordinates of the centre of
    [0, 0].
    """
    positions = np.empty((points.shape[1], 2))
    for i in range(len(positions)):
        scale = 1.0 / (pixel * (1.0 + curvature * points[2, i]))
        positions[i, 0] = points[0, i] * scale - column
        positions[i, 1] = points[1, i] * scale - row
    return positions


@compiled
def sampled_facets(positions: Floats, faces: NDArray[np.int32], margin: float) -> NDArray[np.int32]:
    """Return the facets, ascending, that face the sensor and have a pixel centre within them.

    `positions` (vertex, 2) are those of vertices [pixel], `faces` (facet, 3) counter-clockwise from
    outside, `margin` the largest distance by which an engine may move vertices along either axis
    [pixel]. Moved vertices leave a triangle within its Minkowski sum with a square: its bounding
    box, wider by `margin`, cut by its sides, each moved out by `margin` (|dx| + |dy|) in dx y - dy
    x.

    The loops of `_mark_facing` and `_mark_covering` contain only arithmetic, which compiles to
    vector instructions; the loops between them gather and select facets.
    """
    chosen = np.empty(len(faces) + 1, np.int32)
    # Typed, as numba would compile functions again for a plain 0.
    number, begin = np.int64(0), np.int64(0)
    batch, candidate = np.empty((6, BATCH)), np.empty((6, BATCH + 1))
    facet, state = np.empty(BATCH + 1, np.int32), np.empty(BATCH, np.uint8)
    for start in range(0, len(faces), BATCH):
        size = min(BATCH, len(faces) - start)
        # Gather the corners. Indices are unsigned, as numba lets signed ones count from the end.
        for e in range(size):
            f = start + e
            i, j, k = np.uint32(faces[f, 0]), np.uint32(faces[f, 1]), np.uint32(faces[f, 2])
            batch[0, e], batch[1, e] = positions[i, 0], positions[i, 1]
            batch[2, e], batch[3, e] = positions[j, 0], positions[j, 1]
            batch[4, e], batch[5, e] = positions[k, 0], positions[k, 1]
        # Keep candidates by the bounding box, without an unpredictable branch.
        _mark_facing(batch, size, margin, state)
        candidates = begin
        for e in range(size):
            facet[candidates] = start + e
            for c in range(6):
                candidate[c, candidates] = batch[c, e]
            candidates += state[e]
        # Keep candidates with a centre between their sides.
        _mark_covering(candidate, begin, candidates, 0.0, margin, state)
        for e in range(candidates):
            tested = float(ROWS)
            while state[e] == MORE_ROWS:
                _mark_covering(candidate, e, e + 1, tested, margin, state)
                tested += ROWS
            chosen[number] = facet[e]
            number += state[e] & COVERS
    return chosen[:number]


@compiled
def _mark_facing(corner: Floats, size: int, margin: float, state: NDArray[np.uint8]) -> None:
    """Set the state of facets to 1 if they may face the sensor and their bounding box has a centre.

    `corner` (6, facet) has column and row of three corners [pixel]; `state` (facet,) uint8 is the
    output.
    """
    for e in range(size):
        ax, ay, bx, by = corner[0, e], corner[1, e], corner[2, e], corner[3, e]
        cx, cy = corner[4, e], corner[5, e]
        left, right, low, high = _box(ax, ay, bx, by, cx, cy, margin)
        # Twice the area, and the most that moved vertices may add to it.
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        turned = 2.0 * margin * (right - left + high - low)
        state[e] = (area >= -turned) & (np.floor(high) >= low) & (np.floor(right) >= left)


@compiled
def _mark_covering(
    corner: Floats,
    begin: Index,
    end: Index,
    tested: float,
    margin: float,
    state: NDArray[np.uint8],
) -> None:
    """Set the state of facets to COVERS, MORE_ROWS, both or 0 by testing their next rows.

    Earlier calls have tested `tested` rows of the facets from `begin` to before `end`; see
    `_mark_facing`.
    """
    for number in range(end - begin):
        e = np.uintp(begin + number)  # unsigned, as above
        triangle = _bounds(corner, e, margin)
        low, high = triangle[0] + tested, triangle[1]
        covers = False
        for row in range(ROWS):
            covers |= _covers(triangle, low + row)
        rest = MORE_ROWS if low + ROWS <= high else 0
        state[e] = np.uint8(COVERS if covers else 0) | np.uint8(rest)


@inlined
def _box(
    ax: float, ay: float, bx: float, by: float, cx: float, cy: float, margin: float
) -> tuple[float, float, float, float]:
    """Return the bounds of a facet: left, right, below and above, a margin out."""
    return (
        min(ax, min(bx, cx)) - margin,
        max(ax, max(bx, cx)) + margin,
        min(ay, min(by, cy)) - margin,
        max(ay, max(by, cy)) + margin,
    )


@inlined
def _side(x: float, y: float, run: float, rise: float, margin: float) -> tuple[float, float, float]:
    """Return columns per row of a side moved out by a margin, and its two bounds in row 0.

    The first bounds a row on the left, the second on the right; a bound is infinite where the side
    does not bound. A rising side bounds on the right, a falling one on the left, and one along a
    row on neither.
    """
    level = abs(rise) < 1e-9
    per = 1.0 / rise
    column = x + (margin * (abs(run) + abs(rise)) - run * y) * per
    return (
        0.0 if level else run * per,
        -np.inf if (rise >= 0.0) | level else column,
        np.inf if (rise <= 0.0) | level else column,
    )


@inlined
def _bounds(corner: Floats, e: Index, margin: float) -> tuple[Any, ...]:
    """Return first and last row of a facet, left and right end of its box, and its three sides."""
    ax, ay, px, py = corner[0, e], corner[1, e], corner[2, e], corner[3, e]
    qx, qy = corner[4, e], corner[5, e]
    left, right, low, high = _box(ax, ay, px, py, qx, qy, margin)
    clockwise = (px - ax) * (qy - ay) < (py - ay) * (qx - ax)
    bx, cx = (qx if clockwise else px), (px if clockwise else qx)
    by, cy = (qy if clockwise else py), (py if clockwise else qy)
    side_a = _side(ax, ay, bx - ax, by - ay, margin)
    side_b = _side(bx, by, cx - bx, cy - by, margin)
    side_c = _side(cx, cy, ax - cx, ay - cy, margin)
    return np.ceil(low), high, left, right, side_a, side_b, side_c


@inlined
def _covers(triangle: tuple[Any, ...], row: float) -> bool:
    """Return whether a facet, as `_bounds` gives it, has a pixel centre in a row."""
    _, high, left, right, side_a, side_b, side_c = triangle
    a, b, c = side_a[0] * row, side_b[0] * row, side_c[0] * row
    first = max(max(left, side_a[1] + a), max(side_b[1] + b, side_c[1] + c))
    last = min(min(right, side_a[2] + a), min(side_b[2] + b, side_c[2] + c))
    return bool((np.floor(last) >= first) & (row <= high))


@compiled
def row_spans(
    positions: Floats, faces: NDArray[np.int32], shape: tuple[int, int], margin: float
) -> NDArray[np.int64]:
    """Return (row, 2): the first column of each row that may see the ship, and one past the last.

    Arguments are as of `sampled_facets`, but facets count from either side.
    """
    rows, columns = shape
    strips = (rows - 1) // STRIP + 1
    reach = np.empty((strips, 2))
    reach[:, 0], reach[:, 1] = np.inf, -np.inf
    for f in range(len(faces)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay = positions[i, 0], positions[i, 1]
        bx, by = positions[j, 0], positions[j, 1]
        cx, cy = positions[k, 0], positions[k, 1]
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
    """Return the first and last strip with a row between two heights, widened by a margin."""
    first = max(math.ceil(low - margin), 0) // STRIP
    return first, min(math.floor(high + margin) // STRIP, strips - 1)


@compiled
def _widen(reach: Floats, x: float, y: float, u: float, v: float, margin: float) -> None:
    """Widen the reach of strips by a side from (x, y) to (u, v) that is moved by up to a margin."""
    left, right = min(x, u) - margin, max(x, u) + margin
    slope = (u - x) / (v - y) if abs(v - y) > 1e-9 else 0.0
    half_width = abs(slope) * ((STRIP - 1) / 2 + margin) + margin if slope != 0.0 else np.inf
    first, last = _strip_range(min(y, v), max(y, v), len(reach), margin)
    for strip in range(first, last + 1):
        middle = x + (strip * STRIP + (STRIP - 1) / 2 - y) * slope
        reach[strip, 0] = min(reach[strip, 0], max(left, middle - half_width))
        reach[strip, 1] = max(reach[strip, 1], min(right, middle + half_width))


@compiled
def rays(
    span: NDArray[np.int64],
    columns: int,
    origin: tuple[float, float],
    pixel: float,
    axes: Floats,
    curvature: float,
    near: float,
    start: Floats,
) -> tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.float32]]:
    """Return flat pixel index (ray,), start and direction (ray, 3) of the rays of an image.

    `span` (row, 2) is the first column of each row, and one past the last; `origin` the coordinates
    of the centre of pixel [0, 0] along column and row [m], `pixel` [m] the side of a pixel. Rays
    start at the down-range `near` [m], the ray through the ship origin at `start` (3,) [m].
    `curvature` [1/m] is the wavefront's; in the far field all rays have one direction.
    """
    number = np.sum(span[:, 1] - span[:, 0])
    index = np.empty(number, np.int64)
    begin = np.empty((number, 3), np.float32)
    direction = np.empty((number if curvature > 0.0 else 1, 3), np.float32)
    if curvature <= 0.0:
        for axis in range(3):  # to assign a row takes numba seconds to compile
            direction[0, axis] = axes[2, axis]
    spread = 1.0 + curvature * near
    number = 0
    for row in range(len(span)):
        v = origin[1] + pixel * row
        for column in range(span[row, 0], span[row, 1]):
            h = origin[0] + pixel * column
            index[number] = row * columns + column
            for axis in range(3):
                across = h * axes[0, axis] + v * axes[1, axis]
                begin[number, axis] = spread * across + start[axis]
                if curvature > 0.0:
                    direction[number, axis] = curvature * across + axes[2, axis]
            number += 1
    return index, begin, direction


@compiled
def surface(
    facet: NDArray[np.float32] | NDArray[np.int32],
    shape: tuple[int, int],
    lattice: tuple[float, float, float],
    sight: tuple[Floats, float],
    planes: tuple[Floats, Floats, NDArray[np.int32]],
    depth: Floats,
) -> tuple[Floats, NDArray[np.float32]]:
    """Return down-range and gradient of every pixel: `ncti.render.solid.surface`, as a loop.

    `facet` (row * col,) is the facet of each pixel, below 0 for none; `lattice` has column and row
    of the first pixel's centre [pixel] and the pixel side [m]; `sight` (axes, curvature) the
    view's; `planes` normals, offsets and faces of `Solid`; `depth` (vertex,) [m] is the down-range
    of vertices.
    """
    (rows, columns), (first_column, first_row, pixel) = shape, lattice
    (axes, curvature), (normals, offsets, faces) = sight, planes
    down_range = np.empty((rows, columns))
    gradient = np.empty((rows, columns, 2), np.float32)
    for row in range(rows):
        v = (row + first_row) * pixel
        for column in range(columns):
            f = np.int64(facet[row * columns + column])
            if f < 0:
                down_range[row, column] = np.nan
                gradient[row, column, 0] = gradient[row, column, 1] = np.nan
                continue
            h = (column + first_column) * pixel
            x, y, z = normals[f, 0], normals[f, 1], normals[f, 2]
            n_h = axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z
            n_v = axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z
            n_r = axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z
            s = n_h * h + n_v * v
            a = max(-(n_r + curvature * s), MIN_COSINE)
            r = (s - offsets[f]) / a
            if a < STEEP_COSINE:
                first, second, third = depth[faces[f, 0]], depth[faces[f, 1]], depth[faces[f, 2]]
                r = min(max(r, min(first, second, third)), max(first, second, third))
            if curvature == 0.0:  # w and t are 1, which saves a fifth of the time
                down_range[row, column] = r
                slope = 1.0 / a
                gradient[row, column, 0], gradient[row, column, 1] = slope * n_h, slope * n_v
                continue
            w = 1.0 + curvature * r
            square = h * h + v * v
            t = math.sqrt(1.0 + curvature**2 * square)
            down_range[row, column] = r + curvature * w * square / (1.0 + t)
            slope, bend = t * w / a, curvature * w / t
            gradient[row, column, 0] = slope * n_h + bend * h
            gradient[row, column, 1] = slope * n_v + bend * v
    return down_range, gradient

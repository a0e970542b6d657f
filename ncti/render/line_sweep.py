"""The visible pieces of parallel lines, as compiled loops.

Lines run along the columns' axis of a view, `spacing` apart. Where a line crosses an edge between
two surfaces, one of them ends and the other begins. The sweep visits crossings in order along the
line, with a short list of the surfaces there; the sensor sees the nearest of them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncti.compiled import compiled, inlined

Floats = NDArray[np.float64]
Indices = NDArray[np.int32]
Unsigned = NDArray[np.uint32]
"""Unsigned indices, for which numba compiles no branch that counts from the end."""

DEPTH_TOLERANCE = 1e-9
"""Distance [m] by which a surface must be nearer to overtake another within a piece, so that
rounding of coincident surfaces does not."""

CROSSING = np.dtype([("t", "f8"), ("depth", "f8"), ("ends", "u4"), ("begins", "u4")])
"""Crossing of a line and an edge: the coordinate along the line, q there, and the surfaces that end
and begin there. One record, for locality in memory."""

ONE_BEGINNING = 1 << 32
"""Increment of a count of beginnings, which lies above the 32 bits of a crossing's number."""


STRIPS = 4096
"""Strips across the view into which crossings are sorted first, so that each line's are nearly in
order."""


@compiled
def project(
    vertices: Floats, axes: Floats, centre: Floats, curvature: float
) -> tuple[Floats, Floats]:
    """Return (vertex, 3) x = h/w, y = v/w and q = r/w, w = 1 + r k, and their (3, 2) bounds.

    Straight edges stay straight and flat surfaces flat in (x, y, q), at any range.
    """
    point = np.empty((len(vertices), 3))
    left = bottom = near = np.inf
    right = top = far = -np.inf
    for i in range(len(vertices)):
        a, b, c = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        h = axes[0, 0] * a + axes[0, 1] * b + axes[0, 2] * c + centre[0]
        v = axes[1, 0] * a + axes[1, 1] * b + axes[1, 2] * c + centre[1]
        r = axes[2, 0] * a + axes[2, 1] * b + axes[2, 2] * c + centre[2]
        scale = 1.0 / (1.0 + curvature * r) if curvature > 0.0 else 1.0
        x, y, q = h * scale, v * scale, r * scale
        point[i, 0], point[i, 1], point[i, 2] = x, y, q
        left, bottom, near = min(left, x), min(bottom, y), min(near, q)
        right, top, far = max(right, x), max(top, y), max(far, q)
    return point, np.array([[left, right], [bottom, top], [near, far]])


@compiled
def facing_numbers(area: Floats, moment: Floats, towards: Floats, curvature: float) -> Unsigned:
    """Return the number (surface + 1,) of each surface, or the number of surfaces if it faces away.

    The last entry stands for no surface.
    """
    none = len(area)
    number = np.full(none + 1, none, np.uint32)
    for s in range(none):
        facing = area[s, 0] * towards[0] + area[s, 1] * towards[1] + area[s, 2] * towards[2]
        number[s] = s if facing > moment[s] * curvature else none
    return number


@inlined
def rank_of(number: Any, every: Any, kept_line: Any) -> Any:
    """Return the rank of line `number` among the lines to draw, counted from a kept line.

    Every `every`-th line is kept and not drawn; 0 draws all.
    """
    if every == 0:
        return number
    turn, rest = divmod(number - kept_line, every)
    return (every - 1) * turn + max(rest - 1, 0)


@inlined
def number_of(rank: Any, every: Any, kept_line: Any) -> Any:
    """Return the number of the line of a rank, the inverse of `rank_of`."""
    if every == 0:
        return rank
    turn, rest = divmod(rank, every - 1)
    return every * turn + rest + 1 + kept_line


@compiled
def sort_by_lines(
    unsorted: NDArray[np.void],
    line: Unsigned,
    strip: Unsigned,
    strips: Unsigned,
    start: NDArray[np.int64],
) -> NDArray[np.void]:
    """Return crossings line by line, and on each line strip by strip.

    `unsorted` (crossing,) CROSSING; `line`, `strip` (crossing,) uint32 are the line and strip of
    each; `strips` (STRIPS,) uint32 counts the crossings of each strip, and is overwritten; `start`
    (line + 1,) holds increments of the number of crossings from line to line, and is overwritten
    by the first crossing of each line.
    """
    first = np.uint32(0)
    for s in range(STRIPS):
        count = strips[s]
        strips[s] = first
        first += count
    by_strip = np.empty(len(unsorted), np.uint32)
    for n in range(len(unsorted)):
        by_strip[strips[strip[n]]] = n
        strips[strip[n]] += 1
    before, crossings = np.int64(0), np.int64(0)
    for k in range(len(start)):
        crossings += start[k]
        start[k] = before
        before += crossings
    crossing, free = np.empty(len(unsorted), CROSSING), start.copy()
    for c in by_strip:
        crossing[free[line[c]]] = unsorted[c]
        free[line[c]] += 1
    return crossing


@compiled
def find_crossings(
    point: Floats,
    bounds: Floats,
    edge: Unsigned,
    facing: Unsigned,
    spacing: float,
    phase: float,
    every: np.int64,
    kept_line: np.int64,
) -> tuple[np.int64, NDArray[np.int64], NDArray[np.void]]:
    """Return crossings of lines y = (k + phase) spacing and edges of surfaces facing the sensor.

    Lines whose number k differs from `kept_line` by a multiple of `every` are left out; none if
    `every` is 0. Returns the rank of the first line, as of `rank_of`; (line + 1,) the first
    crossing of each line; and (crossing,) CROSSING, line by line and nearly in order along it, in
    which the number of surfaces stands for none.
    """
    # An edge crosses a line that separates the levels of its vertices. Levels belong to vertices,
    # not to edges, so that every surface begins on a line as often as it ends.
    lowest = rank_of(np.int64(np.ceil(bounds[1, 0] / spacing - phase)), every, kept_line)
    lines = rank_of(np.int64(np.ceil(bounds[1, 1] / spacing - phase)), every, kept_line) - lowest
    level = np.empty(len(point), np.int32)
    for i in range(len(point)):
        above = np.int64(np.ceil(point[i, 1] / spacing - phase))
        level[i] = rank_of(above, every, kept_line) - lowest

    # Select edges whose levels differ and that border a surface facing the sensor. There is no
    # branch, as the processor could not predict it.
    front = facing < len(facing) - 1  # one byte each, to stay in L1
    used = np.empty(len(edge) + 1, np.uint32)
    number, total = 0, np.int64(0)
    for e in range(len(edge)):
        used[number] = e
        crossed = abs(level[edge[e, 0]] - level[edge[e, 1]])
        counts = (crossed > 0) & (front[edge[e, 2]] | front[edge[e, 3]])
        number += counts
        total += counts * crossed

    # Compute the crossings, edge by edge.
    unsorted, line = np.empty(total, CROSSING), np.empty(total, np.uint32)
    strip, strips = np.empty(total, np.uint32), np.zeros(STRIPS, np.uint32)
    left_end = bounds[0, 0]
    narrow = STRIPS / max(bounds[0, 1] - left_end, 1e-300)
    start = np.zeros(lines + 1, np.int64)
    n = 0
    for e in used[:number]:
        i, j = edge[e, 0], edge[e, 1]
        left, right = facing[edge[e, 2]], facing[edge[e, 3]]
        if level[i] > level[j]:
            i, j, left, right = j, i, right, left
        start[level[i]] += 1
        start[level[j]] -= 1
        # Upwards, the surface left of the edge ends there.
        x, y, q = point[i, 0], point[i, 1], point[i, 2]
        run, inverse_rise, deep = point[j, 0] - x, 1.0 / (point[j, 1] - y), point[j, 2] - q
        for k in range(level[i], level[j]):
            line_y = (number_of(lowest + k, every, kept_line) + phase) * spacing
            share = min(max((line_y - y) * inverse_rise, 0.0), 1.0)
            t = x + run * share
            c = unsorted[n]
            c.t, c.depth, c.ends, c.begins = t, q + deep * share, left, right
            line[n] = k
            strip[n] = np.uint32(min(max((t - left_end) * narrow, 0.0), STRIPS - 1.0))
            strips[strip[n]] += 1
            n += 1

    return lowest, start, sort_by_lines(unsorted, line, strip, strips, start)


@inlined
def sort_crossings(crossing: NDArray[np.void]) -> None:
    """Sort the crossings of a line in place, stably.

    They are nearly sorted, so insertion sort is fast.
    """
    for m in range(1, len(crossing)):
        c = crossing[m]
        t = c.t
        if crossing[m - 1].t > t:
            depth, ends, begins = c.depth, c.ends, c.begins
            i = m
            while i > 0 and crossing[i - 1].t > t:
                crossing[i] = crossing[i - 1]
                i -= 1
            c = crossing[i]
            c.t, c.depth, c.ends, c.begins = t, depth, ends, begins


@inlined
def write_outlines(
    crossing: NDArray[np.void],
    slope: Floats,
    stop: Floats,
    opened: Unsigned,
    begun: NDArray[np.int64],
) -> None:
    """Write the end of each surface that begins on a line, and its slope in depth.

    `crossing` (crossing,) are the line's crossings, in order. It writes `slope` and `stop`
    (crossing,) of the surface that begins at each, and `opened` (crossing,), the crossing at which
    the surface that ends there began, or the number of crossings if none ends. `begun` (surface +
    1,) counts beginnings less ends, in the bits above the first crossing's number. An outline is
    closed, so a surface ends as often as it begins, and its count returns to 0. Seams within a
    merged surface may end and begin it again: only its first and last crossing count.
    """
    for m in range(len(crossing)):
        c = crossing[m]
        t, ends, begins = c.t, c.ends, c.begins
        stop[m], opened[m] = -np.inf, len(crossing)
        count = begun[ends] - ONE_BEGINNING
        if count >> 32 == 0:
            i, count = np.uint32(count - 1), 0
            stop[i], opened[m] = t, i
            first = crossing[i]
            if t > first.t:
                slope[i] = (c.depth - first.depth) / (t - first.t)
        begun[ends] = count
        count = begun[begins] + ONE_BEGINNING
        begun[begins] = count | (m + 1) if count == ONE_BEGINNING else count


class ActiveSurfaces(NamedTuple):
    """Unordered list of the surfaces at the current place on a line.

    `crossing` (most,) uint32 is the crossing at which each began, `origin`, `base`, `tilt` (most,)
    coordinate and depth there and slope along the line; `slot` (most + 1,) int32 finds a surface in
    the list by its first crossing, -1 if absent.
    """

    crossing: Unsigned
    origin: Floats
    base: Floats
    tilt: Floats
    slot: Indices


class Pieces(NamedTuple):
    """Buffers of visible pieces: line, begin, end and the depths there, and surface of each."""

    line: Indices
    piece: Floats
    surface: Indices


@inlined
def depth_of(active: ActiveSurfaces, slot: int, now: float) -> float:
    """Return the depth of a surface in the list at a coordinate."""
    return active.base[slot] + active.tilt[slot] * (now - active.origin[slot])


@inlined
def next_overtaking(
    active: ActiveSurfaces, count: int, front: int, since: float, now: float
) -> tuple[int, float]:
    """Return the first surface on a line to pass in front of the visible one, and where.

    `front` is the slot of the visible surface in the list of `count`, `since` the coordinate from
    which it is visible, `now` a coordinate at which the other is ahead. The slot is -1 if there is
    none.
    """
    visible_depth, first, place = depth_of(active, front, now), -1, now
    for i in range(count):
        ahead = visible_depth - depth_of(active, i, now)
        if ahead > DEPTH_TOLERANCE:
            closing = active.tilt[front] - active.tilt[i]
            passing = now - ahead / closing if closing > 0.0 else since
            passing = max(passing, since)
            if first < 0 or passing < place:
                first, place = i, passing
    return first, place


@inlined
def overtaking_matters(
    active: ActiveSurfaces, slot: int, front: int, nearest: float, begins: float, now: float
) -> bool:
    """Return whether the order of surfaces in depth matters at a crossing.

    Surfaces that run through one another change places between crossings. It matters if the nearest
    or a hidden one ends, or if one that begins seems to hide the nearest.
    """
    if slot == front or begins < nearest:
        return True
    return slot >= 0 and depth_of(active, slot, now) < nearest - DEPTH_TOLERANCE


@inlined
def remove_surface(active: ActiveSurfaces, slot: int, last: int) -> None:
    """Remove a surface from the list by moving the last one to its slot."""
    if slot < last:
        active.crossing[slot], active.origin[slot] = active.crossing[last], active.origin[last]
        active.base[slot], active.tilt[slot] = active.base[last], active.tilt[last]
        active.slot[active.crossing[slot]] = slot


@inlined
def insert_surface(
    active: ActiveSurfaces, slot: int, m: int, now: float, depth: float, tilt: float
) -> None:
    """Put the surface that begins at a crossing into a slot of the list."""
    active.crossing[slot], active.slot[m] = m, slot
    active.origin[slot], active.base[slot], active.tilt[slot] = now, depth, tilt


@inlined
def nearest_of(active: ActiveSurfaces, count: int, now: float) -> int:
    """Return the slot of the nearest surface at a coordinate; -1 if the list is empty."""
    front, nearest = -1, np.inf
    for s in range(count):
        depth = depth_of(active, s, now)
        if depth < nearest:
            front, nearest = s, depth
    return front


@inlined
def write_piece(
    pieces: Pieces, number: int, line: Any, began: Any, slope: float, since: float, until: float
) -> int:
    """Write the piece from `since` to `until` of the surface that began at a crossing.

    Returns the number of pieces.
    """
    pieces.line[number], pieces.surface[number] = line, began.begins
    pieces.piece[number, 0], pieces.piece[number, 1] = since, until
    pieces.piece[number, 2] = began.depth + slope * (since - began.t)
    pieces.piece[number, 3] = began.depth + slope * (until - began.t)
    return number + 1


@inlined
def sweep_line(
    crossings: NDArray[np.void],
    surfaces: int,
    outlines: tuple[Floats, Floats, Unsigned],
    active: ActiveSurfaces,
    pieces: Pieces,
    number: int,
    line: Any,
) -> int:
    """Write the visible pieces of one line, and return the total number of pieces; -1 if full.

    `crossings` (crossing,) are the line's, in order; `outlines` its slopes, ends and beginnings, as
    of `write_outlines`; `active` has room for its surfaces; `line` is the number of the line, and
    `number` the number of pieces so far.
    """
    slope, stop, opened = outlines
    # The surface that began at crossing `top` is visible from `since` on; `front` is its slot.
    count, front, top, since = 0, -1, -1, 0.0
    active.slot[len(crossings)] = -1  # for crossings at which no surface ends
    for m in range(len(crossings)):
        c = crossings[m]
        now, depth = c.t, c.depth
        fresh = c.begins < surfaces and stop[m] > now
        active.slot[m] = -1
        slot = active.slot[opened[m]]
        if slot < 0 and not fresh:
            continue
        nearest = depth_of(active, front, now) if count else np.inf
        matters = overtaking_matters(active, slot, front, nearest, depth if fresh else np.inf, now)
        while matters and count > 1:
            nearer, place = next_overtaking(active, count, front, since, now)
            if nearer < 0:
                break
            if place > since:
                if number == len(pieces.line):
                    return -1
                number = write_piece(pieces, number, line, crossings[top], slope[top], since, place)
            front, top, since = nearer, active.crossing[nearer], place
        old = top
        if slot >= 0 and fresh:  # one surface takes the place of another
            i = slot
            if slot == front or depth < depth_of(active, front, now) - DEPTH_TOLERANCE:
                front, top = slot, m
        elif slot >= 0:
            i = -1
            count -= 1
            remove_surface(active, slot, count)
            if front == slot:
                front = nearest_of(active, count, now)
                top = active.crossing[front] if front >= 0 else -1
            elif front == count:
                front = slot
        else:
            i = count
            count += 1
            if front < 0 or depth < depth_of(active, front, now):
                front, top = i, m
        if i >= 0:
            insert_surface(active, i, m, now, depth, slope[m])
        if top != old:
            if old >= 0 and now > since:
                if number == len(pieces.line):
                    return -1
                number = write_piece(pieces, number, line, crossings[old], slope[old], since, now)
            since = now
    return number


@compiled
def sweep(
    start: NDArray[np.int64],
    crossing: NDArray[np.void],
    surfaces: int,
    room: int,
    lowest: np.int64,
    every: np.int64,
    kept_line: np.int64,
) -> tuple[bool, Indices, Floats, Indices]:
    """Return whether there was room for all visible pieces of lines, and the pieces.

    `start` (line + 1,), possibly a part, `crossing`, `every` and `kept_line` are as of
    `find_crossings`; `room` is the number of pieces per crossing to allocate, `lowest` the rank of
    the first line. Pieces have their line (piece,) int32; (piece, 4), begin and end along it and q
    there; and their surface (piece,) int32.
    """
    lines = len(start) - 1
    longest = 1
    for k in range(lines):
        longest = max(longest, start[k + 1] - start[k])
    capacity = room * (start[lines] - start[0])
    line, surface = np.empty(capacity, np.int32), np.empty(capacity, np.int32)
    pieces = Pieces(line, np.empty((capacity, 4)), surface)
    # Buffers for the crossings of a line, and for its surfaces. A side seen edge-on is as steep as
    # rounding allows.
    slope, stop, opened = np.empty(longest), np.empty(longest), np.empty(longest, np.uint32)
    depths = np.empty(longest), np.empty(longest), np.empty(longest)
    active = ActiveSurfaces(np.empty(longest, np.uint32), *depths, np.empty(longest + 1, np.int32))
    begun = np.zeros(surfaces + 1, np.int64)
    outlines, number = (slope, stop, opened), 0
    for k in range(lines):
        crossings = crossing[start[k] : start[k + 1]]
        sort_crossings(crossings)
        write_outlines(crossings, slope, stop, opened, begun)
        line_number = np.int32(number_of(lowest + k, every, kept_line))
        number = sweep_line(crossings, surfaces, outlines, active, pieces, number, line_number)
        if number < 0:
            return False, line, pieces.piece, surface
    return True, line[:number], pieces.piece[:number], surface[:number]


@compiled
def merge_lines(
    line: Indices,
    piece: Floats,
    surface: Indices,
    new: tuple[Indices, Floats, Indices],
    factor: np.int32,
    kept_line: np.int32,
) -> tuple[Indices, Floats, Indices]:
    """Return the pieces of lines k, renumbered factor k + kept_line, and of new ones, by line."""
    new_line, new_piece, new_surface = new
    old, size = len(line), len(line) + len(new_line)
    lines, surfaces = np.empty(size, np.int32), np.empty(size, np.int32)
    pieces = np.empty((size, 4))
    i = j = 0
    for n in range(size):
        if j == len(new_line) or (i < old and factor * line[i] + kept_line < new_line[j]):
            lines[n], surfaces[n] = factor * line[i] + kept_line, surface[i]
            for column in range(4):
                pieces[n, column] = piece[i, column]
            i += 1
        else:
            lines[n], surfaces[n] = new_line[j], new_surface[j]
            for column in range(4):
                pieces[n, column] = new_piece[j, column]
            j += 1
    return lines, pieces, surfaces

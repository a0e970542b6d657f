"""The visible pieces of parallel lines, as compiled loops.

Lines run along the columns' axis of a view, `spacing` apart. Where a line crosses an edge between
two surfaces, one of them ends and the other begins. Crossings sorted along the line are swept with
a short list of the surfaces that the line is over; the sensor sees the nearest of them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncti.compiled import compiled, inlined

Floats = NDArray[np.float64]
Indices = NDArray[np.int32]
Places = NDArray[np.uint32]
"""Indices without sign, for which numba compiles no second case that counts from the end."""

NEARER = 1e-9
"""Distance [m] by which a surface must be nearer to overtake another within a piece: rounding of
coincident surfaces must not."""

CROSSING = np.dtype([("t", "f8"), ("depth", "f8"), ("ends", "u4"), ("begins", "u4")])
"""Crossing of a line and an edge: the coordinate along the line, q there, and the surface that ends
and that begins there. One record, so that one place in memory is touched."""

ONCE = 1 << 32
"""One beginning of a surface, counted above the 32 binary digits of a crossing's number."""


STRIPS = 4096
"""Strips across the view into which crossings are sorted first, so that those of a line come nearly
in order."""


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
def face(area: Floats, moment: Floats, towards: Floats, curvature: float) -> Places:
    """Return the number (surface + 1,) of each surface, or that of none if it faces away.

    That of none is the number of surfaces.
    """
    none = len(area)
    seen = np.full(none + 1, none, np.uint32)
    for s in range(none):
        facing = area[s, 0] * towards[0] + area[s, 1] * towards[1] + area[s, 2] * towards[2]
        seen[s] = s if facing > moment[s] * curvature else none
    return seen


@inlined
def rank_of(number: Any, every: Any, kept: Any) -> Any:
    """Return the rank of a line's number among lines to be drawn, relative to a kept line.

    Every `every`-th line is kept, and not drawn; if that is 0, all are drawn.
    """
    if every == 0:
        return number
    turn, rest = divmod(number - kept, every)
    return (every - 1) * turn + max(rest - 1, 0)


@inlined
def number_of(rank: Any, every: Any, kept: Any) -> Any:
    """Return the number of the line to be drawn that has a rank of `rank_of`."""
    if every == 0:
        return rank
    turn, rest = divmod(rank, every - 1)
    return every * turn + rest + 1 + kept


@compiled
def by_lines(
    unsorted: NDArray[np.void], of: Places, strip: Places, strips: Places, start: NDArray[np.int64]
) -> NDArray[np.void]:
    """Return crossings line by line, and on each line strip by strip.

    `unsorted` (crossing,) CROSSING; `of`, `strip` (crossing,) uint32 are the line and strip of
    each; `strips` (STRIPS,) uint32 counts the crossings of each strip, and is overwritten; `start`
    (line + 1,) has how many more crossings each line has than the one before, then where each
    begins.
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
        crossing[free[of[c]]] = unsorted[c]
        free[of[c]] += 1
    return crossing


@compiled
def cross(
    point: Floats,
    bounds: Floats,
    edge: Places,
    seen: Places,
    spacing: float,
    phase: float,
    every: np.int64,
    kept: np.int64,
) -> tuple[np.int64, NDArray[np.int64], NDArray[np.void]]:
    """Return where lines y = (k + phase) spacing cross the edges of surfaces that face the sensor.

    Lines whose number k differs from `kept` by a multiple of `every` are left out; none if that is
    0. Returns the rank of the first line, as of `rank_of`, of which the next ones follow; (line +
    1,) where each line begins among the crossings; and (crossing,) CROSSING, line by line and
    nearly in order along it, in which the number of surfaces stands for none.
    """
    # A line is crossed by an edge if it separates the levels of its vertices. Levels are of
    # vertices, not of edges: so every surface begins on a line as often as it ends.
    lowest = rank_of(np.int64(np.ceil(bounds[1, 0] / spacing - phase)), every, kept)
    lines = rank_of(np.int64(np.ceil(bounds[1, 1] / spacing - phase)), every, kept) - lowest
    level = np.empty(len(point), np.int32)
    for i in range(len(point)):
        above = np.int64(np.ceil(point[i, 1] / spacing - phase))
        level[i] = rank_of(above, every, kept) - lowest

    # Edges that count: they part levels, and a side of theirs is seen. No branch, for the
    # processor could not foresee it.
    front = seen < len(seen) - 1  # in a byte each, for the nearest memory to hold them
    used = np.empty(len(edge) + 1, np.uint32)
    number, total = 0, np.int64(0)
    for e in range(len(edge)):
        used[number] = e
        apart = abs(level[edge[e, 0]] - level[edge[e, 1]])
        counts = (apart > 0) & (front[edge[e, 2]] | front[edge[e, 3]])
        number += counts
        total += counts * apart

    # They are found edge by edge.
    unsorted, of = np.empty(total, CROSSING), np.empty(total, np.uint32)
    strip, strips = np.empty(total, np.uint32), np.zeros(STRIPS, np.uint32)
    left_end = bounds[0, 0]
    narrow = STRIPS / max(bounds[0, 1] - left_end, 1e-300)
    start = np.zeros(lines + 1, np.int64)
    n = 0
    for e in used[:number]:
        i, j = edge[e, 0], edge[e, 1]
        left, right = seen[edge[e, 2]], seen[edge[e, 3]]
        if level[i] > level[j]:
            i, j, left, right = j, i, right, left
        start[level[i]] += 1
        start[level[j]] -= 1
        # Upwards, what lies left of the edge ends there.
        x, y, q = point[i, 0], point[i, 1], point[i, 2]
        run, per_rise, deep = point[j, 0] - x, 1.0 / (point[j, 1] - y), point[j, 2] - q
        for k in range(level[i], level[j]):
            place = (number_of(lowest + k, every, kept) + phase) * spacing
            share = min(max((place - y) * per_rise, 0.0), 1.0)
            t = x + run * share
            c = unsorted[n]
            c.t, c.depth, c.ends, c.begins = t, q + deep * share, left, right
            of[n] = k
            strip[n] = np.uint32(min(max((t - left_end) * narrow, 0.0), STRIPS - 1.0))
            strips[strip[n]] += 1
            n += 1

    return lowest, start, by_lines(unsorted, of, strip, strips, start)


@inlined
def sort(crossing: NDArray[np.void]) -> None:
    """Put the crossings of a line in order; those at one place stay in theirs.

    They are nearly sorted, so insertion is quick.
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
def outline(
    crossing: NDArray[np.void],
    slope: Floats,
    stop: Floats,
    opened: Places,
    begun: NDArray[np.int64],
) -> None:
    """Write where each surface that begins on a line ends, and its slope in depth.

    `crossing` (crossing,) are those of the line, in order. Written are `slope`, `stop` (crossing,)
    of the surface that begins at each, and `opened` (crossing,), where the one that ends at it
    began; their number if none ends. `begun` (surface + 1,) counts beginnings less ends, in the
    bits above the crossing of the first. An outline is closed, so that a surface ends as often as
    it begins, and leaves no mark. Seams within a merged surface may end and begin it again: only
    its first and last crossing count.
    """
    for m in range(len(crossing)):
        c = crossing[m]
        t, ends, begins = c.t, c.ends, c.begins
        stop[m], opened[m] = -np.inf, len(crossing)
        count = begun[ends] - ONCE
        if count >> 32 == 0:
            i, count = np.uint32(count - 1), 0
            stop[i], opened[m] = t, i
            first = crossing[i]
            if t > first.t:
                slope[i] = (c.depth - first.depth) / (t - first.t)
        begun[ends] = count
        count = begun[begins] + ONCE
        begun[begins] = count | (m + 1) if count == ONCE else count


class Active(NamedTuple):
    """Surfaces that a line is over, in no order.

    `crossing` (most,) uint32 is where each began, `origin`, `base`, `tilt` (most,) coordinate and
    depth there and slope along the line; `slot` (most + 1,) int32 finds a surface in the list by
    its first crossing, -1 if absent.
    """

    crossing: Places
    origin: Floats
    base: Floats
    tilt: Floats
    slot: Indices


class Pieces(NamedTuple):
    """Room for visible pieces: line, begin, end and the depths there, and surface of each."""

    line: Indices
    piece: Floats
    seen: Indices


@inlined
def depth_of(active: Active, place: int, now: float) -> float:
    """Return how deep a surface in the list is at a coordinate."""
    return active.base[place] + active.tilt[place] * (now - active.origin[place])


@inlined
def overtaking(
    active: Active, count: int, front: int, since: float, now: float
) -> tuple[int, float]:
    """Return the first surface on a line to pass in front of the seen one, and where.

    `front` is the place of the seen surface in the list of `count`, `since` where it came to be
    seen, `now` a coordinate by which the other is ahead. The place is -1 if there is none.
    """
    seen_at, first, when = depth_of(active, front, now), -1, now
    for i in range(count):
        ahead = seen_at - depth_of(active, i, now)
        if ahead > NEARER:
            closing = active.tilt[front] - active.tilt[i]
            passing = now - ahead / closing if closing > 0.0 else since
            passing = max(passing, since)
            if first < 0 or passing < when:
                first, when = i, passing
    return first, when


@inlined
def overtaking_matters(
    active: Active, slot: int, front: int, nearest: float, begins: float, now: float
) -> bool:
    """Return whether the order of surfaces in depth matters at a crossing.

    Surfaces that run through one another change places between crossings. It matters if the nearest
    or a hidden one ends, or if one that begins seems to hide the nearest.
    """
    if slot == front or begins < nearest:
        return True
    return slot >= 0 and depth_of(active, slot, now) < nearest - NEARER


@inlined
def take_out(active: Active, slot: int, last: int) -> None:
    """Take a surface out of the list: the last one takes its place."""
    if slot < last:
        active.crossing[slot], active.origin[slot] = active.crossing[last], active.origin[last]
        active.base[slot], active.tilt[slot] = active.base[last], active.tilt[last]
        active.slot[active.crossing[slot]] = slot


@inlined
def put(active: Active, slot: int, m: int, now: float, depth: float, tilt: float) -> None:
    """Put the surface that begins at a crossing into a place of the list."""
    active.crossing[slot], active.slot[m] = m, slot
    active.origin[slot], active.base[slot], active.tilt[slot] = now, depth, tilt


@inlined
def nearest_of(active: Active, count: int, now: float) -> int:
    """Return the place in the list of the surface nearest at a coordinate; -1 of none."""
    front, nearest = -1, np.inf
    for s in range(count):
        depth = depth_of(active, s, now)
        if depth < nearest:
            front, nearest = s, depth
    return front


@inlined
def write(
    pieces: Pieces, number: int, own: Any, began: Any, slope: float, since: float, until: float
) -> int:
    """Write the piece from `since` to `until` of the surface that began at a crossing.

    Returns the number of pieces.
    """
    pieces.line[number], pieces.seen[number] = own, began.begins
    pieces.piece[number, 0], pieces.piece[number, 1] = since, until
    pieces.piece[number, 2] = began.depth + slope * (since - began.t)
    pieces.piece[number, 3] = began.depth + slope * (until - began.t)
    return number + 1


@inlined
def sweep_line(
    some: NDArray[np.void],
    surfaces: int,
    outlines: tuple[Floats, Floats, Places],
    active: Active,
    pieces: Pieces,
    number: int,
    own: Any,
) -> int:
    """Write the visible pieces of one line, and return the number of all; -1 without room.

    `some` (crossing,) are its crossings, in order; `outlines` its slopes, ends and beginnings, as
    of `outline`; `active` has room for the surfaces below; `own` is the number of the line, and
    `number` that of the pieces so far.
    """
    slope, stop, opened = outlines
    # `shown` began what is seen, from `since` on; it is at `front` in the list.
    count, front, shown, since = 0, -1, -1, 0.0
    active.slot[len(some)] = -1  # of what ends nothing
    for m in range(len(some)):
        c = some[m]
        now, depth = c.t, c.depth
        fresh = c.begins < surfaces and stop[m] > now
        active.slot[m] = -1
        slot = active.slot[opened[m]]
        if slot < 0 and not fresh:
            continue
        nearest = depth_of(active, front, now) if count else np.inf
        matters = overtaking_matters(active, slot, front, nearest, depth if fresh else np.inf, now)
        while matters and count > 1:
            nearer, when = overtaking(active, count, front, since, now)
            if nearer < 0:
                break
            if when > since:
                if number == len(pieces.line):
                    return -1
                number = write(pieces, number, own, some[shown], slope[shown], since, when)
            front, shown, since = nearer, active.crossing[nearer], when
        old = shown
        if slot >= 0 and fresh:  # one surface takes the place of another
            i = slot
            if slot == front or depth < depth_of(active, front, now) - NEARER:
                front, shown = slot, m
        elif slot >= 0:
            i = -1
            count -= 1
            take_out(active, slot, count)
            if front == slot:
                front = nearest_of(active, count, now)
                shown = active.crossing[front] if front >= 0 else -1
            elif front == count:
                front = slot
        else:
            i = count
            count += 1
            if front < 0 or depth < depth_of(active, front, now):
                front, shown = i, m
        if i >= 0:
            put(active, i, m, now, depth, slope[m])
        if shown != old:
            if old >= 0 and now > since:
                if number == len(pieces.line):
                    return -1
                number = write(pieces, number, own, some[old], slope[old], since, now)
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
    kept: np.int64,
) -> tuple[bool, Indices, Floats, Indices]:
    """Return the visible pieces of lines, and before them whether there was room for all.

    `start` (line + 1,), possibly a part, and `crossing` are as of `cross`, as are `every` and
    `kept`; `room` is the number of pieces a crossing to allow for, `lowest` the rank of the first
    line. Pieces have their line (piece,) int32; (piece, 4), begin and end along it and q there; and
    their surface (piece,) int32.
    """
    lines = len(start) - 1
    most = 1
    for k in range(lines):
        most = max(most, start[k + 1] - start[k])
    capacity = room * (start[lines] - start[0])
    line, seen = np.empty(capacity, np.int32), np.empty(capacity, np.int32)
    pieces = Pieces(line, np.empty((capacity, 4)), seen)
    # Of the crossings of a line, and of the surfaces that it is over. A side seen edge-on is as
    # steep as rounding allows.
    slope, stop, opened = np.empty(most), np.empty(most), np.empty(most, np.uint32)
    depths = np.empty(most), np.empty(most), np.empty(most)
    active = Active(np.empty(most, np.uint32), *depths, np.empty(most + 1, np.int32))
    begun = np.zeros(surfaces + 1, np.int64)
    outlines, number = (slope, stop, opened), 0
    for k in range(lines):
        some = crossing[start[k] : start[k + 1]]
        sort(some)
        outline(some, slope, stop, opened, begun)
        own = np.int32(number_of(lowest + k, every, kept))
        number = sweep_line(some, surfaces, outlines, active, pieces, number, own)
        if number < 0:
            return False, line, pieces.piece, seen
    return True, line[:number], pieces.piece[:number], seen[:number]


@compiled
def merge(
    line: Indices,
    piece: Floats,
    seen: Indices,
    more: tuple[Indices, Floats, Indices],
    factor: np.int32,
    kept: np.int32,
) -> tuple[Indices, Floats, Indices]:
    """Return the pieces of lines, numbered factor k + kept now, and of those between, by line."""
    new_line, new_piece, new_seen = more
    old, size = len(line), len(line) + len(new_line)
    lines, all_seen = np.empty(size, np.int32), np.empty(size, np.int32)
    pieces = np.empty((size, 4))
    i = j = 0
    for n in range(size):
        if j == len(new_line) or (i < old and factor * line[i] + kept < new_line[j]):
            lines[n], all_seen[n] = factor * line[i] + kept, seen[i]
            for part in range(4):
                pieces[n, part] = piece[i, part]
            i += 1
        else:
            lines[n], all_seen[n] = new_line[j], new_seen[j]
            for part in range(4):
                pieces[n, part] = new_piece[j, part]
            j += 1
    return lines, pieces, all_seen

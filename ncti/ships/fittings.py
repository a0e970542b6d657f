"""Fittings that follow the deck edge, a path, or the face of a deckhouse."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from manifold3d import Manifold

from ncti.ships.hull import Hull
from ncti.ships.lofting import Points, loft, tube, union

# Heights of the bars, radii of posts and bars [m], and sides of the bars: life-lines are 40 mm
# stanchions and three 15 mm wires; a safety net, raised on its frames, is 10 to 20 % solid.
FENCES = {
    "rail": ((0.33, 0.66, 0.98), 0.028, 0.01, 3),
    "net": ((0.1, 0.4, 0.7, 0.98), 0.05, 0.03, 4),
}


def edge_path(hull: Hull, edge: tuple[float, float], *, inset: float, pitch: float) -> Points:
    """(n, 3) path of points `pitch` [m] apart, `inset` [m] inboard of the starboard deck edge."""
    start, end = edge
    x = np.linspace(start, end, 1 + max(1, round((end - start) / pitch)))
    half, deck = hull.deck_edge(x)
    return np.column_stack([x, half - inset, deck])


def _stretch(path: Points, pitch: float) -> Points:
    """Return nodes along a path about `pitch` apart, including its corners."""
    nodes = [path[:1]]
    for before, after in pairwise(path):
        count = max(1, round(float(np.linalg.norm(after - before)) / pitch))
        nodes.append(before + np.linspace(0, 1, count + 1)[1:, None] * (after - before))
    return np.concatenate(nodes)


def fence(kind: str, *, path: Points, height: float, pitch: float) -> Manifold:
    """Return a "rail" or a "net" of `FENCES` along a path."""
    levels, post, bar, sides = FENCES[kind]
    nodes = _stretch(path, pitch)
    up = np.array([0.0, 0.0, 1.0])
    posts = [tube([node - 0.2 * up, node + height * up], post, sides=4) for node in nodes]
    bars = [tube(nodes + level * height * up, bar, sides=sides) for level in levels]
    return union(posts + bars)


def bulwark(
    hull: Hull,
    *,
    edge: tuple[float, float],
    end: float,
    stem_top: float,
    aft_top: float,
    width: float,
    flare: float,
) -> Manifold:
    """Return plating above the deck edge of the bow, both sides.

    Its top falls from `stem_top` to `aft_top` [m] over the stretch `edge`, then to the deck at
    `end`. It leans outward by `flare` [deg], less and less towards the stem where both sides meet.
    """
    start, knuckle = edge
    x = np.unique(np.concatenate([np.arange(start, end, 0.5), [knuckle, end - 0.05]]))
    half, deck = hull.deck_edge(x)
    top = np.interp(x, [start, knuckle], [stem_top, aft_top])
    after = x > knuckle
    share = (end - x[after]) / (end - knuckle)
    top[after] = deck[after] + share * (aft_top - deck[after])
    top = np.maximum(top, deck + 0.05)
    lean = (top - deck) * np.tan(np.radians(flare)) * np.clip(x / 8.0, 0, 1)
    outer = np.stack([half, half + lean], -1)
    y = np.column_stack([outer, outer[:, ::-1] - width])
    z = np.column_stack([deck - 0.2, top, top, deck - 0.2])
    side = loft(np.stack([np.broadcast_to(x[:, None], y.shape), y, z], -1))
    return side + side.mirror((0, 1, 0))


def windows(
    plan: tuple[Points, Points],
    house_height: float,
    *,
    sill: float,
    height: float,
    width: float,
    pitch: float,
    depth: float,
) -> Manifold:
    """Return the volume to cut for panes in the front and sides of a house, sills at z = 0.

    `plan` is the bottom and top polygon (n, 2) of the house [m], of `solids.house_plan`; `sill` [m]
    is above its foot; `height`, `width`, `pitch` and `depth` [m] are of the panes.
    """
    bottom, top = plan
    panes = []
    levels = np.array([sill, sill + height]) / house_height
    outline = [bottom + level * (top - bottom) for level in levels]
    for corner in range(len(bottom)):
        ends = np.array([[p[corner], np.roll(p, -1, axis=0)[corner]] for p in outline])
        run = ends[0, 1] - ends[0, 0]
        length = np.hypot(*run)
        outward = np.array([run[1], -run[0]]) / length  # the polygon turns from x to y
        if outward[0] > 0.1 or length < pitch:
            continue
        count = int(length / pitch)
        for k in range(count):
            middle = (k + 0.5) / count
            share = middle + np.array([-0.5, 0.5]) * width / length
            face = ends[:, :1] + share[None, :, None] * (ends[:, 1:] - ends[:, :1])
            panes.append(_pane(face, outward, height, depth))
    return union(panes)


def _pane(face: Points, outward: Points, height: float, depth: float) -> Manifold:
    """Return a slab from `depth` inside a face, (bottom/top, left/right, 2), to 0.1 m outside."""
    rings = []
    for reach in (-depth, 0.1):
        (left, right), (top_left, top_right) = face + reach * outward
        rings.append([(*left, 0), (*right, 0), (*top_right, height), (*top_left, height)])
    return loft(rings)

"""Temperature of the scene and detector noise by frame count."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require, require_all, require_generator

# Number of frames whose sum the generator itself draws first: as many as the article averages.
ANCHOR_FRAMES = 16
# Border around the ship that is drawn with it [pixel]. A super-resolved pixel depends on its
# neighbours up to one pixel away, so the size of the window changes nothing on the ship.
BORDER = 4


def draw_scene(
    target: NDArray[np.bool_],
    *,
    contrast: float,
    frame_counts: Sequence[int] | NDArray[np.integer],
    rng: np.random.Generator,
    nedt: float,
    target_spread: float,
    sea_spread: float,
    rim: int = 0,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Draw the scene and the detector noise of averages of frames [K].

    For a (row, col) `target` with `rim` pixels of sea around it, it returns the scene (row + 2 rim,
    col + 2 rim) above the mean sea, the same in every frame, and the noise (frame_count, row + 2
    rim, col + 2 rim) of each of `frame_counts`. `contrast`, `nedt` (of one frame), `target_spread`
    and `sea_spread` [K].

    Every pixel has a Gaussian temperature of ship or sea, by the template, so one normal per
    pixel is enough. The article's deviations (Appendix 2) contain the noise of the 16-frame
    average; here noise and spread are separate, because only the noise falls with the number of
    frames.

    Averages are over prefixes of the same frames, so the sum W(N) of N frames is a random walk with
    Cov(W(M), W(N)) = nedt^2 min(M, N). It is drawn as such, at a cost that grows with the logarithm
    of N. The draw for one frame count depends neither on the other counts nor on their order: the
    generator draws two normals per pixel, for the scene and for W(16), for any counts, and every
    other count that the walk visits has a generator seeded by a child of a seed sequence that each
    call spawns from the one of `rng`. Equal results thus need generators with equal spawn counts.
    From W(16) the walk doubles, W(32), W(64), ...; between those, and below 16, Levy's construction
    of a Brownian bridge draws the sum in the middle of an interval from the sums at its ends, until
    it reaches a count.

    Order of the draws: the ship's bounding box with a border of `BORDER` pixels, whether or not the
    window holds them; the rest of the window; the rest of the rim. In each of them, row by row, the
    generator draws first the scene and then W(16); the others draw one sum each, in the same order.
    A larger window therefore changes no bit on the ship, and a rim none in the window.
    """
    require_generator("rng", rng)
    target = np.asarray(target, dtype=bool)
    if target.ndim != 2:
        raise ValueError(f"target has {target.ndim} axes, but must have a row and a column axis")
    require("contrast", contrast)
    require("nedt", nedt, minimum=0.0)
    require("target_spread", target_spread, minimum=0.0)
    require("sea_spread", sea_spread, minimum=0.0)
    counts = require_all("frame_counts", frame_counts, whole=True, minimum=1.0)
    if not counts.size:
        raise ValueError("frame_counts is empty, but must hold at least one number")
    numbers = [int(count) for count in counts.ravel()]

    # Temperature of the scene: its spread, and the contrast on the ship.
    node = _nodes(target, rim, rng)
    scene, anchor = _draw_normals(target, 2, rim, rng)
    if target_spread == sea_spread:
        scene *= sea_spread
    else:
        scene *= np.where(np.pad(target, rim), target_spread, sea_spread)
    rows, cols = target.shape
    inside = scene[rim : rim + rows, rim : rim + cols]
    np.add(inside, contrast, out=inside, where=target)
    # Detector noise: sums of frames along one random walk, divided by their number.
    anchor *= math.sqrt(ANCHOR_FRAMES)
    walk = dict(_draw_walk(anchor, sorted(set(numbers)), node))
    noise = np.empty((len(numbers), *anchor.shape))
    for count, average in zip(numbers, noise, strict=True):
        np.multiply(walk[count], nedt / count, out=average)
    return scene, noise


Field = NDArray[np.float64]
Box = tuple[int, int, int, int]  # first row, one past the last, first column, one past the last
Node = Callable[[int], Field]


def _draw_walk(anchor: Field, counts: list[int], node: Node) -> Iterator[tuple[int, Field]]:
    """Yield sums of unit normals at ascending counts, given the anchor; see `draw_scene`."""
    first, start = 0, np.zeros_like(anchor)
    last, end = ANCHOR_FRAMES, anchor
    while True:
        yield from _draw_sums_between((first, start), (last, end), counts, node)
        if last in counts:
            yield last, end
        if last >= counts[-1]:
            return
        first, start = last, end
        last *= 2
        end = start + math.sqrt(last - first) * node(last)


def _draw_sums_between(
    before: tuple[int, Field], after: tuple[int, Field], counts: list[int], node: Node
) -> Iterator[tuple[int, Field]]:
    """Yield the sums at the counts between two counts with known sums."""
    (first, start), (last, end) = before, after
    inside = counts[bisect_right(counts, first) : bisect_left(counts, last)]
    if not inside:
        return
    middle = (first + last) // 2
    left, right = middle - first, last - middle
    # Given both ends, the middle is normal about the chord.
    total = (right / (last - first)) * start + (left / (last - first)) * end
    total += math.sqrt(left * right / (last - first)) * node(middle)
    yield from _draw_sums_between(before, (middle, total), inside, node)
    if middle in inside:
        yield middle, total
    yield from _draw_sums_between((middle, total), after, inside, node)


def _nodes(target: NDArray[np.bool_], rim: int, rng: np.random.Generator) -> Node:
    """Return a function that draws the normals of each count from its own stream."""
    sequence = getattr(rng.bit_generator, "seed_seq", None)
    if not isinstance(sequence, np.random.SeedSequence):
        raise ValueError(
            f"rng has a {type(rng.bit_generator).__name__} without a seed sequence, but must have "
            "a numpy.random.SeedSequence to spawn from, as numpy.random.default_rng gives it"
        )
    [family] = sequence.spawn(1)  # a new one, so that no two calls share noise

    def node(count: int) -> Field:
        """Return the normals of one count."""
        stream = np.random.SeedSequence(
            family.entropy, spawn_key=(*family.spawn_key, count), pool_size=family.pool_size
        )
        return _draw_normals(target, 1, rim, np.random.Generator(np.random.PCG64(stream)))[0]

    return node


def _draw_normals(
    target: NDArray[np.bool_], count: int, rim: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return normals (count, row + 2 rim, col + 2 rim), drawn in the order of `draw_scene`."""
    from ncti.infrared.cells import bounding_box, lay_out

    rows, columns = target.shape
    top, bottom, left, right = bounding_box(target)
    # The ship's box in the window's rows and columns; empty without a ship.
    halo = BORDER if bottom else 0
    box = top - halo, bottom + halo, left - halo, right + halo
    shape = box[1] - box[0], box[3] - box[2]
    window = rows * columns - _count_shared(box, (0, rows, 0, columns))
    total = (rows + 2 * rim) * (columns + 2 * rim)
    around = total - _count_shared(box, (-rim, rows + rim, -rim, columns + rim)) - window
    # One draw for box, window and rim, which are then arranged into images.
    all_normals = rng.standard_normal(count * (math.prod(shape) + window + around))
    ends = count * math.prod(shape), count * (math.prod(shape) + window)
    box_normals = all_normals[: ends[0]].reshape(count, *shape)
    window_normals = all_normals[ends[0] : ends[1]].reshape(count, window)
    rim_normals = all_normals[ends[1] :].reshape(count, around)
    normals = np.empty((count, rows + 2 * rim, columns + 2 * rim))
    lay_out(box_normals, (box[0] + rim, box[2] + rim), window_normals, rim_normals, rim, normals)
    return normals


def _count_shared(box: Box, window: Box) -> int:
    """Return the number of pixels that two boxes share."""
    rows = min(box[1], window[1]) - max(box[0], window[0])
    columns = min(box[3], window[3]) - max(box[2], window[2])
    return max(0, rows) * max(0, columns)

"""Counter-based standard normals: each depends only on its stream and its number."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncti.compiled import compiled

Words = NDArray[np.uint64]
Singles = NDArray[np.float32]

# Constants of the loops as unsigned integers: with plain ones numba would compute in float64.
U1, U8, U9, U27, U30, U31, U32 = (np.uint64(n) for n in (1, 8, 9, 27, 30, 31, 32))
HALF, SIGNED_LAYER = np.uint64(2**32 - 1), np.uint64(0x1FF)
# SplitMix64: the step of its counter, 2**64 over the golden section, and the factors of its mixing.
GOLDEN = np.uint64(0x9E3779B97F4A7C15)
FACTOR_A, FACTOR_B = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
TAIL = 3.6541528853610088  # start of the lowest layer's tail


def draw_key(rng: np.random.Generator) -> Words:
    """Draw the key (2,) of streams: their first word, and the odd step between words."""
    return rng.integers(2**64, size=2, dtype=np.uint64) | np.array([0, 1], dtype=np.uint64)


@compiled
def put_streams(key: Words, first: int, cell: NDArray[np.int64], out: Words) -> None:
    """Write the stream of each frame and cell to `out` (frame, cell).

    `first` is the number of the first frame, `cell` (cell, 2) column and row, which key the stream.
    """
    step = key[1]
    for frame in range(out.shape[0]):
        frame_stream = _word(key[0], step, first + frame)
        for i in range(out.shape[1]):
            out[frame, i] = _word(_word(frame_stream, step, cell[i, 0]), step, cell[i, 1])


@compiled
def draw_run(key: Words, streams: Words, begin: int, out: Singles) -> None:
    """Write successive pairs of normals of each stream to `out` (frame, 2 cell, pair).

    `streams` (frame, cell) are from `put_streams`; `begin` is the number of the first pair. Rows
    2 i and 2 i + 1 hold the first and the second normals of the pairs of cell i.
    """
    for frame in range(streams.shape[0]):
        for i in range(streams.shape[1]):
            lower, upper = out[frame, 2 * i], out[frame, 2 * i + 1]
            for k in range(out.shape[2]):
                lower[k], upper[k] = _pair(streams[frame, i], key[1], begin + k)


@compiled
def draw_places(
    key: Words, streams: Words, first: NDArray[np.int64], number: NDArray[np.int64], out: Singles
) -> None:
    """Write the numbered pairs of normals of each stream to `out` (frame, 2, place).

    `number` (place,) are numbers of pairs in their stream. Cell i has the places from ``first[i]``
    to before ``first[i + 1]``, with `first` (cell + 1,); `out` begins at place ``first[0]``.
    """
    for frame in range(streams.shape[0]):
        lower, upper = out[frame, 0], out[frame, 1]
        for i in range(streams.shape[1]):
            for place in range(first[i], first[i + 1]):
                column = place - first[0]
                lower[column], upper[column] = _pair(streams[frame, i], key[1], number[place])


def _layers() -> tuple[Singles, NDArray[np.uint32], Singles]:
    """Return the widths, thresholds and heights of the ziggurat.

    All 256 layers have the area of the lowest, tail included. Widths (512,) are per step of a
    23-bit mantissa, negative in the second half. Numbers whose mantissa is below the threshold
    (512,) of their layer also lie within the next layer.
    """
    area = TAIL * math.exp(-(TAIL**2) / 2) + math.sqrt(math.pi / 2) * math.erfc(TAIL / math.sqrt(2))
    edge = [TAIL]
    while len(edge) < 255:
        edge.append(math.sqrt(-2 * math.log(area / edge[-1] + math.exp(-(edge[-1] ** 2) / 2))))
    lowest = area / math.exp(-(TAIL**2) / 2)
    x = np.array([lowest, *edge[::-1]])
    height = np.exp(-(x**2) / 2)
    height[0] = 1.0
    inside = np.array([TAIL, 0.0, *x[1:-1]]) / x
    steps = 2.0**23
    width = (x / steps).astype(np.float32)
    return (
        np.concatenate([width, -width]),
        np.tile(np.rint(inside * steps).astype(np.uint32), 2),
        height.astype(np.float32),
    )


WIDTH, INSIDE, HEIGHT = _layers()
TAIL_BEGINS, OVER_TAIL = np.float32(TAIL), np.float32(1 / TAIL)
STEP = np.float32(1.0 / 2**24)  # of uniform float32 numbers


@compiled
def _mix_bits(word: np.uint64) -> np.uint64:
    """Return a word with its bits mixed by a bijection."""
    word = (word ^ word >> U30) * FACTOR_A
    word = (word ^ word >> U27) * FACTOR_B
    return word ^ word >> U31


@compiled
def _word(stream: np.uint64, step: np.uint64, number: int) -> np.uint64:
    """Return a word of a stream by its number, negative ones included."""
    return _mix_bits(stream + (np.uint64(number) + U1) * step)


@compiled
def _pair(stream: np.uint64, step: np.uint64, number: int) -> tuple[np.float32, np.float32]:
    """Return the pair of normals of the two halves of a word."""
    word = _word(stream, step, number)
    low, high = word & HALF, word >> U32
    lower, upper = _normal(low), _normal(high)
    # 99 % of the halves lie inside the next layer of the ziggurat; the others take further words.
    if low >> U9 >= INSIDE[np.int64(low & SIGNED_LAYER)]:
        lower = _normal_or_retry(low, word)
    if high >> U9 >= INSIDE[np.int64(high & SIGNED_LAYER)]:
        upper = _normal_or_retry(high, ~word)
    return lower, upper


@compiled
def _normal(half: np.uint64) -> np.float32:
    """Return the candidate normal of 32 bits: layer (8), sign (1) and mantissa (23)."""
    return np.float32(np.int32(half >> U9)) * WIDTH[np.int64(half & SIGNED_LAYER)]


@compiled
def _normal_or_retry(half: np.uint64, state: np.uint64) -> np.float32:
    """Return the normal of 32 bits, with more words of its own stream if they are rejected."""
    while True:
        layer, mantissa, x = np.int64(half & SIGNED_LAYER), half >> U9, _normal(half)
        # Inside the next layer, too: accepted without evaluating the density.
        if mantissa < INSIDE[layer]:
            return x
        layer &= 255
        # The lowest layer's tail, by Marsaglia's method.
        if layer == 0:
            while True:
                state += GOLDEN
                beyond = -OVER_TAIL * _log1p(_mix_bits(state) >> U32)
                state += GOLDEN
                height = -_log1p(_mix_bits(state) >> U32)
                if height + height > beyond * beyond:
                    break
            return -(TAIL_BEGINS + beyond) if mantissa >> U8 & U1 else TAIL_BEGINS + beyond
        # Between this layer and the next: accepted below the density, or drawn again.
        state += GOLDEN
        uniform = np.float32(np.int32(_mix_bits(state) >> U32 >> U8)) * STEP
        above = (HEIGHT[layer - 1] - HEIGHT[layer]) * uniform + HEIGHT[layer]
        if above < math.exp(-0.5 * np.float64(x) * np.float64(x)):
            return x
        state += GOLDEN
        half = _mix_bits(state) >> U32


@compiled
def _log1p(half: np.uint64) -> np.float32:
    """Return log(1 - u) of the uniform number of 32 bits."""
    return np.float32(math.log1p(-np.float32(np.int32(half >> U8)) * STEP))

"""Detector outputs of IFOVs from normals at hand, as compiled loops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncti.compiled import compiled

Singles = NDArray[np.float32]
Places = NDArray[np.int64]


@compiled
def part_noise(
    normals: Singles,
    begin: Places,
    end: Places,
    of_even: tuple[int, int],
    of_odd: tuple[int, int],
    even: Singles,
    odd: Singles,
) -> None:
    """Copy normals of the noise to where products with its halves take them.

    Parameters
    ----------
    normals : (frame, normal) float32 ndarray
        What frames are drawn from.
    begin, end : (quadrature,) int64 ndarray
        First normal of the noise of each quadrature of each IFOV, and that past the last.
    of_even, of_odd : (int, int)
        First of a quadrature's normals that is one of even or odd rows, and how far the next is.
    even, odd : (frame, quadrature, row) float32 ndarray
        Filled.
    """
    for frame in range(even.shape[0]):
        for quadrature in range(even.shape[1]):
            drawn = normals[frame, begin[quadrature] : end[quadrature]]
            for half, (first, step) in ((even, of_even), (odd, of_odd)):
                row = half[frame, quadrature]
                for k in range(row.size):
                    row[k] = drawn[first + k * step]


@compiled
def put_magnitudes(
    even: Singles,
    odd: Singles,
    normals: Singles,
    speckle: Places,
    first: Places,
    occupied: Places,
    amplitude: Singles,
    reach: Places,
    response: Singles,
    out: Singles,
) -> None:
    """Put the detector output |l| of each IFOV and frame into `out`.

    Parameters
    ----------
    even, odd : (frame, quadrature, half) float32 ndarray
        Even and odd part of the noise in the lower half of the window, the middle bin in it; two
        quadratures an IFOV.
    normals : (frame, normal) float32 ndarray
        What frames are drawn from.
    speckle : (quadrature,) int64 ndarray
        First normal of the speckle of each quadrature.
    first : (ifov + 1,) int64 ndarray
        Where the occupied bins of each IFOV begin in the next three.
    occupied, amplitude, reach : (place,) ndarray
        Occupied bins of all IFOVs, their amplitudes, and how many bins they are felt in on each
        side, their own included.
    response : (2 bin - 1,) float32 ndarray
        Field by lag of a scatterer of unit amplitude, from the farthest bin below on.
    out : (frame, ifov, bin) float32 ndarray
        Filled.
    """
    bins, half = out.shape[2], even.shape[2]
    field = np.empty((2, bins), dtype=np.float32)
    one, other = field[0], field[1]
    for frame in range(out.shape[0]):
        for ifov in range(out.shape[1]):
            for q in range(2):
                lower, upper = field[q, :half], field[q, bins - half :]
                same, turned = even[frame, 2 * ifov + q], odd[frame, 2 * ifov + q]
                for n in range(half):
                    upper[half - 1 - n] = same[n] - turned[n]
                for n in range(half):
                    lower[n] = same[n] + turned[n]
            start, stop = first[ifov], first[ifov + 1]
            drawn = normals[frame, speckle[2 * ifov] :]
            drawn_other = normals[frame, speckle[2 * ifov + 1] :]
            # Two bins at once, within both their reaches: fields are loaded and kept half as often.
            # An odd bin at the end stands with itself, which then adds nothing.
            for place in range(start, stop, 2):
                pair = min(place + 1, stop - 1)
                at, then = occupied[place], occupied[pair]
                size, size_then = amplitude[place], amplitude[pair] * np.float32(pair - place)
                a, b = drawn[place - start] * size, drawn_other[place - start] * size
                c, d = drawn[pair - start] * size_then, drawn_other[pair - start] * size_then
                low = max(0, min(at - reach[place], then - reach[pair]) + 1)
                high = min(bins, max(at + reach[place], then + reach[pair]))
                shape = response[bins - 1 - at + low : bins - 1 - at + high]
                shape_then = response[bins - 1 - then + low : bins - 1 - then + high]
                near, near_other = one[low:high], other[low:high]
                for n in range(shape.size):
                    near[n] += a * shape[n] + c * shape_then[n]
                    near_other[n] += b * shape[n] + d * shape_then[n]
            magnitude = out[frame, ifov]
            for n in range(bins):
                magnitude[n] = np.sqrt(one[n] * one[n] + other[n] * other[n])


@compiled
def add_in_turn(kept: Singles, total: NDArray[np.float64]) -> None:
    """Add what is kept of one IFOV (frame, ifov, bin) after the other to frames (frame, bin)."""
    for frame in range(kept.shape[0]):
        whole = total[frame]
        for ifov in range(kept.shape[1]):
            part = kept[frame, ifov]
            for n in range(whole.size):
                whole[n] += part[n]

"""Compiled loops that turn normals into the detector outputs of IFOVs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncti.compiled import compiled

Singles = NDArray[np.float32]
Places = NDArray[np.int64]


@compiled
def put_magnitudes(
    noise: tuple[Singles, Singles],
    normals: Singles,
    first: Places,
    target: tuple[Places, Singles, Places],
    response: Singles,
    out: Singles,
) -> None:
    """Write the detector output |l| of each IFOV and frame to `out`, (frame, ifov, bin) float32.

    `noise`, two (frame, quadrature, half) float32, are the even and odd part of the noise in the
    lower half of the window, a middle bin included, two quadratures per IFOV. `normals` (frame, 2,
    place) float32 are those of the speckle of occupied bins from ``first[0]`` on, and `first` (ifov
    + 1,) where those of each IFOV begin in `target`: three (place,) arrays of bin, amplitude, and
    number of bins affected on each side, their own included. `response` (2 bin - 1,) float32 is the
    field of a unit scatterer by lag, the most negative first.
    """
    (even, odd), (occupied, amplitude, reach) = noise, target
    bins, half = out.shape[2], even.shape[2]
    field = np.empty((2, bins), dtype=np.float32)
    one, other = field[0], field[1]
    for frame in range(out.shape[0]):
        for ifov in range(out.shape[1]):
            # Noise of both quadratures: sum and difference of its even and odd part are the lower
            # half of the window and the mirrored upper half.
            for q in range(2):
                lower, upper = field[q, :half], field[q, bins - half :]
                same, turned = even[frame, 2 * ifov + q], odd[frame, 2 * ifov + q]
                for n in range(half):
                    upper[half - 1 - n] = same[n] - turned[n]
                for n in range(half):
                    lower[n] = same[n] + turned[n]
            start, stop = first[ifov], first[ifov + 1]
            drawn = normals[frame, 0, start - first[0] :]
            drawn_other = normals[frame, 1, start - first[0] :]
            # Speckle: every occupied bin adds the response of the pulse, as far as it reaches. Bins
            # are taken in pairs, which halves the loads and stores of the field. The last of an
            # odd number is paired with itself at amplitude zero.
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
            # Magnitude of the two quadratures.
            magnitude = out[frame, ifov]
            for n in range(bins):
                magnitude[n] = np.sqrt(one[n] * one[n] + other[n] * other[n])


@compiled
def add_in_turn(kept: Singles, total: NDArray[np.float64]) -> None:
    """Add the receiver output (frame, ifov, bin) to the frames (frame, bin), IFOV by IFOV."""
    for frame in range(kept.shape[0]):
        whole = total[frame]
        for ifov in range(kept.shape[1]):
            part = kept[frame, ifov]
            for n in range(whole.size):
                whole[n] += part[n]

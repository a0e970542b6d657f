"""Compiled loops that turn normals into the detector outputs of IFOVs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncti.compiled import compiled

Singles = NDArray[np.float32]
Indices = NDArray[np.int64]


@compiled
def put_magnitudes(
    noise: tuple[Singles, Singles],
    normals: Singles,
    first: Indices,
    target: tuple[Indices, Singles, Indices],
    response: Singles,
    out: Singles,
) -> None:
    """Write the detector output |l| of each IFOV and frame to `out`, (frame, ifov, bin) float32.

    `noise`, two (frame, quadrature, half) float32, are the even and odd part of the noise in the
    lower half of the window, a middle bin included, two quadratures per IFOV. `target` has three
    (place,) arrays for occupied bins: bin, amplitude, and number of bins affected on each side,
    including itself; each IFOV's begin at `first` (ifov + 1,). `normals` (frame, 2, place) float32
    are the speckle of these bins from ``first[0]`` on. `response` (2 bin - 1,) float32 is the field
    of a unit scatterer by lag, the most negative first.
    """
    (even, odd), (occupied, amplitude, reach) = noise, target
    bins, half = out.shape[2], even.shape[2]
    field = np.empty((2, bins), dtype=np.float32)
    real, imag = field[0], field[1]
    for frame in range(out.shape[0]):
        for ifov in range(out.shape[1]):
            # Noise of both quadratures: sum and difference of its even and odd part are the lower
            # half of the window and the mirrored upper half.
            for q in range(2):
                lower, upper = field[q, :half], field[q, bins - half :]
                even_row, odd_row = even[frame, 2 * ifov + q], odd[frame, 2 * ifov + q]
                for n in range(half):
                    upper[half - 1 - n] = even_row[n] - odd_row[n]
                for n in range(half):
                    lower[n] = even_row[n] + odd_row[n]
            start, stop = first[ifov], first[ifov + 1]
            normal_real = normals[frame, 0, start - first[0] :]
            normal_imag = normals[frame, 1, start - first[0] :]
            # Speckle: every occupied bin adds the response of the pulse, as far as it reaches, in
            # pairs of bins, which halves the loads and stores of the field. The last of an odd
            # number is paired with itself at amplitude zero.
            for place in range(start, stop, 2):
                pair = min(place + 1, stop - 1)
                place_bin, pair_bin = occupied[place], occupied[pair]
                size, size_pair = amplitude[place], amplitude[pair] * np.float32(pair - place)
                a, b = normal_real[place - start] * size, normal_imag[place - start] * size
                c, d = normal_real[pair - start] * size_pair, normal_imag[pair - start] * size_pair
                low = max(0, min(place_bin - reach[place], pair_bin - reach[pair]) + 1)
                high = min(bins, max(place_bin + reach[place], pair_bin + reach[pair]))
                shape = response[bins - 1 - place_bin + low : bins - 1 - place_bin + high]
                shape_pair = response[bins - 1 - pair_bin + low : bins - 1 - pair_bin + high]
                near_real, near_imag = real[low:high], imag[low:high]
                for n in range(shape.size):
                    near_real[n] += a * shape[n] + c * shape_pair[n]
                    near_imag[n] += b * shape[n] + d * shape_pair[n]
            # Magnitude of the two quadratures.
            magnitude = out[frame, ifov]
            for n in range(bins):
                magnitude[n] = np.sqrt(real[n] * real[n] + imag[n] * imag[n])


@compiled
def accumulate_frames(kept: Singles, total: NDArray[np.float64]) -> None:
    """Add the receiver output (frame, ifov, bin) to the frames (frame, bin), IFOV by IFOV."""
    for frame in range(kept.shape[0]):
        frame_total = total[frame]
        for ifov in range(kept.shape[1]):
            waveform = kept[frame, ifov]
            for n in range(frame_total.size):
                frame_total[n] += waveform[n]

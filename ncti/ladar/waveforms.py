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
    bins = out.shape[2]
    field = np.empty((2, bins), dtype=np.float32)
    real, imag = field[0], field[1]
    for frame in range(out.shape[0]):
        for ifov in range(out.shape[1]):
            for q in range(2):
                _write_noise(even[frame, 2 * ifov + q], odd[frame, 2 * ifov + q], field[q])
            start, stop = first[ifov], first[ifov + 1]
            normal_real = normals[frame, 0, start - first[0] :]
            normal_imag = normals[frame, 1, start - first[0] :]
            # Speckle: every occupied bin adds the response of the pulse, as far as it reaches, in
            # pairs of bins, which halves the loads and stores of the field. The last of an odd
            # number is paired with itself at amplitude zero.
            for place in range(start, stop, 2):
                pair = min(place + 1, stop - 1)
                place_bin, pair_bin = occupied[place], occupied[pair]
                size, pair_size = amplitude[place], amplitude[pair] * np.float32(pair - place)
                a, b = normal_real[place - start] * size, normal_imag[place - start] * size
                c, d = normal_real[pair - start] * pair_size, normal_imag[pair - start] * pair_size
                low = max(0, min(place_bin - reach[place], pair_bin - reach[pair]) + 1)
                high = min(bins, max(place_bin + reach[place], pair_bin + reach[pair]))
                shape = response[bins - 1 - place_bin + low : bins - 1 - place_bin + high]
                pair_shape = response[bins - 1 - pair_bin + low : bins - 1 - pair_bin + high]
                _add_pair(real[low:high], shape, pair_shape, a, c)
                _add_pair(imag[low:high], shape, pair_shape, b, d)
            # Magnitude of the two quadratures.
            magnitude = out[frame, ifov]
            for n in range(bins):
                magnitude[n] = np.sqrt(real[n] * real[n] + imag[n] * imag[n])


@compiled
def _write_noise(even: Singles, odd: Singles, field: Singles) -> None:
    """Write the noise of one quadrature to `field` (bin,).

    Sum and difference of its even and odd part (half,) are the lower half of the window and the
    mirrored upper half.
    """
    half = even.size
    lower, upper = field[:half], field[field.size - half :]
    for n in range(half):
        upper[half - 1 - n] = even[n] - odd[n]
    for n in range(half):
        lower[n] = even[n] + odd[n]


@compiled
def _add_pair(
    field: Singles, shape: Singles, pair_shape: Singles, size: np.float32, pair_size: np.float32
) -> None:
    """Add the responses of two scatterers, times their sizes, to the field around them."""
    for n in range(shape.size):
        field[n] += size * shape[n] + pair_size * pair_shape[n]


@compiled
def accumulate_frames(waveforms: Singles, total: NDArray[np.float64]) -> None:
    """Add the receiver output (frame, ifov, bin) to the frames (frame, bin), IFOV by IFOV."""
    for frame in range(waveforms.shape[0]):
        frame_total = total[frame]
        for ifov in range(waveforms.shape[1]):
            waveform = waveforms[frame, ifov]
            for n in range(frame_total.size):
                frame_total[n] += waveform[n]

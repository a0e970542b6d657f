"""Random fields of IFOVs: speckle of the target, filtered noise, and the detector output."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncti.ladar.extent import RangeExtent
from ncti.ladar.pulse import Pulse, mirrored_factors, noise_by_lag, target_kernel

# Frames and IFOVs of one matrix product. The last bit of a product depends on its number of rows,
# and a frame must not depend on the number of later frames, so target-free sums always have
# ROWS_AT_ONCE rows, drawn or not. Arrays of this size stay in the cache of a core.
ROWS_AT_ONCE, IFOVS_AT_ONCE = 8, 32
# Share of the standard deviation of the noise below which the field of the target is neglected: a
# sixtieth of the rounding error of float32.
NEGLIGIBLE_FIELD = 1e-9


class Speckle(NamedTuple):
    """Contribution of the target to the fields of IFOVs; target-free IFOVs come last."""

    first: NDArray[np.int64]  # (ifov + 1,) start of each IFOV in the next three arrays
    occupied: NDArray[np.int64]  # (place,) occupied bins
    amplitude: NDArray[np.float32]  # (place,) root mean square of each quadrature
    reach: NDArray[np.int64]  # (place,) bins that a scatterer affects on each side, own included
    response: NDArray[np.float32]  # (2 bin - 1,) by lag, the most negative lag first

    @classmethod
    def of(
        cls, extent: RangeExtent, *, pulse_width: float, cnr: float, target_free_ifovs: int = 0
    ) -> Speckle:
        """Return the speckle of a view, responses cut off where noise rounding exceeds them."""
        pulse = Pulse(pulse_width, extent.bin_width)
        bins = extent.down_range.size
        response = _response(pulse, bins)
        density = extent.density
        (occupied,) = density.reshape(-1).nonzero()
        amplitude = np.sqrt(cnr * density.take(occupied)).astype(np.float32)
        min_field = NEGLIGIBLE_FIELD * math.sqrt(noise_by_lag(pulse, 1)[0])
        # The response falls with the lag: the reach is the number of lags above a bin's threshold.
        with np.errstate(divide="ignore"):
            relative = min_field / amplitude
        reach = bins - response[:bins].searchsorted(relative, side="right")
        ifovs = len(density)
        first = np.searchsorted(occupied, bins * np.arange(ifovs + 1 + target_free_ifovs))
        return cls(first, occupied % bins, amplitude, reach, response)


@lru_cache(maxsize=32)
def _response(pulse: Pulse, bin_count: int) -> NDArray[np.float32]:
    """Return `target_kernel` by lag, the most negative lag first, its far tails set to zero."""
    kernel = target_kernel(pulse, bin_count)
    by_lag = np.concatenate([kernel[0, :0:-1], kernel[0]])
    # Subnormal float32 numbers are a hundred times slower to multiply.
    return np.where(by_lag > 1e-20, by_lag, 0.0).astype(np.float32)


class Noise(NamedTuple):
    """Factor of the covariance of filtered noise: rows even and odd about the window's middle.

    Products with the two halves take half the multiplications of the full product.
    """

    bins: int
    even: NDArray[np.float32]  # (rank, half) lower half of the rows, a middle bin included
    odd: NDArray[np.float32]

    @classmethod
    @lru_cache(maxsize=32)
    def of(cls, pulse: Pulse, bin_count: int) -> Noise:
        """Return the noise of a pulse."""
        return cls(bin_count, *mirrored_factors(noise_by_lag(pulse, bin_count), tolerance=1e-6))


class Waveforms:
    """Detector outputs |l| of IFOVs, computed in reused memory.

    In each frame, each IFOV draws normals from a stream keyed by its cell. They come in pairs, one
    normal per quadrature: pair n is the speckle of bin n, and the pairs of the noise follow the
    last bin.
    """

    def __init__(
        self, noise: Noise, speckle: Speckle, *, key: NDArray[np.uint64], cell: NDArray[np.int64]
    ) -> None:
        self.noise, self.speckle, self.key, self.cell = noise, speckle, key, cell
        ifovs = min(IFOVS_AT_ONCE, len(cell))
        half = noise.even.shape[1]
        self.sizes = len(noise.even), len(noise.odd), half, half
        rows = 2 * ifovs * ROWS_AT_ONCE
        self.halves = [np.empty(rows * size, dtype=np.float32) for size in self.sizes]
        self.magnitude = np.empty(ifovs * ROWS_AT_ONCE * noise.bins, dtype=np.float32)

    def magnitudes(self, first: int, frames: int) -> Iterator[NDArray[np.float32]]:
        """Yield (frame, ifov, bin) magnitudes of blocks of IFOVs, of up to ROWS_AT_ONCE frames."""
        from ncti.ladar.waveforms import put_magnitudes
        from ncti.normals import draw_places, draw_run, put_streams

        noise, target, key = self.noise, self.speckle, self.key
        ifovs = len(self.cell)
        for start in range(0, ifovs, IFOVS_AT_ONCE):
            stop = min(start + IFOVS_AT_ONCE, ifovs)
            quadratures = 2 * (stop - start)
            # The compiled loops need contiguous arrays, so slice flat buffers for the last IFOVs.
            even_normals, odd_normals, even, odd = (
                buffer[: frames * quadratures * size].reshape(frames, quadratures, size)
                for buffer, size in zip(self.halves, self.sizes, strict=True)
            )
            streams = np.empty((frames, stop - start), dtype=np.uint64)
            put_streams(key, first, self.cell[start:stop], streams)
            draw_run(key, streams, noise.bins, even_normals)
            draw_run(key, streams, noise.bins + len(noise.even), odd_normals)
            begin = target.first[start : stop + 1]
            speckle_normals = np.empty((frames, 2, begin[-1] - begin[0]), dtype=np.float32)
            draw_places(key, streams, begin, target.occupied, speckle_normals)
            # One product per frame, so that no frame depends on the number of frames.
            np.matmul(even_normals, noise.even, out=even)
            np.matmul(odd_normals, noise.odd, out=odd)
            magnitude = self.magnitude[: frames * (stop - start) * noise.bins]
            magnitude = magnitude.reshape(frames, stop - start, noise.bins)
            put_magnitudes(
                (even, odd),
                speckle_normals,
                begin,
                (target.occupied, target.amplitude, target.reach),
                target.response,
                magnitude,
            )
            yield magnitude

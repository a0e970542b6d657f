"""Sampled frames with speckle and shot noise, Equations A and B of the article."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache, partial
from itertools import chain, islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require, require_generator
from ncti.ladar.expected import STRONGEST
from ncti.ladar.extent import RangeExtent
from ncti.ladar.moments import magnitude_covariance
from ncti.ladar.pulse import (
    low_rank_factor,
    noise_by_lag,
    noise_covariance,
    noise_factor,
    noise_floor,
    target_kernel,
)
from ncti.ladar.receivers import FALSE_ALARM, detect

# From so many target-free IFOVs on, their sum is drawn as one Gaussian process: the sum of
# 100 Rayleigh magnitudes has skewness 0.063 and excess kurtosis 0.0025.
GAUSSIAN_FROM = 100
FRAMES_AT_ONCE = 32
# The last bit of a matrix product depends on how many rows it has, and a frame must not depend on
# how many follow it: target-free sums are products of so many frames, drawn or not. The arrays of
# so many frames and IFOVs stay in a core's own cache.
ROWS_AT_ONCE, IFOVS_AT_ONCE = 8, 32
MOST_DRAWN = 2**17  # target-free IFOVs drawn one by one: normals of one frame then have 0.2 GB
NORMALS_AT_ONCE = 4_000_000  # 16 MB, for fewer frames at once when there are many IFOVs
# Share of the noise's deviation below which the target's field is not computed: a sixtieth of the
# rounding of float32.
UNFELT = 1e-9


def sample_frames(
    extent: RangeExtent,
    *,
    pulse_width: float,
    cnr: float,
    frame_count: int,
    rng: np.random.Generator,
    target_free_ifovs: int = 0,
    receiver: str = "full_profile",
    false_alarm: float = FALSE_ALARM,
) -> NDArray[np.float64]:
    """Random frames: sums over IFOVs of the detector output, noise floor included.

    Parameters
    ----------
    extent : RangeExtent
        Range-extent fractions of the IFOVs on the target.
    pulse_width : float
        1/e^2 pulse width [s].
    cnr : float
        Carrier-to-noise power ratio (not decibels) of a filled IFOV at this range.
    frame_count : int
        Number of independent frames.
    rng : numpy.random.Generator
        Source of every random number.
    target_free_ifovs : int
        How many IFOVs without target each frame accumulates besides.
    receiver, false_alarm
        As in `ncti.ladar.receivers.detect`.

    Returns
    -------
    (frame, bin) float64 ndarray
        Amplitude, in the article's units (one target-free IFOV gives `noise_floor()`).

    Raises
    ------
    ValueError
        If a parameter is out of range.

    Notes
    -----
    Article, Appendix 1, Equations A and B. Speckle and noise have unit variance in each
    quadrature (<|w|^2> = 2), as Equation C takes it; the printed <w w*> = 1 would leave the
    mean sqrt(2) below. Both are independent from IFOV to IFOV and frame to frame.

    What a frame does not need is not drawn: speckle only on occupied bins, noise only in the
    band that the filter passes, and the full-profile sum of `target_free_ifovs` IFOVs, from
    GAUSSIAN_FROM on, as one Gaussian process with their exact mean and covariance.

    Nor is a product computed twice: filtered noise is even or odd about the window's middle (see
    `_Noise`), and the target reaches some pulse lengths only.

    Fewer frames from an equal generator are the first of more, bit for bit: normals are drawn
    frame by frame, and no product of matrices has more rows, or fewer, for another number.
    """
    blocks = frame_blocks(
        extent,
        pulse_width=pulse_width,
        cnr=cnr,
        frame_count=frame_count,
        rng=rng,
        target_free_ifovs=target_free_ifovs,
        receiver=receiver,
        false_alarm=false_alarm,
    )
    frames = np.empty((int(frame_count), extent.down_range.size))
    first = 0
    for block in blocks:
        frames[first : first + len(block)] = block
        first += len(block)
    return frames


def frame_blocks(
    extent: RangeExtent,
    *,
    pulse_width: float,
    cnr: float,
    frame_count: int,
    rng: np.random.Generator,
    target_free_ifovs: int = 0,
    receiver: str = "full_profile",
    false_alarm: float = FALSE_ALARM,
) -> Iterator[NDArray[np.float64]]:
    """Yield the frames of `sample_frames` a block at a time, in memory that their number is not in.

    Parameters
    ----------
    extent, pulse_width, cnr, frame_count, rng, target_free_ifovs, receiver, false_alarm
        As for `sample_frames`.

    Yields
    ------
    (frame, bin) float64 ndarray
        The next frames, at most `FRAMES_AT_ONCE`; those of all blocks in turn are the rows of
        `sample_frames` for an equal generator, bit for bit. Each block is an array of its own.

    Raises
    ------
    ValueError
        If a parameter is out of range: at the call, before the first block is asked for.
    """
    require("cnr", cnr, minimum=0.0, maximum=STRONGEST)
    require("frame_count", frame_count, minimum=1, whole=True)
    require("target_free_ifovs", target_free_ifovs, minimum=0, whole=True)
    require_generator("rng", rng)
    frame_count, target_free_ifovs = int(frame_count), int(target_free_ifovs)
    bins = extent.down_range.size
    pulse = {"pulse_width": pulse_width, "bin_width": extent.bin_width}
    as_sum = receiver == "full_profile" and target_free_ifovs >= GAUSSIAN_FROM
    if not as_sum and target_free_ifovs > MOST_DRAWN:
        raise ValueError(
            f"target_free_ifovs is {target_free_ifovs}, but must be at most {MOST_DRAWN} for the "
            f"receiver {receiver}, which sees each of them"
        )
    # numba takes long to import
    from ncti.ladar.waveforms import add_in_turn
    from ncti.normals import draw_normals

    noise = _Noise.of(**pulse, bin_count=bins)
    floor = np.zeros((0, bins), dtype=np.float32)
    if as_sum:
        floor = _floor_factor(**pulse, bin_count=bins)
    alone = 0 if as_sum else target_free_ifovs
    speckle = _Speckle.of(extent, pulse_width=pulse_width, cnr=cnr, target_free_ifovs=alone)
    detected = partial(detect, receiver=receiver, false_alarm=false_alarm)
    detected(floor)  # its checks
    level = target_free_ifovs * noise_floor() if as_sum else 0.0
    per_frame = len(floor) + 2 * (int(speckle.first[-1]) + (len(speckle.first) - 1) * noise.rank)
    at_once = min(FRAMES_AT_ONCE, frame_count, max(1, NORMALS_AT_ONCE // max(1, per_frame)))

    def blocks() -> Iterator[NDArray[np.float64]]:
        rows = -(-at_once // ROWS_AT_ONCE) * ROWS_AT_ONCE
        normals = np.zeros((rows, per_frame), dtype=np.float32)
        waveforms = _Waveforms(noise, speckle, begin=len(floor), frames=at_once)
        for first in range(0, frame_count, at_once):
            count = min(at_once, frame_count - first)
            draw_normals(rng, normals[:count])
            block = np.full((count, bins), level)
            if as_sum:
                # What is left in the rows that are not drawn changes no other row.
                padded = normals[: -(-count // ROWS_AT_ONCE) * ROWS_AT_ONCE, : len(floor)]
                sums = padded.reshape(-1, ROWS_AT_ONCE, len(floor)) @ floor
                block += math.sqrt(target_free_ifovs) * sums.reshape(-1, bins)[:count]
            for part in range(0, count, ROWS_AT_ONCE):
                some = slice(part, min(part + ROWS_AT_ONCE, count))
                for amplitude in waveforms.of(normals[some]):
                    add_in_turn(detected(amplitude), block[some])
            yield block

    return blocks()


def cumulative_average(
    frames: NDArray[np.floating] | Iterable[NDArray[np.floating]], frame_counts: Sequence[int]
) -> NDArray[np.float64]:
    """Averages over the first frames of a run, for several lengths of the run.

    Parameters
    ----------
    frames : (frame, bin) ndarray, or iterable of such
        Frames in the order they were taken, whole or in blocks as from `frame_blocks`. Of blocks
        no more are taken than the longest average needs, and one is kept at a time.
    frame_counts : sequence of int
        How many frames each average takes, from 1 to all.

    Returns
    -------
    (frame_count, bin) float64 ndarray
        Prefix averages: those of 4, 8, 16 and 32 frames share their first four.

    Raises
    ------
    ValueError
        If a count is below 1 or above the number of frames, or there is no count.

    Notes
    -----
    Article, 'Laser Radar Range Signatures' and Figure 5 (cumulative averaging). Frames are added
    one after the other in float64, so that no average depends on the blocks, nor on the others.
    """
    if not len(frame_counts):
        raise ValueError("frame_counts is empty, but must hold at least one number")
    known = len(frames) if isinstance(frames, np.ndarray) else math.inf
    for count in frame_counts:
        require("frame_count", count, minimum=1, maximum=known, whole=True)
    rows = chain.from_iterable([frames] if isinstance(frames, np.ndarray) else frames)
    averages: dict[int, NDArray[np.float64]] = {}
    total = np.zeros(())
    taken = 0
    for taken, row in enumerate(islice(rows, int(max(frame_counts))), start=1):
        total = total + row if taken == 1 else np.add(total, row, out=total)
        if taken in frame_counts:
            averages[taken] = total / taken
    for count in frame_counts:
        require("frame_count", count, maximum=taken)
    return np.stack([averages[int(count)] for count in frame_counts])


class _Speckle(NamedTuple):
    """What the target adds to the fields of IFOVs, those without a target last."""

    first: NDArray[np.int64]  # (ifov + 1,) where each IFOV begins in the next three
    occupied: NDArray[np.int64]  # (place,) bins
    amplitude: NDArray[np.float32]
    reach: NDArray[np.int64]  # so many bins feel a scatterer on each side, its own included
    response: NDArray[np.float32]  # (2 bin - 1,) by lag, from the farthest bin below on

    @classmethod
    def of(
        cls, extent: RangeExtent, *, pulse_width: float, cnr: float, target_free_ifovs: int = 0
    ) -> _Speckle:
        """Return that of a view, each bin's out to where it is lost in the noise's rounding."""
        pulse = {"pulse_width": pulse_width, "bin_width": extent.bin_width}
        bins = extent.down_range.size
        response = _response(**pulse, bin_count=bins)
        density = extent.density
        (occupied,) = density.reshape(-1).nonzero()
        amplitude = np.sqrt(cnr * density.take(occupied)).astype(np.float32)
        felt = UNFELT * math.sqrt(noise_by_lag(**pulse, bin_count=1)[0])
        # The response falls with the lag: how many lags are above what each bin asks.
        with np.errstate(divide="ignore"):
            lost = felt / amplitude
        reach = bins - response[:bins].searchsorted(lost, side="right")
        ifovs = len(density)
        first = np.searchsorted(occupied, bins * np.arange(ifovs + 1 + target_free_ifovs))
        return cls(first, occupied % bins, amplitude, reach, response)


@lru_cache(maxsize=32)
def _response(*, pulse_width: float, bin_width: float, bin_count: int) -> NDArray[np.float32]:
    """Return `target_kernel` by lag, from the farthest bin below on, without its farthest tails."""
    kernel = target_kernel(pulse_width=pulse_width, bin_width=bin_width, bin_count=bin_count)
    by_lag = np.concatenate([kernel[0, :0:-1], kernel[0]])
    # Numbers below the least normal float32 are a hundred times slower to multiply.
    return np.where(by_lag > 1e-20, by_lag, 0.0).astype(np.float32)


class _Noise(NamedTuple):
    """`noise_factor` in halves: its rows are even and odd in turn about the window's middle.

    The covariance is symmetric about it, and strictly totally positive as every Gaussian kernel,
    so that the eigenvector of the n-th largest eigenvalue has n - 1 changes of sign (Gantmacher
    and Krein, Oscillation Matrices and Kernels, 1950, chapter II): the parities alternate.
    Products with the halves take half the multiplications of one with the whole.
    """

    bins: int
    even: NDArray[np.float32]  # (rank, half) of the lower half, the middle of an odd number in it
    odd: NDArray[np.float32]
    of_even: tuple[int, int]  # first of a quadrature's normals that is of an even row, and step
    of_odd: tuple[int, int]

    @property
    def rank(self) -> int:
        """Normals of one quadrature."""
        return len(self.even) + len(self.odd)

    @classmethod
    @lru_cache(maxsize=32)
    def of(cls, *, pulse_width: float, bin_width: float, bin_count: int) -> _Noise:
        """Return the halves of the noise of a pulse."""
        pulse = {"pulse_width": pulse_width, "bin_width": bin_width}
        half = (bin_count + 1) // 2
        factor = noise_factor(**pulse, bin_count=bin_count)
        # Eigenvalues ascend: the last row is that of the largest, which is even.
        last = len(factor) - 1
        of_even, of_odd = (last % 2, 2), (1 - last % 2, 2)
        even, odd = factor[last % 2 :: 2], factor[1 - last % 2 :: 2]
        mixed = max(
            np.abs(even - even[:, ::-1]).max(initial=0.0),
            np.abs(odd + odd[:, ::-1]).max(initial=0.0),
        )
        if mixed > 1e-6 * np.abs(factor).max():
            # Pulses so short that bins are independent: eigenvalues are equal, and any mixture of
            # their eigenvectors is one. Those of both parities are then sought apart.
            covariance = noise_covariance(**pulse, bin_count=bin_count)
            direct, across = covariance[:half, :half], covariance[:half, ::-1][:, :half]
            even = low_rank_factor((direct + across) / 2, tolerance=1e-6)
            odd = low_rank_factor((direct - across) / 2, tolerance=1e-6)
            of_even, of_odd = (0, 1), (len(even), 1)
        even, odd = (np.ascontiguousarray(part[:, :half]) for part in (even, odd))
        return cls(bin_count, even, odd, of_even, of_odd)


class _Waveforms:
    """Detector outputs |l| of IFOVs from normals, in memory that is used again.

    A frame's normals are those of an IFOV after the other: its one quadrature, then its other,
    in each first those of the occupied bins, then those of the noise.
    """

    def __init__(self, noise: _Noise, speckle: _Speckle, *, begin: int, frames: int) -> None:
        self.noise, self.speckle = noise, speckle
        occupied = np.repeat(np.diff(speckle.first), 2)
        ends = begin + np.cumsum(occupied + noise.rank)
        # Of each quadrature: first normal of its speckle, first of its noise, and one past both.
        self.parts = np.stack([ends - noise.rank - occupied, ends - noise.rank, ends])
        most = min(IFOVS_AT_ONCE, len(speckle.first) - 1)
        half = noise.even.shape[1]
        self.sizes = len(noise.even), len(noise.odd), half, half
        rows = min(frames, ROWS_AT_ONCE)
        self.halves = [np.empty(rows * 2 * most * size, dtype=np.float32) for size in self.sizes]
        self.magnitude = np.empty(rows * most * noise.bins, dtype=np.float32)

    def of(self, normals: NDArray[np.float32]) -> Iterator[NDArray[np.float32]]:
        """Yield (frame, ifov, bin): some IFOVs at once, for at most `ROWS_AT_ONCE` frames."""
        from ncti.ladar.waveforms import part_noise, put_magnitudes  # numba takes long to import

        noise, target = self.noise, self.speckle
        ifovs = len(target.first) - 1
        for start in range(0, ifovs, IFOVS_AT_ONCE):
            stop = min(start + IFOVS_AT_ONCE, ifovs)
            speckle, begin, end = self.parts[:, 2 * start : 2 * stop]
            # Arrays of the last IFOVs lie whole in memory, too: loops are compiled for those alone.
            rows, quadratures = len(normals), 2 * (stop - start)
            even_normals, odd_normals, even, odd = (
                part[: rows * quadratures * size].reshape(rows, quadratures, size)
                for part, size in zip(self.halves, self.sizes, strict=True)
            )
            part_noise(normals, begin, end, noise.of_even, noise.of_odd, even_normals, odd_normals)
            # One product a frame, so that no frame depends on how many there are.
            np.matmul(even_normals, noise.even, out=even)
            np.matmul(odd_normals, noise.odd, out=odd)
            magnitude = self.magnitude[: rows * (stop - start) * noise.bins]
            magnitude = magnitude.reshape(rows, stop - start, noise.bins)
            put_magnitudes(
                *(even, odd, normals, speckle, target.first[start : stop + 1]),
                *(target.occupied, target.amplitude, target.reach, target.response),
                magnitude,
            )
            yield magnitude


@lru_cache(maxsize=32)
def _floor_factor(*, pulse_width: float, bin_width: float, bin_count: int) -> NDArray[np.float32]:
    """Factor of the covariance of one target-free IFOV's output over range bins."""
    noise = noise_covariance(pulse_width=pulse_width, bin_width=bin_width, bin_count=bin_count)
    return low_rank_factor(magnitude_covariance(noise), tolerance=1e-6)

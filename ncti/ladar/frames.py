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
# Frames are computed in blocks of one size, whatever their number: the last bit of a matrix product
# depends on how many rows it has, and a frame must not depend on how many follow it.
FRAMES_AT_ONCE = 32
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
    frame by frame, and a frame's place in its block of `FRAMES_AT_ONCE` does not depend on their
    number. Only the products of matrices are computed for whole blocks.
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
    noise = _Noise.of(**pulse, bin_count=bins)
    speckles = _speckles(extent, pulse_width=pulse_width, cnr=cnr)
    floor = np.zeros((0, bins), dtype=np.float32)
    if as_sum:
        floor = _floor_factor(**pulse, bin_count=bins)
    else:
        speckles += [NO_SPECKLE] * target_free_ifovs
    detected = partial(detect, receiver=receiver, false_alarm=false_alarm)
    detected(floor)  # its checks
    level = target_free_ifovs * noise_floor() if as_sum else 0.0
    per_frame = len(floor) + sum(2 * (len(part.factor) + noise.rank) for part in speckles)
    # Of the size of a frame alone, so that the blocks begin at the same frames for any number.
    at_once = min(FRAMES_AT_ONCE, max(1, NORMALS_AT_ONCE // max(1, per_frame)))

    def blocks() -> Iterator[NDArray[np.float64]]:
        normals = np.zeros((at_once, per_frame), dtype=np.float32)
        for first in range(0, frame_count, at_once):
            count = min(at_once, frame_count - first)
            # What is left in the rows of a last block that are not drawn changes no other row.
            rng.standard_normal(out=normals[:count], dtype=np.float32)
            floor_normals, field_normals = np.split(normals, [len(floor)], axis=1)
            block = math.sqrt(target_free_ifovs) * (floor_normals @ floor)[:count].astype(float)
            block += level
            for amplitude in _waveforms(field_normals, speckles, noise):
                block += detected(amplitude[:count])
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
    """What the target adds to one IFOV's field: the bins from `begin` to `end` alone feel it."""

    begin: int
    end: int
    factor: NDArray[np.float32]  # (occupied bin, end - begin)


NO_SPECKLE = _Speckle(0, 0, np.zeros((0, 0), dtype=np.float32))


def _speckles(extent: RangeExtent, *, pulse_width: float, cnr: float) -> list[_Speckle]:
    """Return the target's part of each IFOV, out to where it is lost in the noise's rounding."""
    pulse = {"pulse_width": pulse_width, "bin_width": extent.bin_width}
    bins = extent.down_range.size
    kernel = _short_kernel(**pulse, bin_count=bins)
    amplitude = np.sqrt(cnr * extent.density).astype(np.float32)
    # Beyond so many bins no scatterer of this view is felt.
    felt = UNFELT * math.sqrt(noise_by_lag(**pulse, bin_count=1)[0])
    reach = int(np.count_nonzero(amplitude.max(initial=0.0) * kernel[0] > felt))
    parts = []
    for fill, beta in zip(amplitude, extent.density, strict=True):
        (occupied,) = beta.nonzero()
        if not occupied.size:
            parts.append(NO_SPECKLE)
            continue
        begin = max(0, int(occupied[0]) - reach + 1)
        end = min(bins, int(occupied[-1]) + reach)
        response = kernel.take(occupied, axis=0)[:, begin:end]
        parts.append(_Speckle(begin, end, fill.take(occupied)[:, None] * response))
    return parts


@lru_cache(maxsize=32)
def _short_kernel(*, pulse_width: float, bin_width: float, bin_count: int) -> NDArray[np.float32]:
    """Return `target_kernel` without its farthest tails."""
    kernel = target_kernel(pulse_width=pulse_width, bin_width=bin_width, bin_count=bin_count)
    # Numbers below the least normal float32 are a hundred times slower to multiply.
    return np.where(kernel > 1e-20, kernel, 0.0).astype(np.float32)


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
    of_even: slice  # normals of a quadrature that are those of even rows
    of_odd: slice

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
        of_even, of_odd = slice(last % 2, None, 2), slice(1 - last % 2, None, 2)
        even, odd = factor[of_even], factor[of_odd]
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
            of_even, of_odd = slice(0, len(even)), slice(len(even), None)
        even, odd = (np.ascontiguousarray(part[:, :half]) for part in (even, odd))
        return cls(bin_count, even, odd, of_even, of_odd)


def _waveforms(
    normals: NDArray[np.float32], speckles: list[_Speckle], noise: _Noise
) -> Iterator[NDArray[np.float32]]:
    """Yield the detector output |l| (frame, bin) of each IFOV, in memory that the next one takes.

    A frame's normals are those of an IFOV after the other: its one quadrature, then its other,
    in each first those of the occupied bins, then those of the noise.
    """
    count, half = len(normals), noise.even.shape[1]
    even_normals = np.empty((2, count, len(noise.even)), dtype=np.float32)
    odd_normals = np.empty((2, count, len(noise.odd)), dtype=np.float32)
    even, odd = (np.empty((2, count, half), dtype=np.float32) for _ in range(2))
    field = np.empty((2, count, noise.bins), dtype=np.float32)
    lower, upper = field[..., :half], field[..., ::-1][..., :half]
    start = 0
    for begin, end, factor in speckles:
        occupied = len(factor)
        stop = start + 2 * (occupied + noise.rank)
        drawn = normals[:, start:stop].reshape(count, 2, -1).swapaxes(0, 1)
        start = stop
        of_noise = drawn[..., occupied:]
        even_normals[:] = of_noise[..., noise.of_even]
        odd_normals[:] = of_noise[..., noise.of_odd]
        _product(even_normals, noise.even, even)
        _product(odd_normals, noise.odd, odd)
        np.subtract(even, odd, out=upper)
        np.add(even, odd, out=lower)
        if occupied:
            field[..., begin:end] += drawn[..., :occupied] @ factor
        np.square(field, out=field)
        amplitude = np.add(field[0], field[1], out=field[0])
        yield np.sqrt(amplitude, out=amplitude)


def _product(
    normals: NDArray[np.float32], factor: NDArray[np.float32], out: NDArray[np.float32]
) -> None:
    """Put normals @ factor into `out`: one product of all rows, not one a quadrature."""
    rows = math.prod(out.shape[:-1])
    np.matmul(normals.reshape(rows, len(factor)), factor, out=out.reshape(rows, -1))


@lru_cache(maxsize=32)
def _floor_factor(*, pulse_width: float, bin_width: float, bin_count: int) -> NDArray[np.float32]:
    """Factor of the covariance of one target-free IFOV's output over range bins."""
    noise = noise_covariance(pulse_width=pulse_width, bin_width=bin_width, bin_count=bin_count)
    return low_rank_factor(magnitude_covariance(noise), tolerance=1e-6)

"""Sampled frames with speckle and shot noise, Equations A and B of the article."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require, require_generator
from ncti.ladar.expected import STRONGEST
from ncti.ladar.extent import RangeExtent
from ncti.ladar.moments import magnitude_covariance
from ncti.ladar.pulse import (
    low_rank_factor,
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

    Fewer frames from an equal generator are the first of more, bit for bit: normals are drawn
    frame by frame, and a frame's place in its block of `FRAMES_AT_ONCE` does not depend on their
    number. Only the products of matrices are computed for whole blocks.
    """
    require("cnr", cnr, minimum=0.0, maximum=STRONGEST)
    require("frame_count", frame_count, minimum=1, whole=True)
    require("target_free_ifovs", target_free_ifovs, minimum=0, whole=True)
    require_generator("rng", rng)
    frame_count, target_free_ifovs = int(frame_count), int(target_free_ifovs)
    bins = extent.down_range.size
    as_sum = receiver == "full_profile" and target_free_ifovs >= GAUSSIAN_FROM
    if not as_sum and target_free_ifovs > MOST_DRAWN:
        raise ValueError(
            f"target_free_ifovs is {target_free_ifovs}, but must be at most {MOST_DRAWN} for the "
            f"receiver {receiver}, which sees each of them"
        )
    factors = _field_factors(
        extent,
        pulse_width=pulse_width,
        cnr=cnr,
        target_free_ifovs=0 if as_sum else target_free_ifovs,
    )
    if as_sum:
        floor_factor = _floor_factor(
            pulse_width=pulse_width, bin_width=extent.bin_width, bin_count=bins
        )
    else:
        floor_factor = np.zeros((0, bins), dtype=np.float32)
    per_frame = len(floor_factor) + 2 * sum(len(factor) for factor in factors)
    # Of the size of a frame alone, so that the blocks begin at the same frames for any number.
    at_once = min(FRAMES_AT_ONCE, max(1, NORMALS_AT_ONCE // max(1, per_frame)))
    frames = np.empty((frame_count, bins))
    normals = np.zeros((at_once, per_frame), dtype=np.float32)
    for first in range(0, frame_count, at_once):
        block = frames[first : first + at_once]
        count = len(block)
        # What is left in the rows of a last block that are not drawn changes no other row.
        rng.standard_normal(out=normals[:count], dtype=np.float32)
        floor_normals, field_normals = np.split(normals, [len(floor_factor)], axis=1)
        block[:] = math.sqrt(target_free_ifovs) * (floor_normals @ floor_factor)[:count]
        block += target_free_ifovs * noise_floor() if as_sum else 0.0
        for amplitude in _waveforms(field_normals, factors, frame_count=count):
            block += detect(amplitude, receiver=receiver, false_alarm=false_alarm)
    return frames


def cumulative_average(
    frames: NDArray[np.floating], frame_counts: Sequence[int]
) -> NDArray[np.float64]:
    """Averages over the first frames of a run, for several lengths of the run.

    Parameters
    ----------
    frames : (frame, bin) ndarray
        Frames in the order they were taken.
    frame_counts : sequence of int
        How many frames each average takes, from 1 to all.

    Returns
    -------
    (frame_count, bin) float64 ndarray
        Prefix averages: those of 4, 8, 16 and 32 frames share their first four.

    Raises
    ------
    ValueError
        If a count is below 1 or above the number of frames.

    Notes
    -----
    Article, 'Laser Radar Range Signatures' and Figure 5 (cumulative averaging).
    """
    for count in frame_counts:
        require("frame_count", count, minimum=1, maximum=len(frames), whole=True)
    return np.stack(
        [np.mean(frames[: int(count)], axis=0, dtype=np.float64) for count in frame_counts]
    )


def _field_factors(
    extent: RangeExtent, *, pulse_width: float, cnr: float, target_free_ifovs: int
) -> list[NDArray[np.float32]]:
    """Factor (rank, bin) of each IFOV's field: speckle on its occupied bins, then noise."""
    bins = extent.down_range.size
    pulse = {"pulse_width": pulse_width, "bin_width": extent.bin_width}
    noise = noise_factor(**pulse, bin_count=bins)
    kernel = target_kernel(**pulse, bin_count=bins)
    factors = []
    for beta in extent.density:
        occupied = np.flatnonzero(beta)
        speckle = np.sqrt(cnr * beta[occupied])[:, None] * kernel[occupied]
        factors.append(np.concatenate([speckle.astype(np.float32), noise]))
    return factors + [noise] * target_free_ifovs


def _waveforms(
    normals: NDArray[np.float32], factors: list[NDArray[np.float32]], *, frame_count: int
) -> Iterator[NDArray[np.float32]]:
    """Detector output |l| (frame, bin) of one IFOV after the other, for the first frames."""
    at_once = len(normals)
    start = 0
    for factor in factors:
        stop = start + 2 * len(factor)
        field = normals[:, start:stop].reshape(2 * at_once, len(factor)) @ factor
        field = field[: 2 * frame_count]
        field *= field
        power = field[0::2]
        power += field[1::2]
        yield np.sqrt(power)
        start = stop


@lru_cache(maxsize=32)
def _floor_factor(*, pulse_width: float, bin_width: float, bin_count: int) -> NDArray[np.float32]:
    """Factor of the covariance of one target-free IFOV's output over range bins."""
    noise = noise_covariance(pulse_width=pulse_width, bin_width=bin_width, bin_count=bin_count)
    return low_rank_factor(magnitude_covariance(noise), tolerance=1e-6)

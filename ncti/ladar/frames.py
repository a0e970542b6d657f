"""Sampled frames with speckle and shot noise, Equations A and B of the article."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache, partial
from itertools import chain, islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require, require_generator
from ncti.ladar.expected import MAX_CNR
from ncti.ladar.extent import RangeExtent
from ncti.ladar.fields import ROWS_AT_ONCE, Noise, Speckle, Waveforms
from ncti.ladar.moments import floor_by_lag, floor_reach
from ncti.ladar.pulse import Pulse, noise_by_lag, noise_floor
from ncti.ladar.receivers import FALSE_ALARM, detect

# Number of target-free IFOVs from which their sum is drawn as one Gaussian process: the sum of 100
# Rayleigh magnitudes has skewness 0.063 and excess kurtosis 0.0025.
GAUSSIAN_FROM = 100
MAX_DRAWN = 2**17  # target-free IFOVs drawn one by one; a frame of 250 bins then takes seconds
TARGET_FREE_ROW = 2**40  # row of the cells of IFOVs without target, beyond any ship


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
    """Draw random frames with speckle and shot noise.

    Parameters
    ----------
    extent : RangeExtent
        Range-extent fractions of the IFOVs on the target.
    pulse_width : float
        1/e^2 pulse width [s].
    cnr : float
        Carrier-to-noise ratio of a filled IFOV at this range, as a power ratio, not in decibels;
        ``power_ratio(32)`` is that of 32 dB.
    frame_count : int
        Number of independent frames.
    rng : numpy.random.Generator
        Source of all random numbers.
    target_free_ifovs : int
        Number of IFOVs without target that are added to each frame.
    receiver : str
        `full_profile`, `first_pulse` or `peak_pulse`.
    false_alarm : float
        Probability that noise alone triggers the `first_pulse` receiver in one bin, in (0, 1).

    Returns
    -------
    (frame, bin) float64 ndarray
        Detector output summed over IFOVs, noise floor included, in units in which one target-free
        IFOV gives `noise_floor()` on average.

    Raises
    ------
    ValueError
        If a parameter is out of range.

    See Also
    --------
    expected_profile : Mean of the frames in closed form.
    frame_moments : Mean and covariance of the frames in closed form.
    cumulative_average : Averages over the first frames.
    frame_blocks : The same frames a block at a time.

    Notes
    -----
    Equations A and B of [1]_. Speckle and noise have unit variance in each quadrature
    (<|w|^2> = 2), as Equation C requires; with the printed <w w*> = 1 the mean would be lower by
    sqrt(2). Both are independent between IFOVs and between frames.

    A frame is the sum of few draws: speckle on occupied bins, noise in the band that the filter
    passes and, from GAUSSIAN_FROM target-free IFOVs on, their full-profile sum as one Gaussian
    process with the exact mean and covariance. The filtered noise is even or odd about the middle
    of the window (see `ncti.ladar.fields.Noise`), which halves the products, and the target is
    added only within the reach of the pulse.

    Each normal is keyed by its frame, the cell of its IFOV and its range bin (`ncti.normals`), so
    similar views have similar frames, even if the ship occupies some bins and IFOVs in only one of
    them. With an equal generator, N frames are the first N of any longer run, bit for bit, because
    the number of rows of a matrix product does not depend on the number of frames.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, Appendix 1, Equations A and B.

    Examples
    --------
    A plate that fills four IFOVs. Each is fully developed speckle with a contrast of
    sqrt(4/pi - 1) = 0.52, so the peak of a frame fluctuates by half of that, 26 %, about the
    expected profile:

    >>> import numpy as np
    >>> import trimesh
    >>> from ncti.ladar import expected_profile, range_extent, sample_frames
    >>> from ncti.render import line_image
    >>> plate = trimesh.creation.box(extents=(4.0, 30.0, 30.0))
    >>> lines = line_image(plate, aspect=0, depression=0, spacing=0.5)
    >>> extent = range_extent(lines, slant_range=100e3)
    >>> laser = {"pulse_width": 30e-9, "cnr": 10**3.2}
    >>> frames = sample_frames(extent, **laser, frame_count=1024, rng=np.random.default_rng(2))
    >>> peak = expected_profile(extent, **laser).argmax()
    >>> print(f"{frames[:, peak].std() / frames[:, peak].mean():.2f}")
    0.26
    >>> print(f"{frames[:, peak].mean() / expected_profile(extent, **laser)[peak]:.2f}")
    1.00
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
    return np.concatenate(list(blocks))


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
    """Yield the frames of `sample_frames` a block at a time, in the memory of one block.

    Parameters
    ----------
    extent, pulse_width, cnr, frame_count, rng, target_free_ifovs, receiver, false_alarm
        See `sample_frames`.

    Yields
    ------
    (frame, bin) float64 ndarray
        The next frames, at most eight. Together the blocks are the rows of `sample_frames` for an
        equal generator, bit for bit. Blocks do not share memory.

    Raises
    ------
    ValueError
        If a parameter is out of range; raised by the call, before the first block.

    See Also
    --------
    sample_frames : All frames in one array.
    cumulative_average : Averages over the first frames, which takes blocks.

    Examples
    --------
    A thousand frames of noise alone, from 20 IFOVs. Their mean is the noise floor of the 20 IFOVs:

    >>> import numpy as np
    >>> from ncti.ladar import cumulative_average, frame_blocks, no_return, noise_floor
    >>> blocks = frame_blocks(
    ...     no_return(250.0, 1.0), pulse_width=30e-9, cnr=10**3.2, frame_count=1000,
    ...     rng=np.random.default_rng(0), target_free_ifovs=20,
    ... )
    >>> (average,) = cumulative_average(blocks, [1000])
    >>> print(f"{average.mean() / (20 * noise_floor()):.2f}")
    1.00
    """
    require("cnr", cnr, minimum=0.0, maximum=MAX_CNR)
    require("frame_count", frame_count, minimum=1, whole=True)
    require("target_free_ifovs", target_free_ifovs, minimum=0, whole=True)
    require_generator("rng", rng)
    frame_count, target_free_ifovs = int(frame_count), int(target_free_ifovs)
    bins = extent.down_range.size
    pulse = Pulse(pulse_width, extent.bin_width)
    is_gaussian = receiver == "full_profile" and target_free_ifovs >= GAUSSIAN_FROM
    if not is_gaussian and target_free_ifovs > MAX_DRAWN:
        raise ValueError(
            f"target_free_ifovs is {target_free_ifovs}, but must be at most {MAX_DRAWN} for the "
            f"receiver {receiver}, which detects in each of them"
        )
    from ncti.ladar.waveforms import accumulate_frames
    from ncti.normals import draw_key

    noise = Noise.of(pulse, bins)
    singles = 0 if is_gaussian else target_free_ifovs
    speckle = Speckle.of(extent, pulse_width=pulse_width, cnr=cnr, target_free_ifovs=singles)
    detected = partial(detect, receiver=receiver, false_alarm=false_alarm)
    detected(np.zeros((0, bins), dtype=np.float32))  # checks its parameters
    level = target_free_ifovs * noise_floor() if is_gaussian else 0.0
    key = draw_key(rng)
    target_free_cells = np.stack([np.arange(singles), np.full(singles, TARGET_FREE_ROW)], axis=1)
    cell = np.concatenate([extent.cell, target_free_cells])

    def blocks() -> Iterator[NDArray[np.float64]]:
        """Yield the blocks, from normals and waveforms in reused memory."""
        waveforms = Waveforms(noise, speckle, key=key, cell=cell)
        floor = _TargetFreeNoise(pulse, bins, key) if is_gaussian else None
        for first in range(0, frame_count, ROWS_AT_ONCE):
            block = np.full((min(ROWS_AT_ONCE, frame_count - first), bins), level)
            if floor:
                block += math.sqrt(target_free_ifovs) * floor.deviations(first, len(block))
            # All other IFOVs individually: waveform, receiver, sum.
            for amplitude in waveforms.magnitudes(first, len(block)):
                accumulate_frames(detected(amplitude), block)
            yield block

    return blocks()


def cumulative_average(
    frames: NDArray[np.floating] | Iterable[NDArray[np.floating]], frame_counts: Sequence[int]
) -> NDArray[np.float64]:
    """Return averages over the first frames, for several numbers of frames.

    Parameters
    ----------
    frames : (frame, bin) ndarray, or iterable of such
        Frames in the order they were taken, in one array or in blocks, as from `frame_blocks`.
        Blocks are consumed one at a time and only as far as the longest average needs.
    frame_counts : sequence of int
        Number of frames in each average, from 1 to all.

    Returns
    -------
    (frame_count, bin) float64 ndarray
        Averages, in the order of `frame_counts`: those of 4, 8, 16 and 32 frames share the first
        four frames.

    Raises
    ------
    ValueError
        If a count is below 1 or above the number of frames, or there is no count.

    See Also
    --------
    sample_frames : Random frames.
    ncti.features.profile_vector : Profile vector of an average.

    Notes
    -----
    The cumulative averaging of [1]_. Frames are added one after the other in float64, so that an
    average depends neither on the blocks nor on the other averages.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, section "Laser Radar Range Signatures" and Figure 5.

    Examples
    --------
    >>> import numpy as np
    >>> from ncti.ladar import cumulative_average
    >>> frames = np.array([[1.0, 4.0], [3.0, 4.0], [5.0, 1.0]])
    >>> cumulative_average(frames, [1, 2, 3])
    array([[1., 4.],
           [2., 4.],
           [3., 3.]])

    The standard error falls as the inverse root of the number of frames:

    >>> noise = np.random.default_rng(0).normal(size=(256, 10_000))
    >>> cumulative_average(noise, [1, 16, 256]).std(axis=1).round(2)
    array([1.  , 0.25, 0.06])
    """
    if not len(frame_counts):
        raise ValueError("frame_counts is empty, but must hold at least one number")
    available = len(frames) if isinstance(frames, np.ndarray) else math.inf
    for count in frame_counts:
        require("frame_count", count, minimum=1, maximum=available, whole=True)
    rows = chain.from_iterable([frames] if isinstance(frames, np.ndarray) else frames)
    averages: dict[int, NDArray[np.float64]] = {}
    total = np.zeros(())
    number = 0
    for number, row in enumerate(islice(rows, int(max(frame_counts))), start=1):
        total = total + row if number == 1 else np.add(total, row, out=total)
        if number in frame_counts:
            averages[number] = total / number
    for count in frame_counts:
        require("frame_count", count, maximum=number)
    return np.stack([averages[int(count)] for count in frame_counts])


def averaged_frames(
    extent: RangeExtent, frame_counts: Sequence[int], **noise: Any
) -> NDArray[np.float64]:
    """Return (frame_count, bin) averages over the first frames; `noise` goes to `frame_blocks`."""
    blocks = frame_blocks(extent, frame_count=max(frame_counts), **noise)
    return cumulative_average(blocks, frame_counts)


class _TargetFreeNoise:
    """Deviation of the sum of target-free IFOVs from its mean, scaled to one IFOV."""

    def __init__(self, pulse: Pulse, bin_count: int, key: NDArray[np.uint64]) -> None:
        self.key, self.bins = key, bin_count
        self.transfer = _floor_filter(pulse, bin_count)
        self.normals = np.zeros((ROWS_AT_ONCE, 2, len(self.transfer) - 1), dtype=np.float32)

    def deviations(self, first: int, frames: int) -> NDArray[np.float32]:
        """Return (frame, bin) deviations of up to ROWS_AT_ONCE frames."""
        from scipy.fft import irfft, rfft

        from ncti.normals import draw_run, put_streams

        streams = np.empty((frames, 1), dtype=np.uint64)
        put_streams(self.key, first, np.array([[0, TARGET_FREE_ROW]]), streams)
        # Rows beyond `frames` keep old values, which do not affect the others.
        draw_run(self.key, streams, 0, self.normals)
        white = self.normals.reshape(ROWS_AT_ONCE, -1)
        sums: NDArray[np.float32] = irfft(rfft(white) * self.transfer, n=white.shape[1])
        return sums[:frames, : self.bins]


@lru_cache(maxsize=32)
def _floor_filter(pulse: Pulse, bin_count: int) -> NDArray[np.float32]:
    """Return the transfer function that gives white noise the covariance of a target-free IFOV.

    Noise that is periodic over the window plus the reach of its correlation has exactly this
    covariance in the window (circulant embedding).
    """
    from scipy.fft import next_fast_len, rfft

    reach = floor_reach(pulse)
    half = next_fast_len(math.ceil(max(bin_count + reach, 2 * reach) / 2), real=True)
    floor = floor_by_lag(noise_by_lag(pulse, half + 1))
    spectrum = rfft(np.concatenate([floor, floor[-2:0:-1]])).real
    return np.sqrt(np.maximum(spectrum, 0.0)).astype(np.float32)

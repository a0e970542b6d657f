"""Time of sampled frames and infrared images over that of their normals, and of covariances.

Beside each stands the same computation written plainly, in turn with it in one run.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

import ncti.ships
from benchmarks.processes import watch
from benchmarks.reports import Column, Report, Sample
from ncti.infrared import IFOV, SUPER_RESOLUTIONS, shifted_images, silhouette, thermal_images
from ncti.ladar import (
    RangeExtent,
    banded_frame_moments,
    cumulative_average,
    frame_blocks,
    noise_floor,
    range_extent,
    sample_frames,
)
from ncti.ladar.moments import magnitude_covariance
from ncti.ladar.pulse import low_rank_factor, noise_covariance, target_kernel
from ncti.render import range_image

Floats = NDArray[Any]

CNR, TARGET_FREE = 10**3.2, 4000
SLANT_RANGE = 1e5  # [m]
PULSES = (10e-9, 30e-9, 100e-9)  # [s]
FRAME_COUNTS = (1, 16, 128)
LONG_RUNS = (1_000, 1_000_000)  # frames of one average
LONG_WINDOW = 60.0  # [m]
ASPECTS = (0.0, 45.0, 90.0)  # [deg]
RANGES = (25e3, 50e3, 100e3)  # [m] of infrared images

COLUMNS = (
    Column("part", "part"),
    Column("pulse_ns", "ns", "g"),
    Column("frames", "frames", "d"),
    Column("ms", "time [ms]", ".2f"),
    Column("normals_ms", "normals [ms]", ".2f"),
    Column("over_normals", "x normals", ".2f"),
    Column("plain_ms", "plain [ms]", ".2f"),
    Column("over_plain", "x plain", ".2f"),
    Column("mib", "memory [MiB]", ".0f"),
)


@threadpool_limits.wrap(1)  # as in a worker
def measure(
    ship: str, *, repeats: int, aspects: Sequence[float] = ASPECTS, long_runs: bool = False
) -> Report:
    """Time frames, covariances and infrared images of some views of a ship.

    Parameters
    ----------
    ship : str
        Name or path.
    repeats : int
        How often everything is computed, after once that does not count.
    aspects : sequence of float
        Views [deg].
    long_runs : bool
        Whether averages of up to 1,000,000 frames are taken, too, once.

    Returns
    -------
    Report
        A row for every pulse width and number of frames, every pulse width's covariance, and every
        range and way of super-resolution; ratios are of times of one view, next to each other. Of
        long runs a row each, with the most memory of their process.
    """
    mesh = ncti.ships.load(ship)
    images = [range_image(mesh, aspect=a, depression=3.84, engine="auto") for a in aspects]
    extents = [range_extent(image, slant_range=SLANT_RANGE) for image in images]
    rows: list[dict[str, Any]] = []
    for pulse, count in product(PULSES, FRAME_COUNTS):
        calls = [frame_calls(extent, pulse, count) for extent in extents]
        of = {"part": "frames", "pulse_ns": pulse * 1e9, "frames": count}
        rows.append(of | _timed(calls, repeats))
    for pulse in PULSES:
        calls = [covariance_calls(extent, pulse) for extent in extents]
        rows.append({"part": "covariance", "pulse_ns": pulse * 1e9} | _timed(calls, repeats))
    for where, way in product(RANGES, SUPER_RESOLUTIONS):
        footprint = IFOV * where / (1 if way == "none" else 2)
        targets = [silhouette(image, footprint=footprint).target(0.25) for image in images]
        calls = [image_calls(target, way) for target in targets]
        rows.append({"part": f"image, {where / 1e3:g} km, {way}"} | _timed(calls, repeats))
    if long_runs:
        rows += [_long_run(ship, count) for count in LONG_RUNS]
    return Report(
        f"Synthesis, {len(extents)} views of {ship}, {repeats} times each, one thread",
        COLUMNS,
        rows,
        [
            "Median (lowest-highest). Frames accumulate 4,000 target-free IFOVs; their normals are "
            "as many float32 ones of numpy. Plain: one product with the whole factor of each "
            "IFOV, tails and all, and a covariance matrix an IFOV. Averages: of 60 bins broadside "
            "at 30 ns, each in a process of its own, whose memory is that of Python, numpy and "
            "numba, too.",
        ],
    )


Calls = dict[str, Callable[[], object]]


def frame_calls(extent: RangeExtent, pulse_width: float, frame_count: int) -> Calls:
    """Return what samples frames: `ours`, `plain`, and only their `normals`."""
    rng = np.random.default_rng(0)
    signal: dict[str, Any] = {"pulse_width": pulse_width, "frame_count": frame_count, "rng": rng}
    pulse: dict[str, Any] = {"pulse_width": pulse_width, "bin_width": extent.bin_width}
    bins = extent.down_range.size
    kernel, covariance = (of(**pulse, bin_count=bins) for of in (target_kernel, noise_covariance))
    noise, floor = (
        low_rank_factor(each, tolerance=1e-6)
        for each in (covariance, magnitude_covariance(covariance))
    )
    taken = len(floor) + 2 * sum(len(noise) + np.count_nonzero(f) for f in extent.fraction)
    buffer = np.empty((min(frame_count, 32), taken), dtype=np.float32)

    def normals() -> None:
        for first in range(0, frame_count, len(buffer)):
            rng.standard_normal(out=buffer[: frame_count - first], dtype=np.float32)

    def plain() -> Floats:
        factors = []
        for beta in extent.density:
            speckle = np.sqrt(CNR * beta[beta > 0])[:, None] * kernel[beta > 0]
            factors.append(np.concatenate([speckle.astype(np.float32), noise]))
        frames = np.full((frame_count, bins), TARGET_FREE * noise_floor())
        for block in (frames[first : first + 32] for first in range(0, frame_count, 32)):
            drawn = rng.standard_normal((len(block), taken), dtype=np.float32)
            block += math.sqrt(TARGET_FREE) * (drawn[:, : len(floor)] @ floor)
            start = len(floor)
            for factor in factors:
                stop = start + 2 * len(factor)
                both = drawn[:, start:stop].reshape(2 * len(block), -1) @ factor
                block += np.sqrt(both[0::2] ** 2 + both[1::2] ** 2)
                start = stop
        return frames

    def ours() -> Floats:
        return sample_frames(extent, cnr=CNR, target_free_ifovs=TARGET_FREE, **signal)

    return {"ours": ours, "plain": plain, "normals": normals}


def covariance_calls(extent: RangeExtent, pulse_width: float) -> Calls:
    """Return what computes the covariance of a frame: `ours`, and `plain`, a matrix an IFOV."""
    pulse: dict[str, Any] = {"pulse_width": pulse_width, "bin_width": extent.bin_width}
    bins = extent.down_range.size
    kernel, noise = (
        target_kernel(**pulse, bin_count=bins),
        noise_covariance(**pulse, bin_count=bins),
    )

    def plain() -> Floats:
        whole = TARGET_FREE * magnitude_covariance(noise)
        for beta in extent.density:
            whole += magnitude_covariance(CNR * (kernel * beta) @ kernel.T + noise)
        return whole

    def ours() -> object:
        return banded_frame_moments(
            extent, pulse_width=pulse_width, cnr=CNR, target_free_ifovs=TARGET_FREE
        )

    return {"ours": ours, "plain": plain}


def image_calls(target: NDArray[np.bool_], way: str) -> Calls:
    """Return what draws an infrared image of 16 frames: `ours`, and only its `normals`."""
    rng = np.random.default_rng(0)
    draw = shifted_images if way == "shifted" else thermal_images
    rim = 2 if way == "shifted" else 0
    shape = (2, target.shape[0] + rim, target.shape[1] + rim)
    return {
        "ours": lambda: draw(target, contrast=0.7, frame_counts=[16], rng=rng),
        "normals": lambda: rng.standard_normal(shape),
    }


def take_average(ship: str, frame_count: int) -> float:
    """Return the time [s] that the average of some frames takes, of a small window broadside."""
    image = range_image(ncti.ships.load(ship), aspect=90.0, depression=3.84, engine="auto")
    extent = range_extent(image, slant_range=SLANT_RANGE, window=LONG_WINDOW)
    signal: dict[str, Any] = {"pulse_width": 30e-9, "cnr": CNR, "target_free_ifovs": TARGET_FREE}
    for count in (1, frame_count):  # what is compiled or kept for the next call does not count
        start = time.perf_counter()
        rng = np.random.default_rng(0)
        frames = frame_blocks(extent, frame_count=count, rng=rng, **signal)
        cumulative_average(frames, [count])
    return time.perf_counter() - start


def _long_run(ship: str, frame_count: int) -> dict[str, Any]:
    """Time and memory of a long average."""
    call = f"print(take_average({ship!r}, {frame_count}))"
    run = watch([sys.executable, "-c", f"from {__name__} import *; {call}"], cores=1)
    seconds = float(run.output.split()[-1])
    return {
        "part": "average",
        "pulse_ns": 30.0,
        "frames": frame_count,
        "ms": Sample.of([seconds * 1e3]),
        "mib": Sample.of([run.largest]),
    }


def _timed(views: Sequence[Calls], repeats: int) -> dict[str, Any]:
    """Times [ms] of every call of every view, in turn, and those of ours over the others."""
    rounds: list[dict[str, float]] = []
    for _, calls in product(range(repeats + 1), views):
        rounds.append({})
        for name, call in calls.items():
            start = time.perf_counter()
            call()
            rounds[-1][name] = (time.perf_counter() - start) * 1e3
    rounds = rounds[len(views) :]
    found = {"ms": Sample.of(each["ours"] for each in rounds)}
    for name in set(rounds[0]) - {"ours"}:
        found[f"{name}_ms"] = Sample.of(each[name] for each in rounds)
        found[f"over_{name}"] = Sample.of(each["ours"] / each[name] for each in rounds)
    return found

"""Time of an infrared image by range, and of the whole infrared part of the experiment."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import product
from pathlib import Path

import numpy as np

import ncti.ships
from benchmarks.phases import timed
from benchmarks.reports import Column, Report, Sample
from benchmarks.sweeping import by_stage, choices_of, on_workers
from ncti.features import log_polar, segment
from ncti.infrared import (
    IFOV,
    SPREAD,
    SUPER_RESOLUTIONS,
    contrast,
    pixel_sigma,
    shifted_images,
    silhouette,
    thermal_images,
)
from ncti.render import range_image
from sweeps.experiment import EXPERIMENT

FRAMES, RULE = 16, 0.25
RANGES = (25e3, 50e3, 100e3)  # [m]
ASPECTS = tuple(range(0, 91, 15))  # [deg]
INFRARED_PART = ("+experiment=paper", "sensor=infrared", "classifier.name=acn")
STEPS = ("coverage", "image", "segment", "log_polar")

COLUMNS = (
    Column("range_km", "km", "g"),
    Column("super_resolution", "pixels"),
    *(Column(f"{step}_us", f"{step.replace('_', '-')} [µs]", ".0f") for step in STEPS),
    Column("per_second", "a second", ".0f"),
)


def measure(ship: str, *, repeats: int, aspects: Sequence[float] = ASPECTS) -> Report:
    """Time every step from a range image to a log-polar map.

    Parameters
    ----------
    ship : str
        Name or path.
    repeats : int
        How often every image is made.
    aspects : sequence of float
        Views [deg].

    Returns
    -------
    Report
        One row per range and resolution; images a second from the medians of all steps.
    """
    mesh = ncti.ships.load(ship)
    views = [range_image(mesh, aspect=a, depression=3.84, engine="auto") for a in aspects]
    rng = np.random.default_rng(0)
    rows = []
    for slant_range, way in product(RANGES, SUPER_RESOLUTIONS):
        footprint = IFOV * slant_range / (1 if way == "none" else 2)
        sigma = pixel_sigma(SPREAD, frame_count=FRAMES, super_resolution=way)
        warmth = contrast(slant_range)
        draw = shifted_images if way == "shifted" else thermal_images
        times: dict[str, list[float]] = {step: [] for step in STEPS}
        for _, view in product(range(repeats + 1), views):
            with _clocked(times["coverage"]):
                target = silhouette(view, footprint=footprint).target(RULE)
            with _clocked(times["image"]):
                image = draw(target, contrast=warmth, frame_counts=[FRAMES], rng=rng)[0]
            with _clocked(times["segment"]):
                mask = segment(image, contrast=warmth, target_sigma=sigma, sea_sigma=sigma)
            with _clocked(times["log_polar"]):
                log_polar(mask, interpolation="nearest")
        samples = {step: Sample.of(values[len(views) :]) for step, values in times.items()}
        rows.append(
            {
                "range_km": slant_range / 1e3,
                "super_resolution": way,
                "per_second": 1 / sum(sample.median for sample in samples.values()),
            }
            | {f"{step}_us": 1e6 * sample.median for step, sample in samples.items()}
        )
    return Report(
        f"Infrared images: {ship}, {len(aspects)} aspects, {FRAMES} frames, {repeats} times",
        COLUMNS,
        rows,
        ["Medians on one core, after one uncounted round; the range image exists already."],
    )


def measure_part(*, repeats: int, overrides: Sequence[str] = INFRARED_PART) -> Report:
    """Time the infrared part of an experiment.

    Parameters
    ----------
    repeats : int
        How often.
    overrides : sequence of str
        Arguments of `ncti-sweep` that choose the experiment and its part.

    Returns
    -------
    Report
        Work of each stage, and time of each phase, starting from the built ships only.

    Raises
    ------
    RuntimeError
        If a cell fails.
    """
    choices = choices_of(overrides)
    runs = []
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as folder:
            runs.append(timed(EXPERIMENT, choices, on_workers(Path(folder), "sweep.zarr")))
    return by_stage(
        f"Infrared part, `{' '.join(overrides)}`",
        runs,
        list(runs[0].progress)[::-1],
        ["Ships built, range images drawn anew with the first stage that reads them."],
    )


@contextmanager
def _clocked(times: list[float]) -> Iterator[None]:
    start = time.perf_counter()
    yield
    times.append(time.perf_counter() - start)

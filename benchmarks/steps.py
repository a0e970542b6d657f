"""Time of each step of the library, from a ship's mesh to the answer of a classifier."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import trimesh
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]  # of scikit-learn

import ncti.ships
from benchmarks.classifiers import CONTENDERS, FRAMES, SIGNAL, SLANT_RANGE, source_task
from benchmarks.reports import Column, Report, Sample
from benchmarks.timing import patch_constant, time_in_turn
from benchmarks.views import DEPRESSION
from ncti.features import log_polar, segment
from ncti.infrared import IFOV, SPREAD, contrast, pixel_sigma, silhouette, thermal_images
from ncti.irar import Flight, correct, fly, profile, segmented, ship_heading, ship_window
from ncti.ladar import banded_frame_moments, expected_profile, range_extent, sample_frames
from ncti.render import line_image, threads

ASPECTS = tuple(range(0, 91, 15))  # [deg]
RANGES = (25e3, 50e3, 100e3)  # of infrared images [m]
RULE = 0.25  # least share of a pixel that a ship covers
FLIGHT: dict[str, Any] = {"slant_range": 3000.0, "samples": 160, "pulse_rate": 119.0 * 160}
STERN = 175.0  # aspect of the flight [deg]

Step = tuple[str, str, list[Callable[[], object]]]
"""Part of the library, step, and a call for each view."""


def measure(ship: str, *, repeats: int) -> Report:
    """Time every step on one core.

    Parameters
    ----------
    ship : str
        Name or path.
    repeats : int
        How often.

    Returns
    -------
    Report
        A row for each step.
    """
    mesh = ncti.ships.load(ship)
    rows = []
    with threadpool_limits(1), patch_constant(threads, "thread_count", lambda: 1):
        for steps_of in (profiles, silhouettes, flights, classifiers):
            for part, step, calls in steps_of(mesh):
                ms = Sample.of((1e3 * time_in_turn(calls, repeats=repeats)).ravel().tolist())
                rows.append({"part": part, "step": step, "ms": ms})
    return Report(
        f"Steps of {ship}, {len(ASPECTS)} aspects, {repeats} times",
        (Column("part", "part"), Column("step", "step"), Column("ms", "processor [ms]", ".3g")),
        rows,
        [
            "Median (lowest–highest) of a view, after a round that is not counted. Profiles are of "
            f"30 ns at 100 km, by lines; images are of {FRAMES} frames; a flight passes at 3 km, "
            f"{STERN:g}°; classifiers learn the article's 124 views and name four averages of each."
        ],
    )


def profiles(mesh: trimesh.Trimesh) -> Iterator[Step]:
    """Yield steps of range profiles."""
    views = [partial(line_image, mesh, aspect=a, depression=DEPRESSION) for a in ASPECTS]
    yield "profile", "line image", [*views]
    extents = [partial(range_extent, view(), slant_range=SLANT_RANGE) for view in views]
    yield "profile", "range extent", [*extents]
    drawn_extents = [extent() for extent in extents]
    yield (
        "profile",
        "expected profile",
        [partial(expected_profile, extent, **SIGNAL) for extent in drawn_extents],
    )
    yield (
        "profile",
        "covariance",
        [partial(banded_frame_moments, extent, **SIGNAL) for extent in drawn_extents],
    )
    drawn = {"frame_count": FRAMES, "rng": np.random.default_rng(0), **SIGNAL}
    yield (
        "profile",
        f"{FRAMES} frames",
        [partial(sample_frames, extent, **drawn) for extent in drawn_extents],
    )


def silhouettes(mesh: trimesh.Trimesh) -> Iterator[Step]:
    """Yield steps of infrared images at each range."""
    views = [line_image(mesh, aspect=a, depression=DEPRESSION) for a in ASPECTS]
    sigma = pixel_sigma(SPREAD, frame_count=FRAMES, super_resolution="none")
    rng = np.random.default_rng(0)
    for slant_range in RANGES:
        part, warmth = f"image, {slant_range / 1e3:g} km", contrast(slant_range)

        def target(view: Any, footprint: float = IFOV * slant_range) -> Any:
            return silhouette(view, footprint=footprint).target(RULE)

        yield part, "coverage", [partial(target, view) for view in views]
        signal: dict[str, Any] = {"contrast": warmth, "frame_counts": [FRAMES], "rng": rng}
        images = [partial(thermal_images, target(view), **signal) for view in views]
        yield part, "image", [*images]
        noise: dict[str, Any] = {"contrast": warmth, "target_sigma": sigma, "sea_sigma": sigma}
        masks = [partial(segment, image()[0], **noise) for image in images]
        yield part, "segmentation", [*masks]
        maps = [partial(log_polar, mask(), interpolation="nearest") for mask in masks]
        yield part, "log-polar map", [*maps]


def flights(mesh: trimesh.Trimesh) -> Iterator[Step]:
    """Yield steps of a flight of the airborne sensor."""
    flight = Flight(ship_heading=ship_heading(aspect=STERN, sight=5.0), **FLIGHT)
    flown, rng = fly(mesh, flight), np.random.default_rng(0)
    scan, window = flown.record(rng), ship_window(mesh, flight)
    yield "flight", "rays", [lambda: fly(mesh, flight)]
    yield "flight", "speckle and noise", [lambda: flown.record(rng)]
    yield "flight", "correction", [lambda: correct(scan, window=window)]
    fine = correct(scan, window=window, overscanned=True)
    yield "flight", "profile", [lambda: profile(segmented(fine, scan.flight), scan.flight)]


def classifiers(mesh: trimesh.Trimesh) -> Iterator[Step]:
    """Yield training and answers of each classifier on the article's profiles."""
    task = source_task()
    for name, contender in CONTENDERS.items():
        yield name, "fit", [partial(contender.fit, task)]
        yield name, "predict", [partial(contender.name_ships, contender.fit(task), task)]

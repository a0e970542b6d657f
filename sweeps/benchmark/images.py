"""Time of an infrared image by range, and of the whole infrared part of the source's experiment."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import product
from pathlib import Path

import hydra
import numpy as np

import ncti.ships
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
from sweeps import graph, store
from sweeps.app import conf_folder
from sweeps.benchmark.reports import Column, Report, Sample
from sweeps.cluster import executor
from sweeps.prepare import prepare
from sweeps.schema import register
from sweeps.stages import ViewPlan

CORES, FRAMES, RULE = 2, 16, 0.25
RANGES = (25e3, 50e3, 100e3)  # [m]
ASPECTS = tuple(range(0, 91, 15))  # [deg]
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
        One row a range and resolution; images a second from the medians of all steps.
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
        ["Medians on one core, after one round that is not counted; the range image is at hand."],
    )


def measure_part(*, repeats: int, experiment: str = "paper") -> Report:
    """Time the infrared part of an experiment, with its range images at hand.

    Parameters
    ----------
    repeats : int
        How often.
    experiment : str
        Its name.

    Returns
    -------
    Report
        Seconds of the views, of the classification and of the tables, workers started before.
    """
    taken: dict[str, list[float]] = {"views": [], "classification": [], "tables": []}
    with tempfile.TemporaryDirectory() as folder:
        cache = Path(folder, "cache")
        for turn in range(repeats + 1):
            for stage in ("infrared", "silhouette"):
                shutil.rmtree(cache / stage, ignore_errors=True)
            found = _run(experiment, cache, Path(folder, f"{turn}.zarr"))
            if turn:  # the first one draws the range images
                for name, seconds in found.items():
                    taken[name].append(seconds)
    rows: list[dict[str, object]] = [
        {"part": name, "seconds": Sample.of(values)} for name, values in taken.items()
    ]
    whole = [sum(parts) for parts in zip(*taken.values(), strict=True)]
    return Report(
        f"Infrared part of `+experiment={experiment}`, {CORES} workers, {repeats} times",
        (Column("part", "part"), Column("seconds", "time [s]", ".2f")),
        [*rows, {"part": "together", "seconds": Sample.of(whole)}],
        ["Range images in the cache, everything after them made anew. Expected: under 5 s."],
    )


def _run(experiment: str, cache: Path, path: Path) -> dict[str, float]:
    """One infrared sweep; seconds of its parts."""
    register()
    overrides = [
        f"+experiment={experiment}",
        "sensor=infrared",
        "classifier.name=acn",
        f"cluster.workers={CORES}",
        f"cache={cache}",
    ]
    with hydra.initialize_config_dir(str(conf_folder()), version_base="1.3"):
        prepared = prepare(hydra.compose("config", overrides=overrides))
    config, ships = prepared.config, prepared.ships
    code = store.code_digests(config)
    plan = ViewPlan.of(config, engine=prepared.engine, cache=cache, code=code)
    store.create(path, config, ships, prepared.engine)
    taken = {}
    with executor(config.cluster, tasks=CORES) as workers:
        parts: dict[str, Callable[[], object]] = {
            "views": lambda: list(graph.run_views(workers, ships, config, plan, path)),
            "classification": lambda: list(graph.run_classification(workers, config, path)),
        }
        # Import what the tasks need, which a sweep of both sensors has paid for already.
        list(workers.run(_warm, [(i,) for i in range(4 * CORES)]))
        for name, work in parts.items():
            start = time.perf_counter()
            work()
            taken[name] = time.perf_counter() - start
    start = time.perf_counter()
    graph.write_tables(config, path)  # the workers gone, as in a sweep
    return taken | {"tables": time.perf_counter() - start}


def _warm(turn: int) -> None:
    """Make a worker import every stage."""
    import sweeps.graph  # noqa: F401

    segment(np.pad(np.ones((3, 3 + turn)), 2), method="otsu")


@contextmanager
def _clocked(times: list[float]) -> Iterator[None]:
    start = time.perf_counter()
    yield
    times.append(time.perf_counter() - start)

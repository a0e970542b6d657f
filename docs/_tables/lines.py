"""Lines against pixels and rays in the article's experiment: time and error of a view."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import trimesh
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]  # of scikit-learn

import ncti.ships
from benchmarks.classifiers import SHIPS, SLANT_RANGE
from benchmarks.methods import direct_embree, lines
from benchmarks.reports import Column, Report, Sample, cache_size, copy_rate
from benchmarks.timing import patch_constant, time_in_turn
from benchmarks.views import DEPRESSION
from ncti.ladar import RangeExtent, range_extent
from ncti.ladar.pulse import Pulse, target_kernel
from ncti.render import Sampling, drawn_range, threads
from ncti.render.choice import choose_engine
from ncti.render.far_field import reach_of
from ncti.render.view import ROLL, View
from studies.run_time.reference import reference_range_extent
from sweeps.stages.views import LINES, Render, image

ASPECTS = tuple(float(aspect) for aspect in range(0, 91, 15))  # [deg]
REFERENCE_RANGE = 1e12  # [m]: wavefronts are as flat as those of the reference
TOLERANCE = 0.002
PULSES = (10.0, 30.0)  # [ns]; a tolerance holds after the shortest
BIN_EDGES = np.arange(-125.0, 126.0)  # [m]
IFOV_SIDE = 15.0  # of an IFOV [m]
Method = tuple[str, tuple[float, ...]]
"""Engine, and `fineness` of a sweep's tolerance."""

REPEATS, RAY_REPEATS = 5, 9  # how often views are timed, and rays
END_ON = (0.5, 3.0, 10.0, 30.0, 90.0, 177.0)  # aspects, end-on views among them [deg]
SPACING = 0.25  # of lines and rays [m]

RAYS = (
    Column("aspect", "aspect [deg]", "g"),
    Column("rays_ms", "embree's rays [ms]", ".2f"),
    Column("lines_ms", "lines [ms]", ".2f"),
    Column("ratio", "lines x rays", ".2f"),
)

COLUMNS = (
    Column("way", "drawn by"),
    Column("cpu_ms", "ms a view", ".2f"),
    Column("ratio", "x pixels", ".2f"),
    *(Column(f"error_{pulse:g}", f"error, {pulse:g} ns [%]", ".2g") for pulse in PULSES),
    Column("said", f"estimated, {PULSES[0]:g} ns [%]", ".2g"),
)


def measure(
    *, repeats: int = REPEATS, ships: Sequence[str] = SHIPS, aspects: Sequence[float] = ASPECTS
) -> Report:
    """Return time and error of range extents by pixels, by lines, and by lines to a tolerance.

    Each view of `ships` and `aspects` [deg] is timed `repeats` times, the ways in turn; a row has
    medians, lowest and highest of all views.
    """
    ways = _sampling_methods()
    figures: dict[str, list[dict[str, float]]] = {way: [] for way in ways}
    with threadpool_limits(1), patch_constant(threads, "thread_count", lambda: 1):
        for mesh in map(ncti.ships.load, ships):
            for aspect in aspects:
                drawn = [
                    partial(_extent, mesh, aspect, sampling, SLANT_RANGE)
                    for sampling in ways.values()
                ]
                seconds = np.median(time_in_turn(drawn, repeats=repeats), axis=0)
                exact = reference_range_extent(
                    mesh, aspect=aspect, depression=DEPRESSION, bin_edges=BIN_EDGES
                ).area[0]
                for k, (way, sampling) in enumerate(ways.items()):
                    row = _errors(_extent(mesh, aspect, sampling, REFERENCE_RANGE), exact)
                    times = {"cpu_ms": 1e3 * seconds[k], "ratio": seconds[k] / seconds[0]}
                    figures[way].append(times | row)
    rows: list[dict[str, Any]] = [
        {"way": way} | {key: Sample.of(view[key] for view in views) for key in views[0]}
        for way, views in figures.items()
    ]
    rows[0]["said"] = None  # an image knows nothing of its error
    return Report(
        f"Lines and pixels as in `+experiment=paper`: {', '.join(ships)}, {len(aspects)} aspects, "
        f"{repeats} times",
        COLUMNS,
        rows,
        [
            f"Pixels and lines {Render.pixel.default:g} m apart, finer where a view has less than "
            f"{Render.samples.default:,} samples. Time of one processor from mesh to range extent; "
            "x pixels: view by view, in turns. Error: sum of absolute differences from the "
            "sampling-free reference over its sum, of all the ship after a pulse. Estimated: the "
            "bound that lines give themselves (`profile_error` in the store)."
        ],
    )


def measure_rays(
    *, repeats: int = RAY_REPEATS, ships: Sequence[str] = SHIPS, aspects: Sequence[float] = END_ON
) -> Report:
    """Return times of views by lines and by as many of embree's rays, end-on to abeam.

    As `measure`, with one row an aspect.
    """
    rows: list[dict[str, Any]] = []
    with threadpool_limits(1), patch_constant(threads, "thread_count", lambda: 1):
        ways = [
            (direct_embree(mesh, SPACING), lines(mesh, SPACING))
            for mesh in map(ncti.ships.load, ships)
        ]
        for aspect in aspects:
            view = View(aspect, DEPRESSION)
            seconds = [
                np.median(
                    time_in_turn([partial(way, view) for way in pair], repeats=repeats), axis=0
                )
                for pair in ways
            ]
            of_ships = {
                "rays_ms": [1e3 * rays for rays, _ in seconds],
                "lines_ms": [1e3 * by_lines for _, by_lines in seconds],
                "ratio": [by_lines / rays for rays, by_lines in seconds],
            }
            figures = {name: Sample.of(values) for name, values in of_ships.items()}
            rows.append({"aspect": aspect} | figures)
    return Report(
        f"Lines and rays {SPACING:g} m apart: {', '.join(ships)}, {repeats} times",
        RAYS,
        rows,
        [
            "Time of one processor from mesh to ranges, without bins; rays by embree alone. All "
            "edges of a ship are read for every view, so that the ratio depends on memory: "
            f"{cache_size()} of cache, {copy_rate():.0f} GB/s copied here."
        ],
    )


def _sampling_methods() -> dict[str, Method]:
    engine = choose_engine("auto")
    return {
        f"pixels ({engine})": (engine, ()),
        "lines": (LINES, ()),
        f"lines, tolerance {TOLERANCE:g}": (LINES, (TOLERANCE, min(PULSES) * 1e-9, 1.0)),
    }


def _extent(
    mesh: trimesh.Trimesh, aspect: float, sampling: Method, slant_range: float
) -> RangeExtent:
    """Return the range extent of a view, sampled as a sweep does by default."""
    engine, fineness = sampling
    view = image.function(
        mesh,
        drawn_aspect=aspect,
        depression=DEPRESSION,
        drawn_range=drawn_range(reach_of(mesh.vertices), slant_range),
        sampling=Sampling(engine, Render.pixel.default, Render.samples.default, ROLL),
        fineness=fineness,
    )
    return range_extent(view, slant_range=slant_range, ifov=IFOV_SIDE / slant_range)


def _errors(extent: RangeExtent, exact: Any) -> dict[str, float]:
    """Return the error after each pulse, and the lines' own estimate [%]; NaN for pixels."""
    area = extent.fraction.sum(axis=0) * (extent.ifov * extent.slant_range) ** 2
    errors = {"said": 100 * extent.error_after(min(PULSES) * 1e-9)}
    for pulse in PULSES:
        power = target_kernel(Pulse(pulse * 1e-9, 1.0), area.size) ** 2
        p, q = power @ area, power @ exact
        errors[f"error_{pulse:g}"] = float(100 * np.abs(p - q).sum() / q.sum())
    return errors

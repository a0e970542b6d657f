"""Time and error of one view by engine, beside code that uses other libraries directly."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np
from numpy.typing import NDArray

import ncti.ships
from benchmarks.methods import (
    Draw,
    Method,
    Seen,
    direct_embree,
    lines,
    mitsuba_rays,
    new_pyrender,
    open3d_rays,
    range_images,
    trimesh_rays,
)
from benchmarks.reports import Column, Report, Sample
from ncti.ladar.pulse import Pulse, target_kernel
from ncti.render import LineImage, available_engines
from ncti.render.view import View
from studies.run_time.reference import reference_range_extent
from sweeps.engine.run.process import ONE_THREAD, environment

DEPRESSION = 3.84  # of the article's experiment [deg]
ASPECTS = tuple(range(0, 91, 6))  # [deg]
YARDSTICK = "embree called directly"
PULSE_WIDTH = 30e-9  # [s]
EDGES = np.arange(-125.0, 126.0)  # of 1 m bins, in which every ship lies [m]

METHODS: dict[str, tuple[str, Method]] = {
    "osmesa": ("osmesa", range_images("osmesa")),
    "egl": ("egl", range_images("egl")),
    "embree": ("embree", range_images("embree")),
    "lines": ("embree", lines),
    YARDSTICK: ("embree", direct_embree),
    "Open3D RaycastingScene": ("embree", open3d_rays),
    "Mitsuba 3, llvm": ("embree", mitsuba_rays),
    "trimesh.ray": ("embree", trimesh_rays),
    "pyrender on OSMesa, anew": ("osmesa", new_pyrender("osmesa")),
    "pyrender on EGL, anew": ("egl", new_pyrender("egl")),
}
"""By name: the engine whose libraries it needs, and the function that prepares it."""

OPTIONAL = ("Open3D RaycastingScene", "Mitsuba 3, llvm")
"""Packages of the dependency group `benchmark`."""

COLUMNS = (
    Column("method", "method"),
    Column("wall_ms", "ms a view", ".3g"),
    Column("cpu_ms", "of processor", ".3g"),
    Column("ratio", "x embree", ".3g"),
    Column("no_pulse_percent", "error, no pulse [%]", ".3g"),
    Column("pulse_percent", "error, 30 ns [%]", ".3g"),
    Column("pixels", "pixels", "d"),
    Column("absent", "absent because"),
)


@dataclass(frozen=True)
class TimedView:
    """One view, drawn once by a method and once by the yardstick in the same process.

    Attributes
    ----------
    wall, cpu : float
        Wall time, and processor time of all threads of the process [s].
    yardstick : float
        Time that passed for the yardstick [s].
    profile : (bin,) float64 ndarray
        Area of the ship in each range bin [m^2].
    """

    wall: float
    cpu: float
    yardstick: float
    profile: NDArray[np.float64]


def measure(
    ship: str,
    *,
    repeats: int,
    aspects: Sequence[float] = ASPECTS,
    pixel: float = 0.25,
) -> Report:
    """Time views of a ship by every method.

    Parameters
    ----------
    ship : str
        Name or path.
    repeats : int
        How often every view is drawn.
    aspects : sequence of float
        Views [deg].
    pixel : float
        Pixel [m].

    Returns
    -------
    Report
        One row per method; a method that cannot run here has a reason instead of figures.

    Notes
    -----
    OpenGL allows one platform per process, so each method runs in a separate process, where the
    yardstick is timed before the method in every other view, and after it in the rest. Processes
    take turns view by view, so that a temporary slowdown of the machine affects all of them.
    """
    with ExitStack() as running:
        running.enter_context(environment(ONE_THREAD))  # which the processes inherit
        pools, absent = _method_processes(running, ship, pixel, aspects[0])
        timed: dict[str, list[TimedView]] = {name: [] for name in pools}
        for turn in range(repeats):
            for index, aspect in enumerate(aspects):
                for name, pool in pools.items():
                    yardstick_first = (turn + index) % 2 == 0
                    timed[name].append(
                        pool.submit(
                            _time_view, aspect, pixel, yardstick_first=yardstick_first
                        ).result()
                    )
    mesh = ncti.ships.load(ship)
    exact = [
        reference_range_extent(
            mesh, aspect=aspect, depression=DEPRESSION, bin_edges=EDGES
        ).area.sum(axis=0)
        for aspect in aspects
    ]
    rows = [
        _view_row(name, timed[name], exact * repeats, pixel)
        if name in timed
        else {"method": name, "absent": absent[name]}
        for name in METHODS
    ]
    columns = COLUMNS if absent else COLUMNS[:-1]
    return Report(
        f"Time of a view: {ship}, {len(mesh.faces)} facets, {pixel:g} m pixels, "
        f"{len(aspects)} aspects, {repeats} times",
        columns,
        rows,
        [
            "Median (lowest–highest) over views, after one that is not counted; x embree: over "
            f"{YARDSTICK!r}, drawn next to it in the same process. Error: sum of absolute "
            "differences from the sampling-free reference over its sum, of the ship's area in 1 m "
            "bins; every pixel counts in the bin of its centre. Binning is not timed.",
            "osmesa, egl and embree give range and slope in float64; embree called directly gives "
            "float32 distance. Anew is as a newcomer writes it, a scene and a renderer for every "
            "view; the depth that pyrender then returns for an orthographic camera is wrong.",
        ],
    )


def _method_processes(
    running: ExitStack, ship: str, pixel: float, aspect: float
) -> tuple[dict[str, ProcessPoolExecutor], dict[str, str]]:
    """Return a process for each method that can run here, and the reasons of the others."""
    pools: dict[str, ProcessPoolExecutor] = {}
    ready: dict[str, Future[None]] = {}
    absent: dict[str, str] = {}
    for name, (engine, _) in METHODS.items():
        if engine not in available_engines():
            absent[name] = f"no {engine} library"
            continue
        pool = running.enter_context(ProcessPoolExecutor(1, mp_context=get_context("spawn")))
        pools[name], ready[name] = pool, pool.submit(_prepare, name, ship, pixel, aspect)
    for name, prepared in ready.items():
        try:
            prepared.result()
        except ImportError as error:
            absent[name] = f"{error.name or error} is missing: dependency group benchmark"
        except Exception as error:  # any error of a graphics driver
            absent[name] = f"{type(error).__name__}: {error}"
    return {name: pool for name, pool in pools.items() if name not in absent}, absent


def _view_row(
    name: str, views: list[TimedView], exact: list[NDArray[np.float64]], pixel: float
) -> dict[str, object]:
    kernel = target_kernel(Pulse(PULSE_WIDTH, 1.0), len(EDGES) - 1) ** 2

    def errors(response: NDArray[np.float64]) -> Sample:
        pairs = zip((view.profile for view in views), exact, strict=True)
        return Sample.of(
            100 * np.abs(response @ (p - q)).sum() / (response @ q).sum() for p, q in pairs
        )

    return {
        "method": name,
        "wall_ms": Sample.of(1e3 * view.wall for view in views),
        "cpu_ms": Sample.of(1e3 * view.cpu for view in views),
        "ratio": Sample.of(view.wall / view.yardstick for view in views),
        "no_pulse_percent": errors(np.eye(len(kernel))),
        "pulse_percent": errors(kernel),
        "pixels": round(Sample.of(view.profile.sum() / pixel**2 for view in views).median),
    }


def profile_of(seen: Seen, pixel: float) -> NDArray[np.float64]:
    """Return the area [m^2] in each range bin, (bin,), of pixels in the bin of their centre."""
    if not isinstance(seen, LineImage):
        binned, _ = np.histogram(seen, EDGES)
        return binned * pixel**2
    parts = seen.bin(
        side=1e9, shift=(0.5, 0.5), near=EDGES[0], bin_width=1.0, bin_count=len(EDGES) - 1
    )
    profile: NDArray[np.float64] = parts.area.sum(axis=0)
    return profile


_draws: dict[str, Draw] = {}
"""Measured in this process: the method and the reference."""


def _prepare(name: str, ship: str, pixel: float, aspect: float) -> None:
    """Set up this process for a method, and draw once without timing."""
    mesh = ncti.ships.load(ship)
    for role, method in (("method", name), ("yardstick", YARDSTICK)):
        _, prepare = METHODS[method]
        _draws[role] = prepare(mesh, pixel)
        _draws[role](View(aspect, DEPRESSION))


def _time_view(aspect: float, pixel: float, *, yardstick_first: bool) -> TimedView:
    """Time one view in this process."""
    view = View(aspect, DEPRESSION)
    before = _stopwatch(lambda: _draws["yardstick"](view)) if yardstick_first else None
    wall, cpu, drawing = _stopwatch(lambda: _draws["method"](view))
    yardstick = before or _stopwatch(lambda: _draws["yardstick"](view))
    return TimedView(wall, cpu, yardstick[0], profile_of(drawing, pixel))


def _stopwatch(work: Callable[[], Seen]) -> tuple[float, float, Seen]:
    cpu, wall = time.process_time(), time.perf_counter()
    result = work()
    return time.perf_counter() - wall, time.process_time() - cpu, result

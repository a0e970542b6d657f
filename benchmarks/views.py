"""Time of one view by engine, beside what one would write without this library."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import product
from multiprocessing import get_context

import ncti.ships
from benchmarks.methods import (
    Method,
    Ready,
    embree_directly,
    pyrender_anew,
    range_images,
    trimesh_rays,
)
from benchmarks.reports import Column, Report, Sample
from ncti.render import View, available_engines

DEPRESSION = 3.84  # of the source's experiment [deg]
ASPECTS = tuple(range(0, 181, 15))  # [deg]
END_ON, BROADSIDE = 10, 60  # [deg] from the keel at most, and at least
YARDSTICK = "embree called directly"

METHODS: dict[str, tuple[str, Method]] = {
    "osmesa": ("osmesa", range_images("osmesa")),
    "egl": ("egl", range_images("egl")),
    "embree": ("embree", range_images("embree")),
    YARDSTICK: ("embree", embree_directly),
    "trimesh.ray": ("embree", trimesh_rays),
    "pyrender on OSMesa, anew": ("osmesa", pyrender_anew("osmesa")),
    "pyrender on EGL, anew": ("egl", pyrender_anew("egl")),
}
"""By name: the engine whose libraries it needs, and how to prepare it."""

COLUMNS = (
    Column("method", "method"),
    Column("wall_ms", "ms a view", ".3g"),
    Column("cpu_ms", "of processor", ".3g"),
    Column("ratio", "x embree", ".3g"),
    Column("end_on", "end-on", ".3g"),
    Column("broadside", "broadside", ".3g"),
    Column("pixels", "pixels", "d"),
    Column("absent", "absent because"),
)


@dataclass(frozen=True)
class Timed:
    """One view, drawn once by a method and once by the yardstick in the same process.

    Attributes
    ----------
    aspect : float
        Of the view [deg].
    wall, cpu : float
        Time that passed, and that all threads of the process computed [s].
    yardstick : float
        Time that passed for the yardstick [s].
    pixels : int
        Pixels on the ship.
    """

    aspect: float
    wall: float
    cpu: float
    yardstick: float
    pixels: int

    @property
    def off_keel(self) -> float:
        """Angle between the line of sight and the keel [deg]."""
        return min(self.aspect % 180, -self.aspect % 180)


def measure(
    names: Sequence[str],
    *,
    repeats: int,
    aspects: Sequence[float] = ASPECTS,
    pixel: float = 0.25,
) -> Report:
    """Time views of some ships by every method.

    Parameters
    ----------
    names : sequence of str
        Names or paths of the ships.
    repeats : int
        How often every view is drawn.
    aspects : sequence of float
        Views [deg].
    pixel : float
        Pixel [m].

    Returns
    -------
    Report
        One row a method; a method that cannot run here has a reason instead of figures.

    Notes
    -----
    OpenGL has one platform a process, so every method has a process of its own, in which the
    yardstick is timed beside it, before it in every other view. The processes take turns view
    by view, one at a time: what slows the machine for a while slows all of them.
    """
    absent: dict[str, str] = {}
    found: dict[str, list[Timed]] = {}
    with ExitStack() as running:
        pools: dict[str, ProcessPoolExecutor] = {}
        ready: dict[str, Future[None]] = {}
        for name, (engine, _) in METHODS.items():
            if engine not in available_engines():
                absent[name] = f"no {engine} library"
                continue
            pool = running.enter_context(ProcessPoolExecutor(1, mp_context=get_context("spawn")))
            pools[name] = pool
            ready[name] = pool.submit(_prepare, name, names, pixel, aspects[0])
        for name, prepared in ready.items():
            try:
                prepared.result()
                found[name] = []
            except Exception as error:  # whatever a graphics driver comes up with
                absent[name] = f"{type(error).__name__}: {error}"
                del pools[name]
        for turn in range(repeats):
            for place, (ship, aspect) in enumerate(product(names, aspects)):
                for name, pool in pools.items():
                    first = (turn + place) % 2 == 0
                    timing = pool.submit(_time, ship, aspect, yardstick_first=first)
                    found[name].append(timing.result())
    rows = [
        _row(name, found[name]) if name in found else {"method": name, "absent": absent[name]}
        for name in METHODS
    ]
    columns = COLUMNS if absent else COLUMNS[:-1]
    facets = ", ".join(f"{name} {len(ncti.ships.load(name).faces)}" for name in names)
    return Report(
        f"Time of a view: {pixel:g} m pixels, {len(aspects)} aspects, {repeats} times; "
        f"facets: {facets}",
        columns,
        rows,
        [
            "Median (lowest–highest) over views, after one that is not counted; x embree: over "
            f"{YARDSTICK!r}, its rays ready, drawn next to it in the same process. End-on: within "
            f"{END_ON}° of the keel; broadside: {BROADSIDE}° from it or more.",
            "osmesa, egl and embree give range and slope in float64; embree called directly gives "
            "float32 distance. Anew is as a newcomer writes it, a scene and a renderer for every "
            "view; the depth that pyrender then returns for an orthographic camera is wrong.",
        ],
    )


def _row(name: str, views: list[Timed]) -> dict[str, object]:
    return {
        "method": name,
        "wall_ms": Sample.of(1e3 * view.wall for view in views),
        "cpu_ms": Sample.of(1e3 * view.cpu for view in views),
        **{
            key: Sample.of(view.wall / view.yardstick for view in seen)
            for key, seen in (
                ("ratio", views),
                ("end_on", [view for view in views if view.off_keel <= END_ON]),
                ("broadside", [view for view in views if view.off_keel >= BROADSIDE]),
            )
            if seen
        },
        "pixels": round(Sample.of(view.pixels for view in views).median),
    }


_ready: dict[tuple[str, str], Ready] = {}
"""What this process measures, by ship: the method and the yardstick."""


def _prepare(name: str, ships: Sequence[str], pixel: float, aspect: float) -> None:
    """Set up this process for a method, and draw once without timing."""
    for ship in ships:
        mesh = ncti.ships.load(ship)
        for role, method in (("method", name), ("yardstick", YARDSTICK)):
            _, prepare = METHODS[method]
            _ready[ship, role] = prepare(mesh, pixel)
            _ready[ship, role](View(aspect, DEPRESSION))()


def _time(ship: str, aspect: float, *, yardstick_first: bool) -> Timed:
    """Time one view in this process."""
    view = View(aspect, DEPRESSION)
    method, yardstick = (_ready[ship, role](view) for role in ("method", "yardstick"))
    before = _stopwatch(yardstick) if yardstick_first else None
    wall, cpu, pixels = _stopwatch(method)
    beside = before or _stopwatch(yardstick)
    return Timed(aspect, wall, cpu, beside[0], pixels)


def _stopwatch(work: Callable[[], int]) -> tuple[float, float, int]:
    cpu, wall = time.process_time(), time.perf_counter()
    result = work()
    return time.perf_counter() - wall, time.process_time() - cpu, result

"""Time saved by skipped work: each skip beside the plain computation."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import trimesh
from manifold3d import Manifold, Mesh64
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

import ncti.ships
from benchmarks.classifiers import PASSES, Task, source_task
from benchmarks.reports import Column, Report, Sample
from benchmarks.timing import patch_constant, time_in_turn
from benchmarks.views import DEPRESSION
from ncti.classify import AdaptiveClusteringNetwork, Similarities, cluster
from ncti.infrared import contrast, silhouette, thermal_images
from ncti.ladar import RangeExtent, cumulative_average, frames, range_extent, sample_frames
from ncti.render import LineImage, draw_lines, line_image, range_image, surfaces, threads
from ncti.render.line_sweep import find_crossings, project
from ncti.render.mask import ship_mask
from ncti.render.solid import Solid
from ncti.render.surfaces import Surfaces
from ncti.render.view import ROLL, View

SLANT_RANGE = 50e3  # [m]
SIGNAL: dict[str, Any] = {"pulse_width": 30e-9, "cnr": 10**3.2}
TURNS, LONG = 20, 10.0  # rounds of both ways; seconds after which no further round begins
PREFIXES = (4, 8, 16, 32)
VIGILANCES = (0.80, 0.85, 0.90, 0.95, 0.99)
ASPECT = 40.0
VIEW: dict[str, Any] = {"aspect": ASPECT, "depression": DEPRESSION}
LOOKS = 7  # the laser radar and the imager at three ranges, and the training silhouettes
DRAWN = 3  # of them, one at each range
VIEWPOINTS = tuple(product(range(0, 360, 15), (0, 2, 5, 10, 20, 35, 50, 70, 90)))
EVERY_LINE = np.int64(0), np.int64(0)  # keep all lines
FINE = 0.0625  # m; between lines that look for facets that are never seen

Array = NDArray[Any]


@dataclass(frozen=True)
class Skip:
    """A skip and the plain way, each giving arrays.

    Attributes
    ----------
    name : str
        In the table.
    skipping, plain : callable
        The two ways.
    exact : bool
        Whether the results are equal; False if they are different draws of one distribution.
    """

    name: str
    skipping: Callable[[], Array]
    plain: Callable[[], Array]
    exact: bool = True

    def difference(self) -> float:
        """Return the largest difference of the two results over the largest number in them."""
        a, b = self.skipping(), self.plain()
        return float(np.abs(a - b).max() / np.abs(b).max())


def measure(ship: str, *, repeats: int) -> Report:
    """Time every skip against the plain way.

    Parameters
    ----------
    ship : str
        Name or path.
    repeats : int
        How often, the two ways taking turns.

    Returns
    -------
    Report
        One row per skip.
    """
    rows = []
    with threadpool_limits(1), patch_constant(threads, "thread_count", lambda: 1):
        for skip in skips(ncti.ships.load(ship), source_task()):
            ways = (skip.skipping, skip.plain)
            with_skip, without = time_in_turn(ways, repeats=TURNS * repeats, limit=LONG).T
            rows.append(
                {
                    "skip": skip.name,
                    "with_ms": Sample.of(1e3 * with_skip),
                    "without_ms": Sample.of(1e3 * without),
                    "ratio": Sample.of(without / with_skip),
                    "difference": skip.difference() if skip.exact else None,
                }
            )
    return Report(
        f"Skips: {ship}, aspect {ASPECT:g}, up to {TURNS * repeats} times",
        (
            Column("skip", "skip"),
            Column("with_ms", "ms with", ".3g"),
            Column("without_ms", "ms without", ".3g"),
            Column("ratio", "x as fast", ".3g"),
            Column("difference", "difference", ".1g"),
        ),
        rows,
        [
            "Time of the processor, on one core, after one round that is not counted. Difference: "
            "largest, over the largest number; blank where the two ways draw other noise of the "
            "same law, and where the sea hides what the plain way has below it."
        ],
    )


def skips(mesh: trimesh.Trimesh, task: Task) -> Iterator[Skip]:
    """Yield every skip of rendering a ship and of classification."""
    yield from facet_skips(mesh)
    yield from view_skips(mesh)
    extent = range_extent(line_image(mesh, **VIEW), slant_range=SLANT_RANGE)
    yield from noise_skips(extent)
    yield sea_window(line_image(mesh, **VIEW))
    yield Skip(
        f"similarity shared by {len(VIGILANCES)} vigilances",
        lambda: identify_with_shared_cosines(task),
        lambda: identify_per_vigilance(task),
    )


def identify_per_vigilance(task: Task) -> Array:
    """Return the ships named by one network per vigilance, (vigilance, test)."""
    return np.array(
        [
            AdaptiveClusteringNetwork(vigilance=vigilance, max_passes=PASSES)
            .fit(task.training, task.ship)
            .predict(task.tests)
            for vigilance in VIGILANCES
        ]
    )


def identify_with_shared_cosines(task: Task) -> Array:
    """Return the same from shared cosines, (vigilance, test)."""
    similarities = Similarities.of(task.training, task.tests)
    answers = []
    for vigilance in VIGILANCES:
        clustering = cluster(similarities, vigilance=vigilance, max_passes=PASSES)
        answers.append(clustering.majority_labels(task.ship)[clustering.match(similarities)[0]])
    return np.array(answers)


def facet_skips(mesh: trimesh.Trimesh) -> Iterator[Skip]:
    """Yield skips of facets; areas and ranges are compared line by line."""
    below = mesh.copy()
    below.vertices[:, 2] *= -1
    below.invert()
    doubled: Any = trimesh.util.concatenate([mesh, below])
    flat, deep = (prepare_surfaces(solid, merged=True) for solid in (mesh, doubled))
    yield Skip(
        "facets under water, as many as above",
        lambda: trace_lines(flat, facing_mask(flat)),
        lambda: trace_lines(deep, facing_mask(deep)),
        exact=False,  # only the plain way has the parts below the sea
    )
    single = prepare_surfaces(mesh, merged=False)  # a facet is convex: it ends only once on a line
    everything = np.ones(len(single.area), dtype=bool)
    yield Skip(
        "facets facing away",
        lambda: trace_lines(single, facing_mask(single)),
        lambda: trace_lines(single, everything),
    )
    visible = visible_mask(mesh)
    yield Skip(
        f"facets never seen ({1 - visible.mean():.1%}; not taken)",
        lambda: trace_lines(flat, facing_mask(flat) & visible),
        lambda: trace_lines(flat, facing_mask(flat)),
    )


def prepare_surfaces(mesh: trimesh.Trimesh, *, merged: bool) -> Surfaces:
    """Return the surfaces of a mesh, with coplanar facets merged or not."""
    with patch_constant(surfaces, "MAX_ANGLE", surfaces.MAX_ANGLE if merged else -1.0):
        return Surfaces._prepare(Solid.of(mesh))


def facing_mask(hull: Surfaces) -> NDArray[np.bool_]:
    """Return the mask of surfaces that face the sensor."""
    towards: NDArray[np.bool_] = hull.area @ -View(**VIEW).axes[2] > 0
    return towards


def trace_lines(hull: Surfaces, used: NDArray[np.bool_]) -> Array:
    """Return area [m] and mean range of the pieces of some surfaces on each line, (line, 2)."""
    indices = np.full(len(used) + 1, len(used), dtype=np.uint32)
    indices[:-1][used] = np.flatnonzero(used)
    axes = View(**VIEW).axes
    point, bounds = project(hull.vertices, axes, axes @ hull.centre, 0.0)
    crossings = find_crossings(
        point, bounds, hull.edge, indices, 0.25, draw_lines.PHASE, *EVERY_LINE
    )
    line, piece, _ = threads.sweep_lines(crossings, surfaces=len(used))
    line -= crossings[0]
    length = piece[:, 1] - piece[:, 0]
    sums = [
        np.bincount(line, weights) for weights in (length, length * piece[:, 2:].sum(axis=1) / 2)
    ]
    return np.stack(sums, axis=1)


def visible_mask(mesh: trimesh.Trimesh) -> NDArray[np.bool_]:
    """Return the mask of surfaces that lines see from some view around and above."""
    visible = np.zeros(len(Surfaces.of(mesh).area), dtype=bool)
    for aspect, depression in VIEWPOINTS:
        image = line_image(mesh, aspect=aspect, depression=depression, spacing=FINE)
        visible[image.surface] = True
    return visible


def view_skips(mesh: trimesh.Trimesh) -> Iterator[Skip]:
    """Yield skips of whole views."""

    def draw_images(number: int) -> Array:
        images = [range_image(mesh, **VIEW, engine="auto").down_range for _ in range(number)]
        return np.nan_to_num([images[look % number] for look in range(LOOKS)])

    yield Skip(
        f"views shared by sensors, {DRAWN} of {LOOKS}",
        lambda: draw_images(DRAWN),
        lambda: draw_images(LOOKS),
    )

    near: dict[str, Any] = VIEW | {"slant_range": SLANT_RANGE, "pixel": 0.25}
    yield Skip(
        "depth and facets of silhouettes",
        lambda: ship_mask(mesh, **near).hit.astype(float),
        lambda: range_image(mesh, **near, engine="osmesa").hit.astype(float),
    )

    twin = symmetric_ship(mesh)

    def twin_extents(sides: int, engine: str) -> Array:
        by_side = [
            range_extent(_image(twin, engine, aspect=aspect, roll=roll), slant_range=SLANT_RANGE)
            for aspect, roll in ((ASPECT, ROLL), (360 - ASPECT, -ROLL))[:sides]
        ]
        return np.stack(
            [by_side[0].fraction, (by_side[0].mirrored() if sides == 1 else by_side[1]).fraction]
        )

    for engine in ("lines", "auto"):
        yield Skip(
            f"twins to port and starboard, {engine}",
            lambda engine=engine: twin_extents(1, engine),  # type: ignore[misc]
            lambda engine=engine: twin_extents(2, engine),  # type: ignore[misc]
        )


def symmetric_ship(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return the port half of a ship and its mirror image."""
    solid = Manifold(Mesh64(np.array(mesh.vertices, "f8"), np.array(mesh.faces, "u8")))
    port, _ = solid.split_by_plane((0.0, 1.0, 0.0), 0.0)
    joined = (port + port.mirror((0.0, 1.0, 0.0))).to_mesh64()
    return trimesh.Trimesh(
        joined.vert_properties[:, :3], joined.tri_verts.astype(int), process=False
    )


def noise_skips(seen: RangeExtent) -> Iterator[Skip]:
    """Yield skips of noise."""

    def sample(target_free: int, extent: RangeExtent = seen) -> Array:
        rng = np.random.default_rng(0)
        noise: dict[str, Any] = {"target_free_ifovs": target_free, "rng": rng, **SIGNAL}
        return sample_frames(extent, frame_count=PREFIXES[-1], **noise)

    def sample_each_ifov() -> Array:
        with patch_constant(frames, "GAUSSIAN_FROM", np.inf):
            return sample(4000)

    yield Skip("IFOVs without target, 4000", lambda: sample(4000), sample_each_ifov, exact=False)
    # Fill every bin with too little to change any number.
    occupied = replace(seen, fraction=np.maximum(seen.fraction, 1e-60))
    yield Skip(
        "bins outside the target", lambda: sample(0), lambda: sample(0, occupied), exact=False
    )

    def average_prefixes(together: bool) -> Array:
        signal = {"target_free_ifovs": 4000, **SIGNAL}
        runs = [
            sample_frames(seen, frame_count=count, rng=np.random.default_rng(0), **signal)
            for count in (PREFIXES[-1:] if together else PREFIXES)
        ]
        if together:
            return cumulative_average(runs[0], PREFIXES)
        return np.stack([run.mean(axis=0) for run in runs])

    yield Skip(
        "prefixes of averages", lambda: average_prefixes(True), lambda: average_prefixes(False)
    )


def sea_window(image: LineImage) -> Skip:
    """Return the skip of images around the ship, compared on it with the default window."""

    # Half pixels at 25 km: the ship's own extent, and 200 m by 50 m.
    windows = (None, (-100.0, 100.0, -7.0, 43.0))
    cropped, full = (
        silhouette(image, footprint=1.875, extent=window).target(0.25) for window in windows
    )

    def draw_images(target: NDArray[np.bool_]) -> Array:
        rng = np.random.default_rng(0)
        images = thermal_images(target, contrast=contrast(25e3), frame_counts=PREFIXES, rng=rng)
        return images[:, target]

    return Skip(
        "sea outside the ship's window", lambda: draw_images(cropped), lambda: draw_images(full)
    )


def _image(mesh: trimesh.Trimesh, engine: str, **view: float) -> Any:
    view["depression"] = DEPRESSION
    if engine == "lines":
        return line_image(mesh, **view)
    return range_image(mesh, engine=engine, **view)

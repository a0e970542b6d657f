"""The infrared stage of a view: its images, the silhouettes in them, and what both are worth."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.features import log_polar, segment
from ncti.infrared import (
    Silhouette,
    contrast,
    coverage_of,
    detection_probability,
    enlarge,
    noise_gain,
    noise_temperature,
    reconstruction_error,
    scene_gain,
    shifted_images,
    thermal_images,
)
from sweeps.cache import Arrays, StageCache, code_digest
from sweeps.grid import InfraredGrid
from sweeps.schema import INFRARED, InfraredConfig, SceneConfig
from sweeps.seeds import cell_rng
from sweeps.stages import View, depression_at

ANGLES, RADII = 64, 32  # cells of the log-polar map
ANGLE = 360 / ANGLES * (np.arange(ANGLES) + 0.5)
RADIUS = (np.arange(RADII) + 0.5) / RADII
STEPS = 255  # values of a cell between empty and full

MARGIN = 4  # pixels of sea around the largest ship

# Steps of a sequence that fills the unit square evenly, however long it is: Roberts' R2.
PLASTIC = (0.7548776662466927, 0.5698402909980532)

Place = tuple[float, float]


def infrared_code() -> str:
    """Hash of all code between a ship and the features of its silhouette."""
    return code_digest(
        "ncti.checks",
        "ncti.render",
        "ncti.infrared",
        "ncti.features",
        "sweeps.seeds",
        "sweeps.stages",
        __name__,
    )


def image_windows(
    grid: InfraredGrid, infrared: InfraredConfig, scene: SceneConfig
) -> dict[str, NDArray[np.float64]]:
    """Where the pixels of images lie on the target [m].

    Parameters
    ----------
    grid : InfraredGrid
        Ranges and resolutions.
    infrared, scene : InfraredConfig, SceneConfig
        Detector, largest ship, and where it is seen from.

    Returns
    -------
    dict of str to ndarray
        vertical : (range, super_resolution, row), horizontal : (range, super_resolution, col);
        NaN beyond a window, which has the fewer pixels the larger they are.
    """
    lines: dict[str, list[list[NDArray[Any]]]] = {"vertical": [], "horizontal": []}
    for slant_range in grid.range:
        nowhere = np.zeros(0)
        lattice = _Lattice.of(infrared, slant_range, depression_at(slant_range, scene))
        empty = lattice.fine(nowhere, nowhere, 1.0, place=(0.0, 0.0))
        for axis, name in enumerate(lines):
            fine = empty.origin[1 - axis] + empty.footprint * np.arange(empty.coverage.shape[axis])
            coarse = fine.reshape(-1, 2).mean(axis=1)
            lines[name].append([coarse if way == "none" else fine for way in grid.super_resolution])
    return {name: _stack_padded(every) for name, every in lines.items()}


def view_images(view: View) -> Arrays:
    """Everything the infrared channel measures of a ship at one aspect.

    Parameters
    ----------
    view : View
        The ship, the aspect and the plan.

    Returns
    -------
    dict of str to ndarray
        The variables of the store's infrared group, without the axes of the view.
    """
    looks = [_Look(view, slant_range).measured() for slant_range in view.plan.infrared_grid.range]
    joined = {
        name: np.stack([look[name] for look in looks], axis)
        for name, axis in (
            ("detection_probability", 2),
            ("reconstruction_error", 2),
            ("log_polar", 5),
        )
    }
    images = _stack_padded([[look["image"]] for look in looks])[:, 0]
    training = _Look(view, view.plan.infrared.training_range)
    return joined | {"image": np.moveaxis(images, 0, 1), "template_log_polar": training.template()}


@dataclass(frozen=True)
class _Lattice:
    """Pixels of the detector on the target, and the pixels of half their side.

    Both lie on one lattice, so that an image of the one is compared with an image of the other,
    and coverage is computed once for both.
    """

    footprint: float
    extent: tuple[float, float, float, float]

    @classmethod
    def of(cls, infrared: InfraredConfig, slant_range: float, depression: float) -> _Lattice:
        """The lattice at a range [km], its window large enough for the largest ship."""
        half = infrared.window_length / 2
        sin, cos = np.sin(np.radians(depression)), np.cos(np.radians(depression))
        extent = (-half, half, -half * sin, half * sin + infrared.window_height * cos)
        return cls(infrared.ifov * 1e-6 * slant_range * 1e3, extent)

    def coarse(
        self,
        horizontal: NDArray[np.float64],
        vertical: NDArray[np.float64],
        area: float,
        *,
        place: Place,
    ) -> Silhouette:
        """Coverage of the detector's pixels, with the ship origin at a place in one."""
        return coverage_of(
            horizontal,
            vertical,
            area=area,
            footprint=self.footprint,
            phase=place,
            margin=MARGIN,
            extent=self.extent,
        )

    def fine(
        self,
        horizontal: NDArray[np.float64],
        vertical: NDArray[np.float64],
        area: float,
        *,
        place: Place,
    ) -> Silhouette:
        """Coverage of half pixels, an even number each way, pairs of which make a pixel."""
        seen = coverage_of(
            horizontal,
            vertical,
            area=area,
            footprint=self.footprint / 2,
            phase=(2 * place[0] % 1, 2 * place[1] % 1),
            margin=2 * MARGIN,
            extent=self.extent,
        )
        # Half pixel n, from the ship origin, belongs to the pixel n + whole over 2, rounded down,
        # where whole is how many half pixels the origin is from the corner of its pixel.
        before = []
        for axis in (1, 0):
            whole, phase = divmod(2 * place[axis], 1)
            first = round(seen.origin[axis] / seen.footprint - 0.5 + phase)
            before.append((first + int(whole)) % 2)
        after = tuple(
            2 - n % 2 - first for n, first in zip(seen.coverage.shape, before, strict=True)
        )
        coverage = np.pad(seen.coverage, tuple(zip(before, after, strict=True)))
        origin = (
            seen.origin[0] - before[1] * seen.footprint,
            seen.origin[1] - before[0] * seen.footprint,
        )
        return Silhouette(coverage=coverage, footprint=seen.footprint, origin=origin)


@dataclass(frozen=True)
class _Look:
    """One ship at one aspect and one range [km]."""

    view: View
    slant_range: float

    def measured(self) -> Arrays:
        """Images of the first phase, and what is made of the images of every phase."""
        return self._fetch("infrared", self._measure, without=("training_range",))

    def template(self) -> NDArray[np.uint8]:
        """(coverage_rule, inner_radius, interpolation, phase, angle, radius): noiseless maps."""
        return self._fetch("silhouette", self._make_template, without=("frame_count",))["maps"]

    def _fetch(self, stage: str, make: Callable[[], Arrays], *, without: tuple[str, ...]) -> Arrays:
        plan = self.view.plan
        known = asdict(plan.infrared) | asdict(plan.infrared_grid)
        for key in ("order", "orders", "vigilance", *without):
            known.pop(key, None)
        known["range"] = self.slant_range
        inputs = {
            "code": plan.code[INFRARED],
            "image": self.view.image_inputs(self.slant_range),
            "ship": self.view.ship.label,
            "infrared": known,
            "seed": plan.seed,
        }
        return StageCache(plan.cache).fetch(stage, inputs, make)

    @cached_property
    def _lattice(self) -> _Lattice:
        plan = self.view.plan
        depression = depression_at(self.slant_range, plan.scene)
        return _Lattice.of(plan.infrared, self.slant_range, depression)

    def _make_template(self) -> Arrays:
        grid = self.view.plan.infrared_grid
        points = self.view.points(self.slant_range)
        # Evenly spread places on the detector, the first with the ship origin on a corner.
        silhouettes = [
            self._lattice.coarse(*points, place=(k * PLASTIC[0] % 1, k * PLASTIC[1] % 1))
            for k in grid.phase
        ]
        maps = [
            # Without noise every threshold cuts out the same.
            _map(segment(seen.target(rule).astype(np.float64), method="otsu"), inner, way)
            for rule, inner, way, seen in product(
                grid.coverage_rule, grid.inner_radius, grid.interpolation, silhouettes
            )
        ]
        axes = (grid.coverage_rule, grid.inner_radius, grid.interpolation, grid.phase)
        return {"maps": np.reshape(maps, (*map(len, axes), ANGLES, RADII))}

    def _measure(self) -> Arrays:
        grid = self.view.plan.infrared_grid
        cells = [[self._measure_once(rule, k) for k in grid.phase] for rule in grid.coverage_rule]
        measured = {
            name: np.stack([np.stack([cell[name] for cell in row], axis) for row in cells])
            for name, axis in (
                ("detection_probability", 0),
                ("reconstruction_error", 0),
                ("log_polar", 3),
            )
        }
        return measured | {"image": np.stack([row[0]["image"] for row in cells])}

    def _measure_once(self, rule: float, phase: int) -> Arrays:
        """Images at one place on the detector, and what is made of them.

        Returns
        -------
        dict of str to ndarray
            image : (super_resolution, frame_count, row, col), detection_probability :
            (frame_count,), reconstruction_error : (super_resolution, frame_count), log_polar :
            (segmentation, inner_radius, interpolation, super_resolution, frame_count, angle,
            radius)
        """
        plan = self.view.plan
        grid, infrared = plan.infrared_grid, plan.infrared
        cell: dict[str, Any] = {
            "ship": self.view.ship.label,
            "aspect": self.view.aspect,
            "range": self.slant_range,
            "phase": phase,
        }
        place = cell_rng(plan.seed, stage="infrared_place", **cell).random(2)
        covered = self._lattice.fine(*self.view.points(self.slant_range), place=tuple(place))
        fine = covered.target(rule)
        rows, cols = covered.coverage.shape
        pixels = covered.coverage.reshape(rows // 2, 2, cols // 2, 2).mean(axis=(1, 3))
        coarse = pixels >= rule
        warmth = contrast(
            self.slant_range * 1e3,
            contrast_at_zero=infrared.contrast_at_zero,
            extinction=infrared.extinction * 1e-3,
        )
        images, errors, maps = [], [], []
        for way in grid.super_resolution:
            synthesise = shifted_images if way == "shifted" else thermal_images
            image = synthesise(
                coarse if way == "none" else fine,
                contrast=warmth,
                frame_counts=grid.frame_count,
                rng=cell_rng(plan.seed, stage="infrared", super_resolution=way, **cell),
                nedt=infrared.nedt,
                target_spread=infrared.target_spread,
                sea_spread=infrared.sea_spread,
            )
            images.append(image)
            finer = enlarge(image) if way == "none" else image
            errors.append(
                reconstruction_error(finer, fine, contrast=warmth)
                if warmth > 0
                else np.full(len(image), np.nan)
            )
            maps.append(
                [
                    self._maps(one, warmth, frames, way)
                    for one, frames in zip(image, grid.frame_count, strict=True)
                ]
            )
        detected = [
            detection_probability(
                coarse,
                contrast=warmth,
                target_sigma=np.hypot(infrared.target_spread, noise),
                sea_sigma=np.hypot(infrared.sea_spread, noise),
                false_alarm=infrared.false_alarm,
            )
            for noise in noise_temperature(np.array(grid.frame_count), nedt=infrared.nedt)
        ]
        # (super_resolution, frame_count, segmentation, ...) to (segmentation, ...)
        return {
            "image": _stack_padded([images])[0].astype(np.float32),
            "detection_probability": np.array(detected, dtype=np.float32),
            "reconstruction_error": np.array(errors, dtype=np.float32),
            "log_polar": np.moveaxis(np.array(maps), (0, 1), (3, 4)),
        }

    def _maps(
        self, image: NDArray[np.float64], warmth: float, frame_count: int, way: str
    ) -> list[list[list[NDArray[np.uint8]]]]:
        """Log-polar maps of an image, by segmentation, inner radius and interpolation."""
        grid, infrared = self.view.plan.infrared_grid, self.view.plan.infrared
        noise = noise_temperature(frame_count, nedt=infrared.nedt)
        gains = (scene_gain(), noise_gain()) if way == "shifted" else (1.0, 1.0)
        known = {
            f"{name}_sigma": math.hypot(gains[0] * spread, gains[1] * noise)
            for name, spread in (("target", infrared.target_spread), ("sea", infrared.sea_spread))
        }
        cut = [
            segment(image, method=method, contrast=warmth, **known) for method in grid.segmentation
        ]
        return [
            [[_map(mask, inner, way) for way in grid.interpolation] for inner in grid.inner_radius]
            for mask in cut
        ]


def _map(mask: NDArray[np.bool_], inner_radius: float, interpolation: str) -> NDArray[np.uint8]:
    """Log-polar map in steps of a 255th, which halves of a per cent of a cell do not outweigh."""
    cells = log_polar(
        mask,
        inner_radius=inner_radius,
        interpolation=interpolation,
        angles=ANGLES,
        radii=RADII,
    )
    return np.rint(STEPS * cells).astype(np.uint8)


def _stack_padded(rows: list[list[Any]]) -> NDArray[np.float64]:
    """Arrays whose last axes differ in length as one array, NaN where one is shorter."""
    every = [np.asarray(array) for row in rows for array in row]
    dims = max(array.ndim for array in every)
    lengths = [max(array.shape[axis] for array in every) for axis in range(dims)]

    def padded(array: NDArray[np.float64]) -> NDArray[np.float64]:
        missing = [(0, length - n) for length, n in zip(lengths, array.shape, strict=True)]
        return np.pad(array, missing, constant_values=np.nan)

    return np.array([[padded(np.asarray(array)) for array in row] for row in rows])

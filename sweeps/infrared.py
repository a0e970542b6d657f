"""The infrared stage of a view: its images, the silhouettes in them, and what both are worth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
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
    pixel_sigma,
    reconstruction_error,
    shifted_images,
    thermal_images,
)
from sweeps.cache import Arrays, StageCache, code_digest
from sweeps.grid import InfraredGrid
from sweeps.schema import INFRARED, SceneConfig
from sweeps.seeds import cell_rng
from sweeps.sensor_schema import InfraredConfig
from sweeps.stages import View, depression_at

ANGLES, RADII = 64, 32  # cells of the log-polar map
ANGLE = 360 / ANGLES * (np.arange(ANGLES) + 0.5)
RADIUS = (np.arange(RADII) + 0.5) / RADII
STEPS = 255  # values of a cell between empty and full

MARGIN = 4  # pixels of sea around a ship
LEAST_CONTRAST = 1e-6  # K, below which images have no error worth the name

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
        empty = _whole_window(infrared, slant_range, scene, place=(0.0, 0.0))
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
    looks = [_Look(view, slant_range) for slant_range in view.plan.infrared_grid.range]
    measured = [look.measured() for look in looks]
    joined = {
        name: np.stack([found[name] for found in measured], axis)
        for name, axis in (
            ("detection_probability", 2),
            ("reconstruction_error", 2),
            ("log_polar", 5),
        )
    }
    images = _stack_padded(
        [[look.in_window(found) for look, found in zip(looks, measured, strict=True)]]
    )[0]
    training = _Look(view, view.plan.infrared.training_range)
    return joined | {"image": np.moveaxis(images, 2, 0), "template_log_polar": training.template()}


def _whole_window(
    infrared: InfraredConfig, slant_range: float, scene: SceneConfig, *, place: Place
) -> Silhouette:
    """Half pixels of a window for the largest ship at a range [km], all of them sea."""
    half = infrared.window_length / 2
    depression = np.radians(depression_at(slant_range, scene))
    top = half * np.sin(depression) + infrared.window_height * np.cos(depression)
    nowhere = np.zeros(0)
    return coverage_of(
        nowhere,
        nowhere,
        area=1.0,
        footprint=infrared.ifov * 1e-6 * slant_range * 1e3,
        phase=place,
        margin=MARGIN,
        extent=(-half, half, -half * np.sin(depression), top),
        subdivision=2,
    )


@dataclass(frozen=True)
class _Look:
    """One ship at one aspect and one range [km].

    Only the ship and a margin of sea around it are ever synthesised: what lies further off
    changes nothing on the ship.
    """

    view: View
    slant_range: float

    def measured(self) -> Arrays:
        """Images of the first place on the detector, and what is made of the images of each.

        Returns
        -------
        dict of str to ndarray
            image.<super-resolution> : (coverage_rule, frame_count, row, col),
            detection_probability : (coverage_rule, phase, frame_count), reconstruction_error :
            (coverage_rule, phase, super_resolution, frame_count), log_polar : (coverage_rule,
            segmentation, inner_radius, interpolation, phase, super_resolution, frame_count,
            angle, radius)
        """
        plan = self.view.plan
        keys = ("super_resolution", "frame_count", "segmentation")
        of_sensor = ("contrast_at_zero", "extinction", "nedt", "target_spread", "sea_spread")
        inputs = {
            **self._silhouette_inputs(),
            **{key: getattr(plan.infrared_grid, key) for key in keys},
            **{key: getattr(plan.infrared, key) for key in (*of_sensor, "false_alarm")},
            "ship": self.view.ship.label,  # names its noise
            "seed": plan.seed,
        }
        return StageCache(plan.cache).fetch("infrared", inputs, self._measure)

    def template(self) -> NDArray[np.uint8]:
        """(coverage_rule, inner_radius, interpolation, phase, angle, radius): noiseless maps."""
        cache = StageCache(self.view.plan.cache)
        return cache.fetch("silhouette", self._silhouette_inputs(), self._make_template)["maps"]

    def in_window(self, found: Arrays) -> NDArray[np.float32]:
        """(super_resolution, coverage_rule, frame_count, row, col): measured images in the window
        of the largest ship, NaN where nothing was synthesised."""
        plan = self.view.plan
        whole = _whole_window(plan.infrared, self.slant_range, plan.scene, place=self._places[0])
        ours = found["origin"]
        first = [round((ours[k] - whole.origin[k]) / whole.footprint) for k in (1, 0)]
        images = []
        for way in plan.infrared_grid.super_resolution:
            image = found[f"image.{way}"]
            cells = 2 if way == "none" else 1
            rows, cols = (n // cells for n in whole.coverage.shape)
            row, col = (n // cells for n in first)
            placed = np.full((*image.shape[:2], rows, cols), np.nan, dtype=np.float32)
            # The ship's window may end with a pixel of sea that the whole one does not hold.
            image = image[..., : rows - row, : cols - col]
            placed[..., row : row + image.shape[2], col : col + image.shape[3]] = image
            images.append(placed)
        return _stack_padded([images])[0]

    def _silhouette_inputs(self) -> dict[str, Any]:
        """All that the silhouettes on the detector and their maps depend on."""
        plan = self.view.plan
        keys = ("coverage_rule", "inner_radius", "interpolation", "phase")
        return {
            "code": plan.code[INFRARED],
            "image": self.view.image_inputs(self.slant_range),
            "range": self.slant_range,
            "ifov": plan.infrared.ifov,
            **{key: getattr(plan.infrared_grid, key) for key in keys},
        }

    @cached_property
    def _name(self) -> dict[str, Any]:
        """What names the noise of this look."""
        return {
            "ship": self.view.ship.label,
            "aspect": self.view.aspect,
            "range": self.slant_range,
        }

    @cached_property
    def _places(self) -> list[Place]:
        """Where in a pixel of the detector the ship origin lies, for every phase."""
        rng = cell_rng(self.view.plan.seed, stage="infrared_place", **self._name)
        return [(across, up) for across, up in rng.random((len(self._phases), 2)).tolist()]

    @property
    def _phases(self) -> tuple[int, ...]:
        """Numbers of the phases, from 0: more of them leave the first as they are."""
        return self.view.plan.infrared_grid.phase

    def _coverage(self, place: Place, *, subdivision: int) -> Silhouette:
        horizontal, vertical, area = self.view.points(self.slant_range)
        return coverage_of(
            horizontal,
            vertical,
            area=area,
            footprint=self.view.plan.infrared.ifov * 1e-6 * self.slant_range * 1e3,
            phase=place,
            margin=MARGIN,
            extent=self._extent,
            subdivision=subdivision,
        )

    @cached_property
    def _extent(self) -> tuple[float, float, float, float]:
        """The ship's bounding box, for windows of one shape at all places on the detector."""
        horizontal, vertical, _ = self.view.points(self.slant_range)
        ends = (horizontal.min(), horizontal.max(), vertical.min(), vertical.max())
        return tuple(float(end) for end in ends)  # type: ignore[return-value]

    def _make_template(self) -> Arrays:
        grid = self.view.plan.infrared_grid
        # Evenly spread places on the detector, the first with the ship origin on a corner.
        covered = [
            self._coverage((k * PLASTIC[0] % 1, k * PLASTIC[1] % 1), subdivision=1)
            for k in self._phases
        ]
        maps = [
            # Without noise every threshold cuts out the same.
            _maps(segment([seen.target(rule) for seen in covered], method="otsu"), grid)
            for rule in grid.coverage_rule
        ]
        return {"maps": np.array(maps)}

    def _measure(self) -> Arrays:
        covered = [self._coverage(place, subdivision=2) for place in self._places]
        rules = self.view.plan.infrared_grid.coverage_rule
        cells = [self._measure_template(covered, rule) for rule in rules]
        found = {name: np.stack([cell[name] for cell in cells]) for name in cells[0]}
        return found | {"origin": np.array(covered[0].origin)}

    def _measure_template(self, covered: list[Silhouette], rule: float) -> Arrays:
        """What `measured` returns, of one coverage rule."""
        plan = self.view.plan
        grid, infrared = plan.infrared_grid, plan.infrared
        fine = np.array([seen.target(rule) for seen in covered])
        phases, rows, cols = fine.shape
        halves = np.array([seen.coverage for seen in covered])
        pixels = halves.reshape(phases, rows // 2, 2, cols // 2, 2).mean(axis=(2, 4))
        coarse = pixels >= rule
        warmth = contrast(
            self.slant_range * 1e3,
            contrast_at_zero=infrared.contrast_at_zero,
            extinction=infrared.extinction * 1e-3,
        )
        images = {
            way: self._synthesise(way, coarse if way == "none" else fine, warmth)
            for way in grid.super_resolution
        }
        errors = np.full((phases, len(images), len(grid.frame_count)), np.nan)
        if warmth >= LEAST_CONTRAST:  # else there is nothing to be a fraction of
            for k, (way, image) in enumerate(images.items()):
                finer = enlarge(image) if way == "none" else image
                for phase in self._phases:
                    errors[phase, k] = reconstruction_error(
                        finer[phase], fine[phase], contrast=warmth
                    )
        sizes = {way: image.shape for way, image in images.items()}
        maps = [
            # Images of one size are cut and mapped in one go.
            self._cut({way: images[way] for way in same}, warmth)
            for _, same in groupby(images, key=sizes.__getitem__)
        ]
        return {f"image.{way}": image[0].astype(np.float32) for way, image in images.items()} | {
            "detection_probability": self._detected(coarse, warmth).astype(np.float32),
            "reconstruction_error": errors.astype(np.float32),
            # (segmentation, inner_radius, interpolation, super_resolution, phase, ...)
            "log_polar": np.swapaxes(np.concatenate(maps, axis=3), 3, 4),
        }

    def _synthesise(
        self, way: str, target: NDArray[np.bool_], warmth: float
    ) -> NDArray[np.float64]:
        """(phase, frame_count, row, col): images of the ship at every place on the detector."""
        plan = self.view.plan
        infrared = plan.infrared
        draw = shifted_images if way == "shifted" else thermal_images
        # One stream for all phases, one after the other.
        rng = cell_rng(plan.seed, stage="infrared", super_resolution=way, **self._name)
        return np.array(
            [
                draw(
                    ship,
                    contrast=warmth,
                    frame_counts=plan.infrared_grid.frame_count,
                    rng=rng,
                    nedt=infrared.nedt,
                    target_spread=infrared.target_spread,
                    sea_spread=infrared.sea_spread,
                )
                for ship in target
            ]
        )

    def _cut(self, images: Mapping[str, NDArray[np.float64]], warmth: float) -> NDArray[np.uint8]:
        """Maps of images of one size, by super-resolution.

        Returns
        -------
        (segmentation, inner_radius, interpolation, super_resolution, phase, frame_count, angle,
        radius) uint8 ndarray
        """
        grid, infrared = self.view.plan.infrared_grid, self.view.plan.infrared
        known = {
            f"{name}_sigma": np.array(
                [
                    pixel_sigma(
                        spread,
                        frame_count=np.array(grid.frame_count),
                        nedt=infrared.nedt,
                        super_resolution=way,
                    )
                    for way in images
                ]
            )[:, None]
            for name, spread in (("target", infrared.target_spread), ("sea", infrared.sea_spread))
        }
        shown = np.array(list(images.values()))
        cut = [
            segment(shown, method=method, contrast=warmth, **known) for method in grid.segmentation
        ]
        return np.array([_maps(mask, grid) for mask in cut])

    def _detected(self, target: NDArray[np.bool_], warmth: float) -> NDArray[np.float64]:
        """(phase, frame_count): probability that a pixel of the ship passes the threshold."""
        grid, infrared = self.view.plan.infrared_grid, self.view.plan.infrared
        sigmas = [
            pixel_sigma(spread, frame_count=np.array(grid.frame_count), nedt=infrared.nedt)
            for spread in (infrared.target_spread, infrared.sea_spread)
        ]
        return np.array(
            [
                [
                    detection_probability(
                        int(count),
                        contrast=warmth,
                        target_sigma=target_sigma,
                        sea_sigma=sea_sigma,
                        false_alarm=infrared.false_alarm,
                    )
                    for target_sigma, sea_sigma in zip(*sigmas, strict=True)
                ]
                for count in np.count_nonzero(target, axis=(1, 2))
            ]
        )


def _maps(masks: NDArray[np.bool_], grid: InfraredGrid) -> NDArray[np.uint8]:
    """(inner_radius, interpolation, ..., angle, radius): maps of masks, in steps of a 255th.

    The values of a cell are shares of it; half a step is nothing beside what a pixel's noise does.
    """
    cells = np.array(
        [
            [
                log_polar(
                    masks,
                    inner_radius=inner_radius,
                    interpolation=interpolation,
                    angles=ANGLES,
                    radii=RADII,
                )
                for interpolation in grid.interpolation
            ]
            for inner_radius in grid.inner_radius
        ]
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

"""Targets of a search: ships and decoys at random aspects and places in the field."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.infrared import footprint
from ncti.ladar import RangeExtent, bin_centres, range_extent
from ncti.render import Sampling
from studies.scan.field import Box, Pixels, elevation

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True, eq=False)
class Target:
    """A ship or decoy in the field, at an `aspect` [deg].

    `offset` is its bearing within its slot, from -1 to 1 of the free width; `extent` counts from
    its origin.
    """

    aspect: float
    offset: float
    extent: RangeExtent

    def visible_pixels(self, rule: float) -> NDArray[np.int64]:
        """Return the pixels (pixel, 2) filled to at least a share, counted from its origin."""
        return self.extent.cell[self.extent.fraction.sum(axis=1) >= rule]

    def extent_in(self, box: Box) -> RangeExtent:
        """Return its range extent in the IFOVs of a box, both counted from its origin."""
        mask = box.holds(self.extent.cell)
        parts = {"fraction": self.extent.fraction[mask], "cell": self.extent.cell[mask]}
        return RangeExtent(**{**vars(self.extent), **parts})


@dataclass(frozen=True, kw_only=True)
class Survey:
    """Middle of a field, and the sensor parameters common to its targets.

    `slant_range` [m] and `depression` [deg] lead to the middle, and `depth` [1] is the largest
    relative difference of a range. Targets are at most `length` across and `height` up [m]. `ifov`
    [rad], `bin_width` [m], `window` [m] and `spread` are those of `ncti.ladar.range_extent`.
    """

    slant_range: float
    depression: float
    depth: float
    length: float
    height: float
    ifov: float
    bin_width: float
    window: float
    spread: float
    sampling: Sampling

    @property
    def reach(self) -> tuple[int, int]:
        """Largest extent of a target across and up [IFOV]."""
        side = footprint(self.slant_range, self.ifov) * (1 - self.depth)
        return math.ceil(self.length / side), math.ceil(self.height / side)

    def elevation(self, slant_range: float) -> float:
        """Return the elevation of a target at a slant range [m] from the middle [rad]."""
        down = math.radians(self.depression)
        return elevation(slant_range, middle_range=self.slant_range, depression=down)

    def target(
        self, mesh: trimesh.Trimesh, aspects: tuple[float, ...], rng: np.random.Generator
    ) -> Target:
        """Return a ship at a random place and aspect, between the extremes of `aspects` [deg]."""
        aspect = float(rng.uniform(min(aspects), max(aspects)))
        offset, deep = rng.uniform(-1, 1, 2).tolist()
        far = self.slant_range * (1 + self.depth * deep)
        below = math.degrees(math.radians(self.depression) - self.elevation(far))
        image = self.sampling.draw(mesh, aspect=aspect, depression=below, slant_range=far)
        extent = range_extent(
            image,
            slant_range=far,
            ifov=self.ifov,
            bin_width=self.bin_width,
            window=self.window,
            spread=self.spread,
        )
        # In the precision of the cache, so that a cached target equals a new one.
        fraction = extent.fraction.astype(np.float32)
        return self.restore(
            {"true_aspect": aspect, "offset": offset, "slant_range": far}
            | {"fraction": fraction, "cell": extent.cell}
        )

    def arrays(self, target: Target) -> dict[str, NDArray[Any]]:
        """Return a target as arrays of one shape for all, with empty IFOVs at the end."""
        extent = target.extent
        empty = ((0, (self.reach[0] + 1) * (self.reach[1] + 1) - len(extent.cell)), (0, 0))
        return {
            "true_aspect": np.array(target.aspect),
            "offset": np.array(target.offset),
            "slant_range": np.array(extent.slant_range),
            "fraction": np.pad(extent.fraction, empty).astype(np.float32),
            "cell": np.pad(extent.cell, empty),
        }

    def restore(self, arrays: Mapping[str, Any]) -> Target:
        """Return the target of some `arrays`, without its empty IFOVs."""
        visible = arrays["fraction"].any(axis=1)
        extent = RangeExtent(
            fraction=arrays["fraction"][visible].astype(np.float64),
            down_range=bin_centres(self.window, self.bin_width),
            bin_width=self.bin_width,
            cell=arrays["cell"][visible].astype(np.int64),
            ifov=self.ifov,
            slant_range=float(arrays["slant_range"]),
        )
        return Target(float(arrays["true_aspect"]), float(arrays["offset"]), extent)


@lru_cache(maxsize=4)
def box(length: float, beam: float, height: float) -> trimesh.Trimesh:
    """Return a floating box as a decoy, sides in metres, its origin amidships on the waterline."""
    import trimesh

    solid = trimesh.creation.box(extents=(length, beam, height))
    solid.apply_translation((0.0, 0.0, height / 2))
    return solid


def owner(pixels: Pixels, targets: NDArray[np.integer]) -> int:
    """Return the number of the target with the most pixels of a detection; -1 if all are sea.

    `pixels` (pixel, 2) are columns and rows; `targets` (row, column) is negative on the sea.
    """
    of_targets = targets[pixels[:, 1], pixels[:, 0]]
    counts = np.bincount(of_targets[of_targets >= 0])
    return int(counts.argmax()) if counts.size else -1

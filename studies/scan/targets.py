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
    """A ship or decoy in the field.

    Attributes
    ----------
    aspect : float
        Aspect [deg].
    offset : float
        Bearing within its slot, from -1 to 1 of what the slot leaves free.
    extent : RangeExtent
        What the laser radar sees of it, counted from its origin.

    See Also
    --------
    Survey.target : Returns one.

    Examples
    --------
    >>> import numpy as np
    >>> from studies.scan import Survey, box
    >>> from ncti.render import Sampling
    >>> survey = Survey(
    ...     slant_range=50e3, depression=3.84, depth=0.05, length=200.0, height=50.0, ifov=150e-6,
    ...     bin_width=1.0, window=250.0, spread=0.5, sampling=Sampling("lines", 1.0, 0, 30.0))
    >>> barge = survey.target(box(120.0, 20.0, 8.0), (0.0, 90.0), np.random.default_rng(0))
    >>> len(barge.shown(0.25)) <= len(barge.extent.cell)
    True
    """

    aspect: float
    offset: float
    extent: RangeExtent

    def shown(self, rule: float) -> NDArray[np.int64]:
        """Return (pixel, 2) pixels of which it fills at least a share, counted from its origin."""
        return self.extent.cell[self.extent.fraction.sum(axis=1) >= rule]

    def inside(self, box: Box) -> RangeExtent:
        """Return what the IFOVs of a box see of it; the box counts from its origin."""
        held = box.holds(self.extent.cell)
        parts = {"fraction": self.extent.fraction[held], "cell": self.extent.cell[held]}
        return RangeExtent(**{**vars(self.extent), **parts})


@dataclass(frozen=True, kw_only=True)
class Survey:
    """Middle of a field, and the sensor parameters common to its targets.

    Attributes
    ----------
    slant_range : float
        Sensor to the middle of the field [m].
    depression : float
        Depression of the line of sight to it [deg].
    depth : float
        Share of the range by which targets are nearer or farther.
    length, height : float
        Largest extent of a target across and up [m].
    ifov, bin_width, window, spread : float
        Binning of range extents, as of `ncti.ladar.range_extent` [rad, m, m, 1].
    sampling : Sampling
        Sampling of views.

    See Also
    --------
    Target : A ship of the field.

    Examples
    --------
    See `Target`.

    >>> from studies.scan import Survey
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
        if not down:
            return 0.0
        return elevation(slant_range, middle_range=self.slant_range, depression=down)

    def target(
        self, mesh: trimesh.Trimesh, aspects: tuple[float, ...], rng: np.random.Generator
    ) -> Target:
        """Return a ship at a random place, its aspect within the range of some [deg]."""
        aspect = float(rng.uniform(min(aspects), max(aspects)))
        offset, deep = rng.uniform(-1, 1, 2).tolist()
        far = self.slant_range * (1 + self.depth * deep)
        below = math.degrees(math.radians(self.depression) - self.elevation(far))
        image = self.sampling.draw(mesh, aspect=aspect, depression=below, slant_range=far)
        seen = range_extent(
            image,
            slant_range=far,
            ifov=self.ifov,
            bin_width=self.bin_width,
            window=self.window,
            spread=self.spread,
        )
        # In the precision that it is kept in, so that what is kept is the same.
        fraction = seen.fraction.astype(np.float32)
        return self.restored(
            {"true_aspect": aspect, "offset": offset, "slant_range": far}
            | {"fraction": fraction, "cell": seen.cell}
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

    def restored(self, arrays: Mapping[str, Any]) -> Target:
        """Return the target of some `arrays`, without its empty IFOVs."""
        seen = arrays["fraction"].any(axis=1)
        extent = RangeExtent(
            fraction=arrays["fraction"][seen].astype(np.float64),
            down_range=bin_centres(self.window, self.bin_width),
            bin_width=self.bin_width,
            cell=arrays["cell"][seen].astype(np.int64),
            ifov=self.ifov,
            slant_range=float(arrays["slant_range"]),
        )
        return Target(float(arrays["true_aspect"]), float(arrays["offset"]), extent)


@lru_cache(maxsize=4)
def box(length: float, beam: float, height: float) -> trimesh.Trimesh:
    """Return a box that floats: a barge, as a decoy.

    Parameters
    ----------
    length, beam, height : float
        Sides of the box [m].

    Returns
    -------
    trimesh.Trimesh
        Its origin is amidships on the waterline.

    See Also
    --------
    Survey.target : The box in a field.

    Examples
    --------
    >>> from studies.scan import box
    >>> box(120.0, 20.0, 8.0).bounds.tolist()
    [[-60.0, -10.0, 0.0], [60.0, 10.0, 8.0]]
    """
    import trimesh  # takes long

    solid = trimesh.creation.box(extents=(length, beam, height))
    solid.apply_translation((0.0, 0.0, height / 2))
    return solid


def owner(pixels: Pixels, targets: NDArray[np.integer]) -> int:
    """Return the target with the most pixels of a detection; -1 where all are of the sea.

    Parameters
    ----------
    pixels : (pixel, 2) int64 ndarray
        Column and row of the pixels of a detection.
    targets : (row, column) int ndarray
        Number of the target that each pixel of the field shows, negative for the sea.

    Returns
    -------
    int
        Its number.

    See Also
    --------
    detect : Detections of a field.

    Examples
    --------
    >>> import numpy as np
    >>> from studies.scan import owner
    >>> owner(np.array([[0, 0], [1, 0], [2, 0]]), np.array([[-1, 1, 1, 0]]))
    1
    """
    of_targets = targets[pixels[:, 1], pixels[:, 0]]
    counts = np.bincount(of_targets[of_targets >= 0])
    return int(counts.argmax()) if counts.size else -1

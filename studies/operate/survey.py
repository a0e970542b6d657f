"""Learned and tested views of a ship, and their range extents."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.ladar.extent import range_extent
from ncti.render import LineImage, line_image

if TYPE_CHECKING:
    import trimesh

Floats = NDArray[np.float64]

PLACES = ((0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75))
"""Places of the ship origin in its IFOV, right and up [IFOV], that templates have in turn."""

DRAWN_FOR = 100e3
"""Slant range [m] at which extents are computed: it sets only their wavefront curvature, since
views are drawn in the far field."""


@dataclass(frozen=True, eq=False)
class ViewExtents:
    """Range extents of several views of a ship, without empty bins; all attributes are arrays.

    `fraction` (sample,) is the projected area visible in a range bin of an IFOV over the IFOV's
    area, `range_bin` (sample,) that bin, `samples` (ifov,) the number of these entries in each
    IFOV, `cell` (ifov, 2) its column and row, with the ship origin in (0, 0), and `ifovs` (view,)
    the number of IFOVs that see the ship.
    """

    fraction: NDArray[np.float32]
    range_bin: NDArray[np.int16]
    samples: NDArray[np.int32]
    cell: NDArray[np.int16]
    ifovs: NDArray[np.int32]

    @property
    def coverage(self) -> Floats:
        """(ifov,) float64 ndarray: the share of each IFOV that the ship fills."""
        of_ifov = np.repeat(np.arange(self.samples.size), self.samples)
        return np.bincount(of_ifov, self.fraction, self.samples.size).astype(np.float64)

    @property
    def view(self) -> NDArray[np.intp]:
        """(ifov,) intp ndarray: the view of each IFOV."""
        return np.repeat(np.arange(self.ifovs.size), self.ifovs)


def random_views(
    low: float, high: float, count: int, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Return aspects (view,) [deg], uniform from `low` to `high`, and places (view, 2) in [0, 1).

    A place is that of the ship origin in its IFOV, right and up from the corner. The first views do
    not depend on `count`, unlike those of `grid.random_aspects`, which fill every bin of aspect.
    """
    drawn = rng.random((count, 3))
    return low + (high - low) * drawn[:, 0], drawn[:, 1:]


def draw_views(
    mesh: trimesh.Trimesh, aspects: ArrayLike, *, depression: float = 3.84, spacing: float = 0.25
) -> list[LineImage]:
    """Return the line images of a ship in the far field at several aspects [deg].

    `depression` is that of the line of sight [deg], and the lines are `spacing` [m] apart on the
    target.
    """
    angles = np.asarray(aspects, dtype=np.float64).tolist()
    return [line_image(mesh, aspect=a, depression=depression, spacing=spacing) for a in angles]


def seen_views(
    views: Sequence[LineImage],
    places: ArrayLike,
    *,
    footprint: float,
    bin_width: float = 1.0,
    window: float = 250.0,
    reflectance: str = "projected_area",
) -> ViewExtents:
    """Return the range extents of several far-field views, in IFOVs of one `footprint` [m].

    `places` (view, 2) are those of the ship origin in its IFOV, right and up from the corner
    [IFOV]. Slant range and IFOV enter by their product, the footprint, alone: parallax and the
    curvature of the wavefront, 0.1 m at 25 km across half a ship, are ignored in learned and tested
    views.
    """
    fraction, range_bins, samples, cells, ifovs = [], [], [], [], []
    for view, shift in zip(views, np.asarray(places).tolist(), strict=True):
        extent = range_extent(
            view,
            slant_range=DRAWN_FOR,
            ifov=footprint / DRAWN_FOR,
            bin_width=bin_width,
            window=window,
            reflectance=reflectance,
            shift=(shift[0], shift[1]),
        )
        ifov, bins = np.nonzero(extent.fraction)
        fraction.append(extent.fraction[ifov, bins])
        range_bins.append(bins)
        samples.append(np.bincount(ifov, minlength=len(extent.cell)))
        cells.append(extent.cell)
        ifovs.append(len(extent.cell))
    return ViewExtents(
        np.concatenate(fraction).astype(np.float32),
        np.concatenate(range_bins).astype(np.int16),
        np.concatenate(samples).astype(np.int32),
        np.concatenate(cells).astype(np.int16),
        np.array(ifovs, dtype=np.int32),
    )

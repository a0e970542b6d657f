"""Views of a ship that are learned and tested, and what the IFOVs see of it in all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all, require_generator
from ncti.ladar.extent import range_extent
from ncti.render import LineImage, line_image

if TYPE_CHECKING:
    import trimesh

Floats = NDArray[np.float64]

PLACES = ((0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75))
"""Places of the ship origin in its IFOV, right and up [IFOV], that templates have in turn."""

DRAWN_FOR = 100e3
"""Slant range [m] whose wavefront curvature extents have: views are those of the far field."""


@dataclass(frozen=True, eq=False)
class Seen:
    """Range extents of several views of a ship, without the bins in which nothing is seen.

    All attributes are arrays, so that `vars` of it can be kept in a file.

    Attributes
    ----------
    fraction : (sample,) float32 ndarray
        Visible projected area in a range bin of an IFOV, over the area of the IFOV.
    place : (sample,) int16 ndarray
        Its range bin.
    samples : (ifov,) int32 ndarray
        Number of samples of each IFOV.
    cell : (ifov, 2) int16 ndarray
        Column and row of each IFOV; the ship origin lies in cell (0, 0).
    ifovs : (view,) int32 ndarray
        Number of IFOVs that see the ship in each view.

    See Also
    --------
    seen_views : Makes it.

    Examples
    --------
    >>> import trimesh
    >>> from studies.operate import draw_views, seen_views
    >>> box = trimesh.creation.box((100, 12, 10)).apply_translation((0, 0, 5))
    >>> views = draw_views(box, [0.0, 90.0], spacing=1.0)
    >>> seen = seen_views(views, [(0.5, 0.5), (0.5, 0.5)], footprint=15.0)
    >>> seen.ifovs.tolist()
    [2, 14]
    >>> print(f"{seen.coverage[2:].sum() * 15**2:.0f} m^2")
    1078 m^2
    """

    fraction: NDArray[np.float32]
    place: NDArray[np.int16]
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
    """Return random views: aspects between two ends, and places of the ship origin in its IFOV.

    Parameters
    ----------
    low, high : float
        Ends of the aspects [deg].
    count : int
        Number of views; the first are the same for any number.
    rng : numpy.random.Generator
        Source of all random numbers.

    Returns
    -------
    aspect : (view,) float64 ndarray
        Aspects [deg], uniform between the ends.
    place : (view, 2) float64 ndarray
        Places right and up from the corner of the IFOV, uniform in [0, 1).

    Raises
    ------
    ValueError
        If an end is not a finite number, the count is below 1, or `rng` is not a generator.

    See Also
    --------
    seen_views : What IFOVs see of them.

    Examples
    --------
    >>> import numpy as np
    >>> from studies.operate import random_views
    >>> aspect, place = random_views(0, 90, 3, np.random.default_rng(0))
    >>> aspect.shape, place.shape
    ((3,), (3, 2))
    """
    require("low", low)
    require("high", high, minimum=low)
    require("count", count, minimum=1, whole=True)
    require_generator("rng", rng)
    drawn = rng.random((count, 3))
    return low + (high - low) * drawn[:, 0], drawn[:, 1:]


def draw_views(
    mesh: trimesh.Trimesh, aspects: ArrayLike, *, depression: float = 3.84, spacing: float = 0.25
) -> list[LineImage]:
    """Return the visible pieces along lines of several views of a ship in the far field.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        Ship in the ship frame.
    aspects : (view,) array_like
        Aspects [deg].
    depression : float
        Depression of the line of sight [deg].
    spacing : float
        Distance of the lines on the target [m].

    Returns
    -------
    list of LineImage
        A view for each aspect.

    Raises
    ------
    ValueError
        If a parameter is out of range.

    See Also
    --------
    ncti.render.line_image : One view.

    Examples
    --------
    >>> import trimesh
    >>> from studies.operate import draw_views
    >>> len(draw_views(trimesh.creation.box((40, 8, 6)), [0, 45, 90], spacing=1.0))
    3
    """
    several = require_all("aspects", aspects).ravel().tolist()
    return [line_image(mesh, aspect=a, depression=depression, spacing=spacing) for a in several]


def seen_views(
    views: Sequence[LineImage],
    places: ArrayLike,
    *,
    footprint: float,
    bin_width: float = 1.0,
    window: float = 250.0,
    reflectance: str = "projected_area",
) -> Seen:
    """Return what IFOVs of a given size on the target see of a ship in several views.

    Parameters
    ----------
    views : sequence of LineImage
        Views of the ship in the far field.
    places : (view, 2) array_like
        Places of the ship origin in its IFOV, right and up from the corner [IFOV].
    footprint : float
        Side of an IFOV on the target [m].
    bin_width, window, reflectance
        As of `ncti.ladar.range_extent`.

    Returns
    -------
    Seen
        What each IFOV sees, view by view.

    Raises
    ------
    ValueError
        If a parameter is out of range, or there is not a place for each view.

    See Also
    --------
    ncti.ladar.range_extent : The extent of one view.

    Notes
    -----
    Slant range and IFOV enter by their product alone, the footprint: parallax and the wavefront's
    curvature, 0.1 m at 25 km across half a ship, are left out alike of what is learned and tested.

    Examples
    --------
    See `Seen`.
    """
    where = require_all("places", places)
    if where.shape != (len(views), 2):
        raise ValueError(f"places has shape {where.shape}, but must be ({len(views)}, 2)")
    require("footprint", footprint, positive=True)
    fraction, place, samples, cells, ifovs = [], [], [], [], []
    for view, shift in zip(views, where.tolist(), strict=True):
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
        place.append(bins)
        samples.append(np.bincount(ifov, minlength=len(extent.cell)))
        cells.append(extent.cell)
        ifovs.append(len(extent.cell))
    return Seen(
        np.concatenate(fraction).astype(np.float32),
        np.concatenate(place).astype(np.int16),
        np.concatenate(samples).astype(np.int32),
        np.concatenate(cells).astype(np.int16),
        np.array(ifovs, dtype=np.int32),
    )

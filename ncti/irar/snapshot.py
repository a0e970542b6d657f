"""Images of the ship at one moment: their windows, and the true image."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require
from ncti.irar.flight import Flight
from ncti.irar.receiver import mean_return
from ncti.irar.scene import RAYS, Returns, brightness_of
from ncti.render import cast_rays

if TYPE_CHECKING:
    import trimesh

Floats = NDArray[np.float64]

RAYS_AT_ONCE = 500_000
"""Rays per block of a true image, which may have tens of millions."""


@dataclass(frozen=True)
class Window:
    """Pixels of a corrected image.

    Attributes
    ----------
    bottom, left : int
        Row and column of the first pixel, from the line of sight to the ship's origin.
    rows, columns : int
        Number of rows and columns.

    See Also
    --------
    ship_window : Window around a ship.

    Examples
    --------
    >>> Window(bottom=-6, left=-9, rows=30, columns=19).rows
    30
    """

    bottom: int
    left: int
    rows: int
    columns: int

    def padded(self, rows: int, columns: int) -> Window:
        """Return the window with `rows` rows and `columns` columns added on either side."""
        return Window(
            self.bottom - rows,
            self.left - columns,
            self.rows + 2 * rows,
            self.columns + 2 * columns,
        )


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A corrected image: the ship as seen from the aircraft at one moment.

    Attributes
    ----------
    window : Window
        Pixels of the image, squares of one IFOV.
    row, column : (row,) and (column,) float64 ndarray
        Centres of rows and columns [pixel]; rows are closer than a pixel in an overscanned image.
    intensity : (row, column) float64 ndarray
        Mean of the looks, in noise powers; NaN where there is no look.
    range : (row, column) float64 ndarray
        Range [m]; NaN where there is none.
    infrared : (row, column) float64 ndarray
        Apparent temperature above the sea [K], NaN where there is no look; in the truth the
        fraction of ship.
    looks : (row, column) intp ndarray
        Number of samples averaged.

    See Also
    --------
    correct : Make a snapshot from a scan.
    true_snapshot : The snapshot that a correction should give.

    Examples
    --------
    >>> import numpy as np
    >>> unit = np.ones((1, 1))
    >>> image = Snapshot(
    ...     window=Window(bottom=0, left=0, rows=1, columns=1),
    ...     row=np.zeros(1),
    ...     column=np.zeros(1),
    ...     intensity=100 * unit,
    ...     range=3.9e3 * unit,
    ...     infrared=1.4 * unit,
    ...     looks=unit.astype(int),
    ... )
    >>> image.intensity.shape
    (1, 1)
    """

    window: Window
    row: Floats
    column: Floats
    intensity: Floats
    range: Floats
    infrared: Floats
    looks: NDArray[np.intp]

    @property
    def ship_pixels(self) -> ShipPixels:
        """Pixels that show the ship: those with a range and a return."""
        row, column = np.nonzero(np.isfinite(self.range) & (self.intensity > 0))
        height, width = (
            float(places[1] - places[0]) if len(places) > 1 else 1.0
            for places in (self.row, self.column)
        )
        values = self.intensity[row, column], self.range[row, column]
        return ShipPixels(self.row[row], self.column[column], *values, height, width)


@dataclass(frozen=True, eq=False)
class ShipPixels:
    """Pixels of a segmented image that show the ship.

    All attributes are arrays and numbers, so that `vars` of it can be stored in a file.

    Attributes
    ----------
    row, column : (pixel,) float64 ndarray
        Their centres [pixel].
    intensity : (pixel,) float64 ndarray
        Mean of the looks, in noise powers.
    range : (pixel,) float64 ndarray
        Range [m].
    height, width : float
        Distance between rows and between columns [pixel].

    See Also
    --------
    Snapshot.ship_pixels : Returns them.
    measured_extent : Range extent of them.

    Examples
    --------
    >>> import numpy as np
    >>> from ncti.irar import ShipPixels
    >>> pixel = np.ones(1)
    >>> ShipPixels(0 * pixel, 0 * pixel, 100 * pixel, 3.9e3 * pixel).range
    array([3900.])
    """

    row: Floats
    column: Floats
    intensity: Floats
    range: Floats
    height: float = 1.0
    width: float = 1.0


def centres(first: int, count: int, cells: int) -> Floats:
    """Return centres of pixels cut into cells, (count * cells,), from pixel `first` [pixel]."""
    return first - 0.5 + (np.arange(count * cells, dtype=np.float64) + 0.5) / cells


def window_of(row: Floats, column: Floats) -> Window:
    """Return the window that contains samples at given places."""
    bottom, left = math.floor(row.min() + 0.5), math.floor(column.min() + 0.5)
    top, right = math.floor(row.max() + 0.5), math.floor(column.max() + 0.5)
    return Window(bottom, left, top - bottom + 1, right - left + 1)


def ship_window(mesh: trimesh.Trimesh, flight: Flight, *, margin: int = 3) -> Window:
    """Return the window that a ship fills in the snapshot.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        The ship, in its frame.
    flight : Flight
        The pass.
    margin : int
        Pixels of sea around the ship.

    Returns
    -------
    Window
        Pixels of the ship and the margin.

    See Also
    --------
    correct : Correct a scan within this window.

    Examples
    --------
    >>> import trimesh
    >>> from ncti.irar import ship_heading
    >>> box = trimesh.creation.box((40, 10, 14)).apply_translation((0, 0, 7))
    >>> flight = Flight(slant_range=4e3, ship_heading=ship_heading(aspect=180, sight=5))
    >>> ship_window(box, flight)
    Window(bottom=-6, left=-9, rows=30, columns=19)
    """
    right, up, away = flight.snapshot_axes @ np.asarray(mesh.vertices, dtype=np.float64).T
    scale = flight.ifov * (flight.slant_range + away)
    return window_of(up / scale, right / scale).padded(margin, margin)


def true_snapshot(
    mesh: trimesh.Trimesh,
    flight: Flight,
    window: Window,
    *,
    reflectivity: Floats | None = None,
    lambertian: bool = False,
    cells: int = 1,
) -> Snapshot:
    """Return the image that a correction should give: the noiseless view at time 0.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        The ship, in its frame.
    flight : Flight
        The pass.
    window : Window
        Pixels of the result.
    reflectivity, lambertian
        As for `fly`.
    cells : int
        Looks along each side of a pixel, evenly distributed, each of which sees an IFOV, as the
        sensor does. With a multiple of the rays of a look (5 a side), edges fall between the same
        rays in every look: 8 cells resolve an edge better than 10.

    Returns
    -------
    Snapshot
        Image of `cells` times the window's rows and columns; infrared is the fraction of ship.

    Raises
    ------
    ValueError
        If a reflectivity is negative or missing, or the cells are not a whole number from 1 to 64.

    See Also
    --------
    fly : Simulate the pass.
    tilts : Compare a corrected image with the truth.

    Examples
    --------
    The projected area of a box at 6.7 deg of depression, 10 (14 cos 6.7 deg + 40 sin 6.7 deg) = 186
    m^2:

    >>> import trimesh
    >>> from ncti.irar import ship_heading
    >>> box = trimesh.creation.box((40, 10, 14)).apply_translation((0, 0, 7))
    >>> flight = Flight(slant_range=4e3, ship_heading=ship_heading(aspect=180, sight=5))
    >>> truth = true_snapshot(box, flight, ship_window(box, flight))
    >>> print(f"{truth.infrared.sum() * flight.pixel**2:.0f} m^2")
    185 m^2
    """
    require("cells", cells, whole=True, minimum=1, maximum=64)
    brightness = brightness_of(mesh, reflectivity, lambertian=lambertian)
    row = centres(window.bottom, window.rows, cells)
    column = centres(window.left, window.columns, cells)
    ray_offset = (np.arange(RAYS) - (RAYS - 1) / 2) / RAYS
    parts = []
    block = max(1, RAYS_AT_ONCE // (len(column) * RAYS**2))
    for first in range(0, len(row), block):
        # Directions of the rays of each look in the snapshot's axes, then in the ship's.
        up, right = np.broadcast_arrays(
            row[first : first + block, None, None, None] + ray_offset[:, None],
            column[:, None, None] + ray_offset,
        )
        image = np.stack([right * flight.ifov, up * flight.ifov, np.ones_like(up)], axis=-1)
        image /= np.linalg.norm(image, axis=-1, keepdims=True)
        ways = (image @ flight.snapshot_axes).reshape(-1, 3)
        start = np.broadcast_to(flight.position(np.zeros(())), ways.shape)
        hits = cast_rays(mesh, start, ways)
        place, ray = np.divmod(hits.ray, RAYS**2)
        shape = up.shape[:2]
        power = brightness(hits) / RAYS**2
        returns = Returns(shape, place, ray, hits.distance, power, RAYS**2)
        parts.append((*mean_return(returns, flight=flight), returns.coverage()))
    intensity, ranges, covered = map(np.concatenate, zip(*parts, strict=True))
    looks = np.ones(intensity.shape, dtype=np.intp)
    return Snapshot(window, row, column, intensity.astype(np.float64), ranges, covered, looks)

"""Images of the ship from one moment: how they are framed, and what the truth looks like."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require
from ncti.irar.flight import Flight
from ncti.irar.receiver import noiseless
from ncti.irar.scene import RAYS, Returns, brightness_of
from ncti.render import cast_rays

if TYPE_CHECKING:
    import trimesh

Floats = NDArray[np.float64]

RAYS_AT_ONCE = 500_000
"""Bounds the memory of a truth, whose rays may be tens of millions."""


@dataclass(frozen=True)
class Window:
    """Pixels of a corrected image.

    Attributes
    ----------
    bottom, left : int
        Row and column of its first pixel, from the line of sight to the ship's origin.
    rows, columns : int
        How many there are.
    """

    bottom: int
    left: int
    rows: int
    columns: int


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A corrected image: the ship as from the aircraft at one moment.

    Attributes
    ----------
    window : Window
        Its pixels, square, of one IFOV.
    row, column : (row,) and (column,) float64 ndarray
        Centres of its rows and columns [pixel]; rows are closer than a pixel where it is still
        overscanned.
    intensity : (row, column) float64 ndarray
        Mean of the looks, in noise powers; NaN where there is no look.
    range : (row, column) float64 ndarray
        [m]; NaN where there is no range.
    infrared : (row, column) float64 ndarray
        Apparent temperature over the sea's [K], NaN where there is no look; of the truth the share
        of ship.
    looks : (row, column) intp ndarray
        Samples averaged.
    """

    window: Window
    row: Floats
    column: Floats
    intensity: Floats
    range: Floats
    infrared: Floats
    looks: NDArray[np.intp]


def centres(first: int, count: int, cells: int) -> Floats:
    """(count * cells,) centres of pixels, each cut into cells, the first pixel's at `first`."""
    return first - 0.5 + (np.arange(count * cells, dtype=np.float64) + 0.5) / cells


def window_of(row: Floats, column: Floats) -> Window:
    """The pixels that samples at some places fill."""
    bottom, left = math.floor(row.min() + 0.5), math.floor(column.min() + 0.5)
    top, right = math.floor(row.max() + 0.5), math.floor(column.max() + 0.5)
    return Window(bottom, left, top - bottom + 1, right - left + 1)


def ship_window(mesh: trimesh.Trimesh, flight: Flight, *, margin: int = 3) -> Window:
    """The pixels that a ship fills in the snapshot.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        The ship, in its frame.
    flight : Flight
        The pass.
    margin : int
        Pixels of sea around it.

    Returns
    -------
    Window
    """
    right, up, away = flight.snapshot_axes @ np.asarray(mesh.vertices, dtype=np.float64).T
    scale = flight.ifov * (flight.slant_range + away)
    ends = window_of(up / scale, right / scale)
    return Window(
        ends.bottom - margin, ends.left - margin, ends.rows + 2 * margin, ends.columns + 2 * margin
    )


def true_snapshot(
    mesh: trimesh.Trimesh,
    flight: Flight,
    window: Window,
    *,
    reflectivity: Floats | None = None,
    lambertian: bool = False,
    cells: int = 1,
) -> Snapshot:
    """What a correction should give: the noiseless view from the snapshot's place itself.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        The ship, in its frame.
    flight : Flight
        The pass.
    window : Window
        Pixels of the result.
    reflectivity, lambertian
        As for `scan_scene`.
    cells : int
        Looks along each side of a pixel, evenly spread over it, each of which sees an IFOV, as the
        sensor does. Of multiples of the rays of a look, edges fall between the same rays in every
        look: 8 tell an edge's place better than 10.

    Returns
    -------
    Snapshot
        Of `cells` times the window's rows and columns; infrared is the share of ship.

    Raises
    ------
    ValueError
        As `scan_scene`, or if the cells are not a whole number from 1 to 64.
    """
    require("cells", cells, whole=True, minimum=1, maximum=64)
    brightness = brightness_of(mesh, reflectivity, lambertian=lambertian)
    row = centres(window.bottom, window.rows, cells)
    column = centres(window.left, window.columns, cells)
    part = (np.arange(RAYS) - (RAYS - 1) / 2) / RAYS
    parts = []
    block = max(1, RAYS_AT_ONCE // (len(column) * RAYS**2))
    for first in range(0, len(row), block):
        up, right = np.broadcast_arrays(
            row[first : first + block, None, None, None] + part[:, None],
            column[:, None, None] + part,
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
        parts.append((*noiseless(returns, flight=flight), returns.coverage()))
    intensity, ranges, covered = map(np.concatenate, zip(*parts, strict=True))
    looks = np.ones(intensity.shape, dtype=np.intp)
    return Snapshot(window, row, column, intensity.astype(np.float64), ranges, covered, looks)

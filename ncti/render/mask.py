"""Pixels that show a ship, as OpenGL's rasteriser fills them, without a depth pass.

A pixel shows the ship if any facet that faces the sensor covers its centre, whichever is the
nearest: silhouettes need neither depth nor facets.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require
from ncti.compiled import compiled
from ncti.render import pixels
from ncti.render.solid import SNAP, Solid
from ncti.render.view import ROLL, Lattice, View, clip_matrix

if TYPE_CHECKING:
    import trimesh

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

EXACT = 1e-6
"""Margin [pixel] above the rounding of a facet's borders, whose corners are multiples of 1/256."""


@dataclass(frozen=True, eq=False)
class Mask:
    """Pixels that show a ship, on the lattice of `RangeImage`.

    Attributes
    ----------
    hit : (row, col) bool ndarray
        True where the line of sight meets the ship.
    pixel, origin, roll
        As of `RangeImage`.
    """

    hit: NDArray[np.bool_]
    pixel: float
    origin: tuple[float, float]
    roll: float


def ship_mask(
    mesh: trimesh.Trimesh,
    *,
    aspect: float,
    depression: float,
    pixel: float,
    roll: float = ROLL,
    slant_range: float | None = None,
) -> Mask:
    """Return the pixels of `ncti.render.range_image` that show a ship.

    Parameters
    ----------
    mesh, aspect, depression, pixel, roll, slant_range
        As of `range_image`.

    Returns
    -------
    Mask
        The hits of the range image that OSMesa draws, in a fraction of the time.

    Raises
    ------
    ValueError
        As of `range_image`.

    Notes
    -----
    Mesa places vertices in float32 and snaps them to 1/256 pixel. A centre on a border belongs to
    the facet on its right, or above it if the border is level. All of this is done alike, so that
    masks agree to the last pixel, except for how a processor or a release of Mesa may round.

    Examples
    --------
    The side of a box of 40 m by 6 m, in pixels of 0.5 m:

    >>> import trimesh
    >>> from ncti.render.mask import ship_mask
    >>> box = trimesh.creation.box((40.0, 8.0, 6.0))
    >>> int(ship_mask(box, aspect=90, depression=0, pixel=0.5, roll=0).hit.sum())
    960
    """
    require("pixel", pixel, positive=True)
    view = View.checked(aspect=aspect, depression=depression, roll=roll, slant_range=slant_range)
    solid = Solid.of(mesh)
    lattice = Lattice.around(solid.along(view), view, float(pixel))
    clip = clip_matrix(view, lattice, centre=solid.centre).astype(np.float32)
    corners = snapped(solid.vertices.astype(np.float32), clip, lattice.shape)
    hit = np.zeros(lattice.shape, np.bool_)
    fill(corners, solid.faces, pixels.sampled(corners, solid.faces, EXACT), hit)
    return Mask(hit, lattice.pixel, lattice.origin, view.roll)


@compiled
def snapped(vertices: Singles, clip: Singles, shape: tuple[int, int]) -> Floats:
    """Return (vertex, 2) places of vertices, in pixels from the centre of pixel [0, 0].

    Parameters
    ----------
    vertices : (vertex, 3) float32 ndarray
        Vertices relative to the centre of the solid [m].
    clip : (4, 4) float32 ndarray
        From there to clip coordinates.
    shape : (int, int)
        Rows and columns of the image.
    """
    places = np.empty((len(vertices), 2))
    for i in range(len(vertices)):
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        w = clip[3, 0] * x + clip[3, 1] * y + clip[3, 2] * z + clip[3, 3]
        nearer = np.float32(1.0) / w
        for axis in range(2):
            along = clip[axis, 0] * x + clip[axis, 1] * y + clip[axis, 2] * z + clip[axis, 3]
            # The viewport: a product and a sum that are rounded together.
            half = 0.5 * shape[1 - axis]
            window = np.float32(np.float64(along * nearer) * half + half)
            places[i, axis] = np.rint(np.float64(window - np.float32(0.5)) * (1 / SNAP)) * SNAP
    return places


@compiled
def fill(
    corners: Floats,
    faces: NDArray[np.int32],
    chosen: NDArray[np.int32],
    hit: NDArray[np.bool_],
) -> None:
    """Set the pixels whose centre is within a facet that faces the sensor.

    Parameters
    ----------
    corners : (vertex, 2) float64 ndarray
        Places of vertices, multiples of 1/256 pixel: then products are exact, and so is the order
        of a border and a centre.
    faces : (facet, 3) int32 ndarray
        Vertices of each facet, counter-clockwise from outside.
    chosen : (number,) int32 ndarray
        Facets to draw.
    hit : (row, col) bool ndarray
        Written.
    """
    rows, columns = hit.shape
    x, y = np.empty(4), np.empty(4)
    for f in chosen:
        for c in range(4):
            corner = faces[f, c % 3]
            x[c], y[c] = corners[corner, 0], corners[corner, 1]
        if (x[1] - x[0]) * (y[2] - y[0]) <= (y[1] - y[0]) * (x[2] - x[0]):
            continue  # seen from behind, or edge-on
        lowest = np.ceil(max(min(y[0], min(y[1], y[2])), 0.0))
        highest = np.floor(min(max(y[0], max(y[1], y[2])), rows - 1.0))
        for row in range(int(lowest), int(highest) + 1):
            # Columns between the sides: one that rises bounds the facet on the right.
            first, past = 0.0, float(columns)
            for c in range(3):
                run, rise = x[c + 1] - x[c], y[c + 1] - y[c]
                if rise == 0.0:
                    if y[c] == row and run < 0.0:  # its upper border
                        past = 0.0
                    continue
                border = np.ceil(x[c] + (row - y[c]) * run / rise)
                if rise > 0.0:
                    past = min(past, border)
                else:
                    first = max(first, border)
            for column in range(int(first), int(past)):
                hit[row, column] = True

"""Pixels that show a ship, as OpenGL's rasteriser fills them, without a depth pass.

A pixel shows the ship if any facet that faces the sensor covers its centre: silhouettes need
neither depth nor facets.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require
from ncti.compiled import compiled
from ncti.render import pixels
from ncti.render.solid import SNAP, Solid
from ncti.render.view import ROLL, Lattice, View, clip_matrix
from ncti.ships.shape import Mesh

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

BORDER_MARGIN = 1e-6
"""Margin [pixel] above the rounding of a facet's borders, whose corners are multiples of 1/256."""


@dataclass(frozen=True, eq=False)
class Mask:
    """Pixels `hit` (row, col) that show a ship, on the lattice of `RangeImage`."""

    hit: NDArray[np.bool_]
    pixel: float
    origin: tuple[float, float]
    roll: float


def ship_mask(
    mesh: Mesh,
    *,
    aspect: float,
    depression: float,
    pixel: float,
    roll: float = ROLL,
    slant_range: float | None = None,
) -> Mask:
    """Return the hits of the range image that OSMesa draws, in a fraction of the time.

    Arguments are as of `ncti.render.range_image`. Mesa places vertices in float32 and snaps them to
    1/256 pixel; a centre on a border belongs to the facet on its right, or above if the border is
    level. The same steps here make masks agree to the last pixel, except for the rounding of other
    processors or releases of Mesa.
    """
    require("pixel", pixel, positive=True)
    view = View.checked(aspect=aspect, depression=depression, roll=roll, slant_range=slant_range)
    solid = Solid.of(mesh)
    lattice = Lattice.around(solid.view_coordinates(view), view, float(pixel))
    clip = clip_matrix(view, lattice, centre=solid.centre).astype(np.float32)
    corners = snap_vertices(solid.vertices.astype(np.float32), clip, lattice.shape)
    hit = np.zeros(lattice.shape, np.bool_)
    fill(corners, solid.faces, pixels.sampled_facets(corners, solid.faces, BORDER_MARGIN), hit)
    return Mask(hit, lattice.pixel, lattice.origin, view.roll)


@compiled
def snap_vertices(vertices: Singles, clip: Singles, shape: tuple[int, int]) -> Floats:
    """Return (vertex, 2) positions of vertices, in pixels from the centre of pixel [0, 0].

    `vertices` (vertex, 3) are relative to the centre of the solid, in metres; `clip` (4, 4) leads
    to clip coordinates.
    """
    places = np.empty((len(vertices), 2))
    for i in range(len(vertices)):
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        w = clip[3, 0] * x + clip[3, 1] * y + clip[3, 2] * z + clip[3, 3]
        nearer = np.float32(1.0) / w
        for axis in range(2):
            along = clip[axis, 0] * x + clip[axis, 1] * y + clip[axis, 2] * z + clip[axis, 3]
            # The viewport transform: one rounding for product and sum.
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
    """Set the pixels of `hit` (row, col) whose centre is within a facet that faces the sensor.

    `corners` (vertex, 2) are multiples of 1/256 pixel, which makes products, and so the side of a
    border on which a centre lies, exact. `faces` (facet, 3) are counter-clockwise from outside,
    `chosen` (number,) those to draw.
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
            first, past = columns_between_sides(x, y, row)
            for column in range(int(first), int(min(past, columns))):
                hit[row, column] = True


@compiled
def columns_between_sides(x: Floats, y: Floats, row: int) -> tuple[float, float]:
    """Return the first column of a facet in a row, and the one past its last; at least 0.

    `x` and `y` (4,) are its corners, the first again at the end.
    """
    first, past = 0.0, np.inf
    for c in range(3):
        run, rise = x[c + 1] - x[c], y[c + 1] - y[c]
        if rise == 0.0:
            if y[c] == row and run < 0.0:  # its upper border
                past = 0.0
            continue
        border = np.ceil(x[c] + (row - y[c]) * run / rise)
        # A rising side bounds the facet on the right.
        if rise > 0.0:
            past = min(past, border)
        else:
            first = max(first, border)
    return first, past

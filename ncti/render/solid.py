"""Facets of a ship as arrays, and range and slope of the points that pixels see on them."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from ncti.render.view import Lattice, View
from ncti.ships.shape import Mesh

CACHED_SOLIDS = 8
"""Ships kept, here and on a canvas: the six packaged ones and two of the user's."""

MIN_COSINE = 1e-4
"""Smallest cosine of incidence that is not edge-on. A steeper facet is narrower than the grid of a
rasteriser and seen by chance; the bound keeps its slope finite."""

STEEP_COSINE = 0.1
"""Cosine of incidence below which the place of a facet's border on that grid matters: at slope 10,
half a step of the grid, 1/512 pixel, is 5 mm of range with 0.25 m pixels."""


@dataclass(frozen=True, eq=False)
class Solid:
    """Facets of a closed mesh, with their planes.

    `centre` (3,) [m] is the middle of the bounding box, in the ship frame; `vertices` (vertex, 3)
    [m] are relative to it, so that engines may round them to float32; `faces` (facet, 3) are
    counter-clockwise from outside; `normals` (facet, 3) are outward, zero for a facet without area;
    `offsets` (facet,) [m] are the distances of planes from the ship origin, along the normals.
    """

    centre: NDArray[np.float64]
    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    normals: NDArray[np.float64]
    offsets: NDArray[np.float64]

    @classmethod
    def of(cls, mesh: Mesh) -> Solid:
        """Return the solid of a mesh, cached by the content of the mesh."""
        key = hash(mesh)
        with _lock:
            solid = _kept.pop(key, None) or cls._prepare(mesh)
            _kept[key] = solid
            if len(_kept) > CACHED_SOLIDS:
                _kept.popitem(last=False)
        return solid

    @classmethod
    def _prepare(cls, mesh: Mesh) -> Solid:
        vertices = np.array(mesh.vertices, dtype=np.float64)
        faces = np.array(mesh.faces, dtype=np.int32)
        if len(faces) == 0:
            raise ValueError("mesh has no facets: at least one is needed.")
        if not np.isfinite(vertices).all():
            raise ValueError("mesh has vertices that are not finite: all must be.")
        centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        vertices -= centre
        corner = vertices[faces]
        normals = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        if not length.any():
            raise ValueError("mesh has no facets with an area: at least one is needed.")
        np.divide(normals, length, out=normals, where=length > 0)
        offsets = np.einsum("ij,ij->i", normals, corner[:, 0] + centre)
        return cls(centre, vertices, faces, normals, offsets)

    def view_coordinates(self, view: View) -> NDArray[np.float64]:
        """(3, vertex) float64 ndarray: vertices along the axes of a view, from the ship origin."""
        points: NDArray[np.float64] = view.axes @ self.vertices.T
        points += (view.axes @ self.centre)[:, None]
        return points


_kept: OrderedDict[int, Solid] = OrderedDict()
_lock = Lock()


def surface(
    solid: Solid,
    view: View,
    lattice: Lattice,
    points: NDArray[np.float64],
    facet: NDArray[np.float32] | NDArray[np.int32],
) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Return down-range (row, col) [m] and its gradient (row, col, 2), exact on the facets seen.

    `points` (3, vertex) [m] are the vertices along the axes of the view, `facet` (row * col,) the
    facet of each pixel, -1 for none, where down-range is NaN. A facet that faces away counts as
    edge-on: snapping to a rasteriser's grid has turned it, at the outline.

    A facet's plane n.q = c and a line of sight q = (H w, V w, r), w = 1 + k r, meet at

        r = (s - c) / a,   s = n_h H + n_v V,   a = -(n_r + k s),   grad r = w (n_h, n_v) / a,

    where k = 1/R0 is the wavefront's curvature, 0 in the far field, and a > 0 on a facet that faces
    the sensor. With S = H^2 + V^2 and t = sqrt(1 + k^2 S) the distance there is (R0 + r) t, so that

        down-range = r + k w S / (1 + t),   gradient = t grad r + k w (H, V) / t,

    which cancels nowhere, whatever R0; in the far field down-range is the coordinate along `away`.
    At the silhouette a pixel centre may lie a little outside its facet (a rasteriser's vertices are
    on a grid of 1/256 pixel), so r is clipped to the facet's extent, which matters on a steep
    facet.
    """
    from ncti.render import pixels

    return pixels.surface(
        facet,
        lattice.shape,
        (lattice.first_column + 0.5, lattice.first_row + 0.5, lattice.pixel),
        (view.axes, view.curvature),
        (solid.normals, solid.offsets, solid.faces),
        points[2],
    )


SNAP = 1 / 256
"""Grid of a rasteriser's vertices [pixel], to which it rounds them."""

ROUNDING = 2.0**-20
"""Error of a vertex's place in float32, over the ship's size: sixteen roundings."""


def sampled_facets(
    solid: Solid, view: View, lattice: Lattice, points: NDArray[np.float64]
) -> NDArray[np.int32]:
    """Return the (facet,) facets that have a pixel centre, hidden ones included, as int32.

    All others face away or lie between the centres, and drawing them changes nothing.
    """
    from ncti.render import pixels

    return pixels.sampled_facets(*_place_vertices(solid, view, lattice, points))


def covered_columns(
    solid: Solid, view: View, lattice: Lattice, points: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Return (row, 2) int64: first column of each row that may see the ship, and past the last."""
    from ncti.render import pixels

    positions, faces, margin = _place_vertices(solid, view, lattice, points)
    return pixels.row_spans(positions, faces, lattice.shape, margin)


def _place_vertices(
    solid: Solid, view: View, lattice: Lattice, points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int32], float]:
    """Return vertex positions [pixel], facets, and how far engines may move vertices [pixel]."""
    from ncti.render import pixels

    column, row = lattice.first_column + 0.5, lattice.first_row + 0.5
    positions = pixels.place(points, view.curvature, lattice.pixel, column, row)
    size = lattice.rows + lattice.columns + (lattice.far - lattice.near) / lattice.pixel
    margin = SNAP / 2 + ROUNDING * size / (1.0 + view.curvature * lattice.near)
    return positions, solid.faces, margin

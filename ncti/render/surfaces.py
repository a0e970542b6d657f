"""Flat surfaces of a ship and the edges between them, so that lines cross few edges."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from ncti.render.solid import CACHED_SOLIDS, Solid
from ncti.ships.shape import Mesh
from ncti.ships.surfaces import components

Floats = NDArray[np.float64]

MAX_ANGLE = 1e-5
"""Angle between normals [rad] up to which adjacent facets are one surface: float32 vertices of a
flat deck cause some 1e-6, and the plates of a round hull a thousand times as much."""

PLANE_TOLERANCE = 1e-4
"""Distance [m] up to which vertices lie in a surface's plane; otherwise facets stay single."""


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Flat surfaces of a mesh, and their edges.

    `vertices` (vertex, 3) [m] are relative to `centre` (3,) [m], the middle of the solid in the
    ship frame; `edge` (edge, 4) has two vertices, and the surfaces left and right as seen from
    outside, their number for none; `area` (surface, 3) [m^2] are outward area vectors, and `moment`
    (surface,) [m^3] their products with a point of the plane, from the ship origin.
    """

    centre: Floats
    vertices: Floats
    edge: NDArray[np.uint32]
    area: Floats
    moment: Floats

    @cached_property
    def normals(self) -> Floats:
        """(surface, 3) float64 ndarray: outward unit normals; zero where there is no area."""
        length = np.linalg.norm(self.area, axis=1, keepdims=True)
        return np.divide(self.area, length, out=np.zeros_like(self.area), where=length > 0)

    @cached_property
    def reach(self) -> float:
        """Largest distance of a vertex from the ship origin [m]."""
        return float(np.linalg.norm(self.vertices + self.centre, axis=1).max())

    @cached_property
    def size(self) -> Floats:
        """(3,) float64 ndarray: length, beam and height of the box around the vertices [m]."""
        return np.ptp(self.vertices, axis=0)

    def facing_area(self, towards: Floats) -> float:
        """Return the projected area that faces a (3,) direction [m^2].

        It is an upper bound on the visible area of a closed mesh.
        """
        return float(np.maximum(self.area @ towards, 0.0).sum())

    @classmethod
    def of(cls, mesh: Mesh) -> Surfaces:
        """Return the surfaces of a mesh, cached like its solid."""
        return cls._prepare(Solid.of(mesh))

    @classmethod
    @lru_cache(maxsize=CACHED_SOLIDS)
    def _prepare(cls, solid: Solid) -> Surfaces:
        vertices, index = np.unique(solid.vertices, axis=0, return_inverse=True)
        faces, numbers = _distinct_facets(index.reshape(-1)[solid.faces])
        if not len(faces):
            raise ValueError("mesh has only facets without area: at least one must have some.")
        normals = solid.normals[numbers]
        count = len(faces)
        corner = vertices[faces]
        area = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]) / 2
        moment = np.einsum("ij,ij->i", area, corner[:, 0] + solid.centre)

        # Half-edges of a pair run in opposite directions; the rest have one side only.
        start, stop = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
        low, high = np.minimum(start, stop), np.maximum(start, stop)
        order = np.lexsort((start > stop, high, low))
        low, high, ahead = low[order], high[order], (start < stop)[order]
        facet = np.repeat(np.arange(count), 3)[order]
        paired = _pairs(low, high, ahead)
        left, right = facet[paired], facet[paired + 1]

        surface = _merge_coplanar(normals, corner, area, left, right)
        size = int(surface.max()) + 1
        unpaired = np.ones(3 * count, dtype=bool)
        unpaired[paired] = unpaired[paired + 1] = False
        single = np.flatnonzero(unpaired & (low != high))
        boundary = np.flatnonzero(surface[left] != surface[right])
        edges = np.append(paired[boundary], single)
        inner = surface[facet[single]]
        sides = (
            np.append(surface[left[boundary]], np.where(ahead[single], inner, size)),
            np.append(surface[right[boundary]], np.where(ahead[single], size, inner)),
        )
        return cls(
            solid.centre,
            vertices,
            np.ascontiguousarray(
                np.stack([low[edges], high[edges], sides[0], sides[1]], axis=1), dtype=np.uint32
            ),
            _sum_by_surface(surface, area, size),
            np.asarray(np.bincount(surface, moment, size), dtype=np.float64),
        )


def _sum_by_surface(surface: NDArray[np.integer], vectors: Floats, size: int) -> Floats:
    """Return the sum of the vectors of the facets of each surface."""
    return np.stack([np.bincount(surface, component, size) for component in vectors.T], 1).astype(
        np.float64
    )


def _distinct_facets(faces: NDArray[np.integer]) -> tuple[NDArray[np.integer], NDArray[np.intp]]:
    """Return the distinct facets with three corners, and their numbers in `faces`.

    A duplicate facet in a surface would begin twice on a line before it ends.
    """
    first = np.argmin(faces, axis=1)[:, None]
    turned = np.take_along_axis(faces, (first + np.arange(3)) % 3, axis=1)
    numbers = np.sort(np.unique(turned, axis=0, return_index=True)[1])
    a, b, c = faces[numbers].T
    numbers = numbers[(a != b) & (b != c) & (c != a)]
    return faces[numbers], numbers


def _pairs(
    low: NDArray[np.integer], high: NDArray[np.integer], ahead: NDArray[np.bool_]
) -> NDArray[np.intp]:
    """Return the first of each pair of opposite half-edges between the same vertices.

    Where more than two share an edge, at most one in each direction form a pair.
    """
    same = (low[1:] == low[:-1]) & (high[1:] == high[:-1]) & (low[1:] != high[1:])
    # Sorted, half-edges that run ahead come first: a pair is where the direction changes.
    return np.flatnonzero(same & ahead[:-1] & ~ahead[1:])


def _merge_coplanar(
    n: Floats,
    corner: Floats,
    area: Floats,
    left: NDArray[np.integer],
    right: NDArray[np.integer],
) -> NDArray[np.intp]:
    """Return the surface of each facet: coplanar neighbours are one, if all lie in a plane.

    `n` (facet, 3) are unit normals, `corner` (facet, 3, 3) [m], `area` (facet, 3) area vectors;
    `left` and `right` (edge,) the facets on both sides of an edge.
    """
    turn = np.linalg.norm(n[left] - n[right], axis=1)
    flat = (turn < MAX_ANGLE) & n[left].any(axis=1) & n[right].any(axis=1)
    surface = components(left[flat], right[flat], len(n))
    size = int(surface.max()) + 1
    # Plates along a gentle curve may be coplanar with their neighbours, but not all together.
    normal = _sum_by_surface(surface, area, size)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    height = np.einsum("ijk,ik->ij", corner, normal[surface])
    top, bottom = np.full(size, -np.inf), np.full(size, np.inf)
    np.maximum.at(top, surface, height.max(axis=1))
    np.minimum.at(bottom, surface, height.min(axis=1))
    bent = (top - bottom > PLANE_TOLERANCE)[surface]
    surface[bent] = size + np.flatnonzero(bent)
    return np.unique(surface, return_inverse=True)[1].reshape(-1)

"""Visible facets by ray casting with Embree, which is a package from PyPI."""

from __future__ import annotations

from threading import Lock
from weakref import WeakKeyDictionary

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from ncti.render.solid import MIN_COSINE, Solid, covered_columns
from ncti.render.view import Lattice, View

STEP = 2.0**-20
"""Distance behind a facet at which a ray continues, relative to the ship's size: a few rounding
errors of float32."""

Indices = NDArray[np.intp]
Floats = NDArray[np.float64]


class EmbreeEngine:
    """Embree, with one ray through each pixel centre from the first to the last on the ship.

    Rays pass through facets that face away from the sensor, as a rasteriser culls them: a closed
    ship shows none, an open one shows surfaces behind its holes.
    """

    def __init__(self) -> None:
        # A scene lasts as long as its solid.
        self._scenes: WeakKeyDictionary[Solid, EmbreeScene] = WeakKeyDictionary()
        self._lock = Lock()

    def visible(
        self, solid: Solid, view: View, lattice: Lattice, points: NDArray[np.float64]
    ) -> NDArray[np.int32]:
        """Return the facet that each pixel sees, -1 for none."""
        from ncti.render.pixels import rays

        # Rays start at the near plane, so that distances in float32 are only as long as the ship.
        pixel, start, direction = rays(
            covered_columns(solid, view, lattice, points),
            lattice.columns,
            lattice.origin,
            lattice.pixel,
            view.axes,
            view.curvature,
            lattice.near,
            lattice.near * view.axes[2] - solid.centre,
        )
        facet = np.full(lattice.rows * lattice.columns, -1, dtype=np.int32)
        facet[pixel] = self.cast(solid, start, direction)
        return facet

    def cast(
        self, solid: Solid, start: NDArray[np.float32], direction: NDArray[np.float32]
    ) -> NDArray[np.intp]:
        """Return the (ray,) first facets that face rays that start near the solid; -1 if none."""
        facet = self._first_facets(solid, start, direction)
        ray = _hits_from_behind(solid, facet, direction)
        if not ray.size:
            return facet
        step = STEP * float(np.ptp(solid.vertices, axis=0).max())
        origin = start[ray].astype(np.float64)
        along = np.broadcast_to(direction, start.shape)[ray].astype(np.float64)
        passed = np.zeros(len(ray))  # along each ray
        # Each round passes one facet; a ray meets each facet once.
        while ray.size:
            behind = facet[ray]
            distance = _distance(solid, behind, origin, along)
            facet[ray] = _opposite_facets(solid, behind, origin + distance[:, None] * along, step)
            unresolved = facet[ray] < 0
            ray, origin, along = ray[unresolved], origin[unresolved], along[unresolved]
            passed = np.maximum(distance[unresolved], passed[unresolved]) + step
            begin = (origin + passed[:, None] * along).astype(np.float32)
            facet[ray] = self._first_facets(solid, begin, along.astype(np.float32))
            remaining = _hits_from_behind(solid, facet[ray], along)
            ray, origin, along = ray[remaining], origin[remaining], along[remaining]
            passed = passed[remaining]
        return facet

    def _first_facets(
        self, solid: Solid, start: NDArray[np.float32], direction: NDArray[np.float32]
    ) -> Indices:
        """Return the (ray,) first facets on rays, from either side; -1 if none."""
        with self._lock:
            facet: Indices = self._scene(solid).run(start, direction)
        return facet

    def _scene(self, solid: Solid) -> EmbreeScene:
        scene = self._scenes.get(solid)
        if scene is None:
            scene = self._scenes[solid] = EmbreeScene(robust=True)
            TriangleMesh(scene, solid.vertices.astype(np.float32), solid.faces)
        return scene


def _hits_from_behind(
    solid: Solid, facet: Indices, direction: NDArray[np.float32] | Floats
) -> Indices:
    """Return the rays that meet their facet from behind; a facet edge-on counts as facing them."""
    if len(direction) == 1:  # parallel rays: one cosine for each facet
        away = solid.normals @ direction[0] > MIN_COSINE
        return np.flatnonzero(away[facet] & (facet >= 0))
    normal = solid.normals.take(np.maximum(facet, 0), axis=0)
    cosine = np.einsum("ij,ij->i", normal, direction)
    return np.flatnonzero((cosine > MIN_COSINE) & (facet >= 0))


def _distance(solid: Solid, facet: Indices, origin: Floats, direction: Floats) -> Floats:
    """Return the distance along rays to the planes of their facets."""
    normal = solid.normals.take(facet, axis=0)
    corner = solid.vertices[solid.faces[facet, 0]]
    ahead = np.einsum("ij,ij->i", normal, corner - origin)
    return ahead / np.einsum("ij,ij->i", normal, direction)


def _opposite_facets(solid: Solid, facet: Indices, place: Floats, step: float) -> Indices:
    """Return the facets that lie back to back with others at the given places; -1 if none.

    Embree returns either of two coincident facets, at random.
    """
    twin = np.full(len(facet), -1, dtype=np.intp)
    for number in np.unique(facet):
        normal = solid.normals[number]
        level = solid.vertices @ normal - solid.vertices[solid.faces[number, 0]] @ normal
        flat = (np.abs(level) <= step)[solid.faces].all(axis=1)
        opposite = np.flatnonzero(flat & (solid.normals @ normal < 0))
        if not opposite.size:
            continue
        corners = solid.vertices[solid.faces[opposite]]
        edges = np.roll(corners, -1, axis=1) - corners
        # Inside a triangle a place is left of all its edges: inwards from each corner's edge.
        inwards = np.cross(solid.normals[opposite, None], edges)
        limits = np.einsum("fek,fek->fe", inwards, corners)
        for ray in np.flatnonzero(facet == number):
            inside = (inwards @ place[ray] >= limits).all(axis=1)
            if inside.any():
                twin[ray] = opposite[inside.argmax()]
    return twin

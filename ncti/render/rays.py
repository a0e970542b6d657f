"""Intersections of rays with ships, for sensors that move while they look."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ncti.render.embree import EmbreeEngine
from ncti.render.solid import MIN_COSINE, STEEP_COSINE, Solid
from ncti.ships.shape import Mesh

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RayHits:
    """Intersections of rays with a ship.

    Attributes
    ----------
    ray : (hit,) intp ndarray
        Numbers of the rays that meet it, ascending.
    distance : (hit,) float64 ndarray
        Distance from the ray's origin [m].
    facet : (hit,) intp ndarray
        Number of the facet that is met.
    cosine : (hit,) float64 ndarray
        Cosine of the angle between the ray and the facet's normal, 1 face-on.

    See Also
    --------
    cast_rays : Returns them.

    Examples
    --------
    >>> import numpy as np
    >>> import trimesh
    >>> from ncti.render import cast_rays
    >>> box = trimesh.creation.box((40.0, 8.0, 6.0))
    >>> slanted = np.array([[-0.8, 0.0, -0.6]])
    >>> hits = cast_rays(box, np.array([[40.0, 0.0, 15.0]]), slanted)
    >>> float(hits.distance[0]), float(hits.cosine[0])
    (25.0, 0.8)
    """

    ray: NDArray[np.intp]
    distance: Floats
    facet: NDArray[np.intp]
    cosine: Floats


def cast_rays(mesh: Mesh, origin: Floats, direction: Floats) -> RayHits:
    """Return the first intersections of rays with the facets of a ship that face them.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        The ship, in its frame.
    origin : (ray, 3) float64 ndarray
        Origins of the rays [m], outside the ship at any distance.
    direction : (ray, 3) float64 ndarray
        Unit vectors.

    Returns
    -------
    RayHits
        Intersections of those rays that meet the ship.

    Raises
    ------
    ValueError
        If the arrays do not match, or the mesh has no facets or a vertex that is not finite.

    See Also
    --------
    range_image : Parallel lines of sight on a lattice of pixels.

    Notes
    -----
    Embree finds the facet in float32, from points that are moved along the rays to near the ship;
    the distance is that to the facet's plane in float64, as for a range image.

    Examples
    --------
    Two rays towards the bow, 1 m above the waterline and 10 m above the deck:

    >>> import numpy as np
    >>> import trimesh
    >>> from ncti.render import cast_rays
    >>> box = trimesh.creation.box((40.0, 8.0, 6.0))
    >>> origin = np.array([[1000.0, 0.0, 1.0], [1000.0, 0.0, 13.0]])
    >>> hits = cast_rays(box, origin, np.array([[-1.0, 0.0, 0.0]] * 2))
    >>> hits.ray, hits.distance
    (array([0]), array([980.]))
    """
    if origin.shape != direction.shape or origin.ndim != 2 or origin.shape[1] != 3:
        raise ValueError(
            f"origin has shape {origin.shape} and direction {direction.shape}, but both must be "
            "(ray, 3)"
        )
    solid = Solid.of(mesh)
    radius = float(np.linalg.norm(solid.vertices, axis=1).max())
    offset = origin - solid.centre
    nearest = -np.einsum("ij,ij->i", offset, direction)
    # Rays that miss the sphere about the ship miss the ship.
    passing = np.einsum("ij,ij->i", offset, offset) - nearest**2
    near = np.flatnonzero((passing <= (radius + 1.0) ** 2) & (nearest > -radius))
    if not len(near):
        none = np.empty(0, dtype=np.intp)
        return RayHits(none, np.empty(0), none, np.empty(0))
    along = direction[near]
    # An origin among masts is inside the sphere; parts behind it are invisible.
    start = offset[near] + np.maximum(nearest[near] - radius - 1.0, 0.0)[:, None] * along
    facet = _embree.cast(solid, start.astype(np.float32), along.astype(np.float32))
    hit = np.flatnonzero(facet >= 0)
    facet = facet[hit].astype(np.intp)
    ray = near[hit]
    return RayHits(ray, *_intersect_planes(solid, origin[ray], along[hit], facet))


def _intersect_planes(
    solid: Solid, origin: Floats, direction: Floats, facet: NDArray[np.intp]
) -> tuple[Floats, NDArray[np.intp], Floats]:
    """Return distance, facet and cosine of incidence where rays meet the planes of facets."""
    normal = solid.normals.take(facet, axis=0)
    # All facets face their rays, or are edge-on.
    cosine = np.maximum(-np.einsum("ij,ij->i", normal, direction), MIN_COSINE)
    distance = (np.einsum("ij,ij->i", normal, origin) - solid.offsets.take(facet)) / cosine
    # A steep facet's plane departs from it quickly: clip the distance to the facet's extent.
    steep = np.flatnonzero(cosine < STEEP_COSINE)
    corners = solid.vertices[solid.faces.take(facet[steep], axis=0)]
    corners -= (origin[steep] - solid.centre)[:, None]
    reach = np.einsum("ijk,ik->ij", corners, direction[steep])
    distance[steep] = np.clip(distance[steep], reach.min(axis=1), reach.max(axis=1))
    return distance, facet, cosine


_embree = EmbreeEngine()

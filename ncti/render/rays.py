"""Single lines of sight: where each meets a ship, for sensors that move while they look."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ncti.render.embree import EmbreeEngine
from ncti.render.solid import STEEP, Solid, towards

if TYPE_CHECKING:
    import trimesh

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RayHits:
    """Where rays meet a ship.

    Attributes
    ----------
    ray : (hit,) intp ndarray
        Which rays meet it, ascending.
    distance : (hit,) float64 ndarray
        From the ray's origin, along it [m].
    facet : (hit,) intp ndarray
        Facet of the mesh that it meets.
    cosine : (hit,) float64 ndarray
        Of the angle between the ray and the facet's normal, 1 face-on.
    """

    ray: NDArray[np.intp]
    distance: Floats
    facet: NDArray[np.intp]
    cosine: Floats


def cast_rays(mesh: trimesh.Trimesh, origin: Floats, direction: Floats) -> RayHits:
    """Where lines of sight first meet a ship.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        The ship, in its frame.
    origin : (ray, 3) float64 ndarray
        Where rays start [m], outside the ship and however far from it.
    direction : (ray, 3) float64 ndarray
        Unit vectors.

    Returns
    -------
    RayHits
        Those that meet it.

    Raises
    ------
    ValueError
        If the arrays do not match, or the mesh has no facets or a vertex that is not finite.

    Notes
    -----
    Embree finds the facet in float32, from points that are moved along the rays to near the ship;
    the distance is that to the facet's plane in float64, as for a range image.
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
    # Rays that pass the sphere about the ship meet nothing of it.
    passing = np.einsum("ij,ij->i", offset, offset) - nearest**2
    near = np.flatnonzero((passing <= (radius + 1.0) ** 2) & (nearest > -radius))
    if not len(near):
        none = np.empty(0, dtype=np.intp)
        return RayHits(none, np.empty(0), none, np.empty(0))
    along = direction[near]
    # An origin among masts is inside the sphere, and what lies behind it is not seen.
    start = offset[near] + np.maximum(nearest[near] - radius - 1.0, 0.0)[:, None] * along
    facet = _embree.cast(solid, start.astype(np.float32), along.astype(np.float32))
    hit = np.flatnonzero(facet >= 0)
    facet = facet[hit].astype(np.intp)
    ray = near[hit]
    return RayHits(ray, *_meet(solid, origin[ray], along[hit], facet))


def _meet(
    solid: Solid, origin: Floats, direction: Floats, facet: NDArray[np.intp]
) -> tuple[Floats, NDArray[np.intp], Floats]:
    """Distance, facet and cosine of incidence of rays that meet the planes of facets."""
    normal = solid.normals.take(facet, axis=0)
    cosine = towards(-np.einsum("ij,ij->i", normal, direction))
    distance = (np.einsum("ij,ij->i", normal, origin) - solid.offsets.take(facet)) / cosine
    # A steep facet's plane leaves it quickly: distance is kept within the facet's own.
    steep = np.flatnonzero(np.abs(cosine) < STEEP)
    corners = solid.vertices[solid.faces.take(facet[steep], axis=0)]
    corners -= (origin[steep] - solid.centre)[:, None]
    reach = np.einsum("ijk,ik->ij", corners, direction[steep])
    distance[steep] = np.clip(distance[steep], reach.min(axis=1), reach.max(axis=1))
    return distance, facet, np.abs(cosine)


_embree = EmbreeEngine()

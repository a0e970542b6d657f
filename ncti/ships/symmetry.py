"""Mirror symmetry of ships, port against starboard."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from manifold3d import Manifold, Mesh64

from ncti.ships.surfaces import components

if TYPE_CHECKING:
    import trimesh

MIN_THICKNESS = 1e-3
"""Mean thickness [m] above which a part without a mirror image makes a ship asymmetric."""

MAX_IMBALANCE = 1e-4
"""Bound on the lateral centre of mass [m] and the products of inertia over mass [m^2] of a
symmetric ship with vertices rounded to float32. A ship above it is drawn from both sides, at a cost
in time but not in accuracy."""


def is_symmetric(mesh: trimesh.Trimesh) -> bool:
    """Return whether a ship is its own mirror image, port and starboard swapped.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        Closed mesh with outward facets, in the ship frame [m].

    Returns
    -------
    bool
        True if the difference of the ship and its mirror image has no part that is thicker than
        1 mm on average.

    See Also
    --------
    load : Meshes of ships.

    Notes
    -----
    The solids are compared, because facets of a symmetric ship need not be mirror images of each
    other: the triangles of a flat side depend on the order in which parts were united. The mean
    thickness of a part is twice its volume over its surface, which is the thickness of a plate
    and half the diameter of a pole.

    The comparison takes a second for a ship of 44,000 facets, so moments come first: a ship whose
    mass is not balanced about the plane y = 0 is not compared.

    Examples
    --------
    >>> import trimesh
    >>> from ncti.ships import is_symmetric
    >>> hull = trimesh.creation.box((100.0, 12.0, 8.0))
    >>> is_symmetric(hull)
    True
    >>> deckhouse = trimesh.creation.box((10.0, 4.0, 4.0))
    >>> deckhouse.apply_translation((0.0, 3.0, 6.5))  # to port
    <trimesh.Trimesh(vertices.shape=(8, 3), faces.shape=(12, 3))>
    >>> is_symmetric(trimesh.util.concatenate([hull, deckhouse]))
    False
    """
    balance = (
        mesh.center_mass[1],
        *(mesh.moment_inertia[axis, 1] / mesh.mass for axis in (0, 2)),
    )
    if max(map(abs, balance)) > MAX_IMBALANCE:
        return False
    # Copies, as manifold3d takes no read-only arrays.
    solid = Manifold(Mesh64(np.array(mesh.vertices, "f8"), np.array(mesh.faces, "u8")))
    if solid.num_tri() != len(mesh.faces):  # plates without thickness are no solids
        return False
    difference = (solid - solid.mirror((0.0, 1.0, 0.0))).to_mesh64()
    faces = np.asarray(difference.tri_verts, dtype=np.intp)
    vertices = np.asarray(difference.vert_properties)[:, :3]
    first, second = np.concatenate([faces[:, :2], faces[:, 1:]]).T
    part = components(first, second, len(vertices))[faces[:, 0]]
    # Corners from the first one of all: volumes of small parts far from the origin would cancel.
    a, b, c = (vertices - vertices[:1])[faces].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    volume = np.bincount(part, np.einsum("ij,ij->i", a, normal) / 6)
    surface = np.bincount(part, np.linalg.norm(normal, axis=1) / 2)
    return bool(np.all(2 * volume <= MIN_THICKNESS * surface))

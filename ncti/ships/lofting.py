"""Solids as skins through rings and as bars along paths."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold, Mesh64, OpType
from numpy.typing import ArrayLike, NDArray

Points = NDArray[np.float64]


def union(solids: list[Manifold]) -> Manifold:
    """Return the union of any number of solids."""
    return Manifold.batch_boolean(solids, OpType.Add)


def loft(
    rings: ArrayLike, *, closed: bool = False, cap: NDArray[np.int64] | None = None
) -> Manifold:
    """Return the closed skin through (n, m, 3) rings of m corresponding vertices [m].

    Rings may turn either way. `closed` joins the last to the first; otherwise `cap` (k, 3)
    triangles, or a fan from vertex 0 that suits star-shaped rings, fill both ends.
    """
    rings = np.asarray(rings, dtype=np.float64)
    count, sides = rings.shape[:2]
    index = np.arange(count * sides).reshape(count, sides)
    below = index if closed else index[:-1]
    above = np.roll(index, -1, axis=0)[: len(below)]
    a, b = below.ravel(), np.roll(below, -1, axis=1).ravel()
    c, d = above.ravel(), np.roll(above, -1, axis=1).ravel()
    vertices = rings.reshape(-1, 3)
    # Twisted quadrilaterals are split along their shorter diagonal, which keeps them fair.
    rising = np.linalg.norm(vertices[a] - vertices[d], axis=1)
    falling = np.linalg.norm(vertices[b] - vertices[c], axis=1)
    first, last = np.where(rising <= falling + 1e-9, [d, a], [c, b])
    faces = [np.stack([a, b, first], -1), np.stack([d, c, last], -1)]
    if not closed:
        if cap is None:
            k = np.arange(1, sides - 1)
            cap = np.stack([np.zeros_like(k), k, k + 1], -1)
        faces += [index[0][cap[:, ::-1]], index[-1][cap]]
    triangles = np.concatenate(faces)
    corners = vertices[triangles] - vertices[0]
    if np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) < 0:
        triangles = triangles[:, ::-1]
    return Manifold(Mesh64(vertices, np.ascontiguousarray(triangles, dtype=np.uint64)))


def tube(path: ArrayLike, radius: ArrayLike, *, sides: int = 6, closed: bool = False) -> Manifold:
    """Return a round bar with `sides` faces along a polyline, mitred at its bends.

    `path` (n, 3) [m] is its axis, a hoop if `closed`; `radius` [m] is one value, or (n,) values.
    """
    path = np.asarray(path, dtype=np.float64)
    if closed:
        tangent = np.roll(path, -1, axis=0) - np.roll(path, 1, axis=0)
    else:
        step = np.diff(path, axis=0)
        step /= np.linalg.norm(step, axis=1, keepdims=True)
        tangent = np.concatenate([step[:1], step[1:] + step[:-1], step[-1:]])
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    # One reference direction for the whole bar, the axis it follows least, keeps it from twisting.
    reference = np.eye(3)[np.argmin(np.abs(tangent).max(axis=0))]
    first = np.cross(tangent, reference)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(tangent, first)
    angle = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    circle = np.cos(angle)[:, None] * first[:, None] + np.sin(angle)[:, None] * second[:, None]
    reach = np.broadcast_to(np.asarray(radius, dtype=np.float64), len(path))
    return loft(path[:, None] + reach[:, None, None] * circle, closed=closed)


def pitch_points(points: ArrayLike, elevation: float) -> Points:
    """Rotate points about the second axis: the first axis is raised by `elevation` [deg]."""
    cos, sin = np.cos(np.radians(elevation)), np.sin(np.radians(elevation))
    return np.asarray(points, dtype=np.float64) @ [[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]]

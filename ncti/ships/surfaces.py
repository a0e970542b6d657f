"""Surfaces: facets with their neighbours, which separate touching bodies, and openings."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from manifold3d import triangulate
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Faces = NDArray[np.int64]

MAX_FOLD_ANGLE = 1e-3  # angle between facets at an edge, up to which they lie on each other [rad]


@dataclass(frozen=True, eq=False)
class Surface:
    """A mesh with the neighbour of each facet across each of its edges.

    Edge `3 f + k` of facet f leads from its corner k to the next; -1 stands for no neighbour.
    """

    vertices: Floats
    faces: Faces
    partners: NDArray[np.int64]
    is_pinched: bool = False  # whether more than two facets meet at an edge

    @property
    def open_edges(self) -> NDArray[np.int64]:
        """Edges without neighbour."""
        return np.flatnonzero(self.partners < 0)

    @property
    def corners(self) -> Floats:
        """(facet, 3, 3) ndarray: coordinates of corners."""
        return self.vertices[self.faces]

    def labels(self) -> NDArray[np.int32]:
        """Return the number of the body of each facet."""
        linked = np.flatnonzero(self.partners >= 0)
        return components(linked // 3, self.partners[linked] // 3, len(self.faces))

    def split(self) -> Surface:
        """Return the surface with vertices shared by neighbouring facets only."""
        linked = np.flatnonzero(self.partners >= 0)
        edges, partners = linked, self.partners[linked]
        starts = np.concatenate([edges, next_edges(edges)])
        ends = np.concatenate([next_edges(partners), partners])
        corner = components(starts, ends, self.faces.size)
        vertices = np.empty((int(corner.max()) + 1, 3))
        vertices[corner] = self.vertices[self.faces.ravel()]
        return replace(self, vertices=vertices, faces=corner.reshape(-1, 3).astype(np.int64))


def surface_of(vertices: Floats, faces: Faces) -> Surface:
    """Return the surface of facets; where more than two meet, partners bound the same solid."""
    ends, order, starts, counts = _sorted_edges(len(vertices), faces)
    partners = np.full(len(ends), -1)
    first, second = _pair_up(order, starts, counts)
    opposed = ends[first, 0] != ends[second, 0]
    first, second = first[opposed], second[opposed]
    line = np.repeat(np.arange(len(counts)), counts)
    crowded = np.repeat(counts > 2, counts)
    if crowded.any():
        patches = components(first // 3, second // 3, len(faces))
        opening, closing = _match_edges_around_solid(
            vertices, faces, order[crowded], line[crowded], patches
        )
        first, second = np.concatenate([first, opening]), np.concatenate([second, closing])
    partners[first], partners[second] = second, first
    return Surface(vertices, faces, partners, is_pinched=bool(crowded.any()))


def neighbours(
    count: int, faces: Faces
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Return the two facets of each edge that has two, and whether they are wound alike."""
    ends, order, starts, counts = _sorted_edges(count, faces)
    first, second = _pair_up(order, starts, counts)
    return first // 3, second // 3, ends[first, 0] != ends[second, 0]


def _sorted_edges(
    count: int, faces: Faces
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return ends of all edges, their order by vertex pair, and start and length of each group."""
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    key = ends.min(axis=1) * count + ends.max(axis=1)
    order = np.argsort(key, kind="stable")
    starts = np.flatnonzero(np.diff(key[order], prepend=-1))
    return ends, order, starts, np.diff(starts, append=len(order))


def _pair_up(
    order: NDArray[np.int64], starts: NDArray[np.int64], counts: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    first = starts[counts == 2]
    return order[first], order[first + 1]


def _match_edges_around_solid(
    vertices: Floats,
    faces: Faces,
    edges: NDArray[np.int64],
    line: NDArray[np.int64],
    patches: NDArray[np.int32],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return pairs of edges on a line whose facets enclose solid between them.

    Going round a line, a facet whose edge runs backward opens a solid and one whose edge runs
    forward closes the one opened last, like brackets. A patch of facets that are neighbours
    elsewhere is matched separately if as many of its facets open as close. Among coincident facets,
    closing ones come first; copies of a body are matched in the order of the file.
    """
    start, end = faces.ravel()[edges], faces.ravel()[next_edges(edges)]
    apex = faces.ravel()[previous_edges(edges)]
    closes = start < end
    patch = patches[edges // 3].astype(np.int64)
    line_patch = np.unique(line * len(faces) + patch, return_inverse=True)[1]
    balanced = np.bincount(line_patch, np.where(closes, 1, -1))[line_patch] == 0
    keys = np.stack([line, np.where(balanced, patch, -1)])
    line = np.unique(keys, axis=1, return_inverse=True)[1]
    low = vertices[np.minimum(start, end)]
    axis = vertices[np.maximum(start, end)] - low
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    out = vertices[apex] - low
    out -= np.einsum("ij,ij->i", out, axis)[:, None] * axis
    _, first, number = np.unique(line, return_index=True, return_inverse=True)
    reference = out[first[number]]
    side = np.cross(axis, reference)
    angle = np.arctan2(np.einsum("ij,ij->i", out, side), np.einsum("ij,ij->i", out, reference))
    angle = np.where(angle < -MAX_FOLD_ANGLE, angle + 2 * np.pi, angle)
    by_angle = np.lexsort((angle, line))
    is_first = np.diff(angle[by_angle], prepend=0) > MAX_FOLD_ANGLE
    is_first |= np.diff(line[by_angle], prepend=0) > 0
    group = np.empty(len(edges), np.int64)
    group[by_angle] = np.cumsum(is_first)
    remaining = np.lexsort((np.where(closes, -edges, edges), ~closes, group))
    opening, closing = [], []
    while len(remaining):
        # The next facet round each facet's line.
        after = np.roll(np.arange(len(remaining)), -1)
        first = np.flatnonzero(np.diff(line[remaining], prepend=-1))
        last = np.append(first[1:], len(remaining)) - 1
        after[last] = first
        pairs = np.flatnonzero(~closes[remaining] & closes[remaining[after]])
        if not len(pairs):
            break
        opening.append(edges[remaining[pairs]])
        closing.append(edges[remaining[after[pairs]]])
        remaining = np.delete(remaining, np.concatenate([pairs, after[pairs]]))
    return np.concatenate([*opening, edges[:0]]), np.concatenate([*closing, edges[:0]])


def next_edges(edges: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the next edge in the facet of each edge."""
    return edges - edges % 3 + (edges + 1) % 3


def previous_edges(edges: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the previous edge in the facet of each edge; it begins at the opposite corner."""
    return edges - edges % 3 + (edges + 2) % 3


def components(start: NDArray[np.int64], end: NDArray[np.int64], count: int) -> NDArray[np.int32]:
    """Return the number of the component of each node of a graph, given the ends of its links."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(len(start), bool), (start, end)), shape=(count, count))
    return connected_components(links, directed=False)[1]


def triangle_areas(corners: Floats) -> Floats:
    """Return areas of triangles, (..., 3, 3)."""
    edges = corners[:, 1:] - corners[:, :1]
    return np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2


# openings -----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Openings:
    """Facets that would close each opening of a surface, their areas [m2], and perimeters [m]."""

    loops: list[NDArray[np.int64]]  # vertices around each
    patches: list[Faces]
    areas: Floats
    perimeters: Floats


def openings(surface: Surface) -> Openings:
    """Return the openings of a split surface, each closed by triangles across its plane.

    A vertex of a split surface has one open edge that leaves it, or none.
    """
    follows = dict(
        zip(
            surface.faces.ravel()[surface.open_edges].tolist(),
            surface.faces.ravel()[next_edges(surface.open_edges)].tolist(),
            strict=True,
        )
    )
    loops = []
    while follows:
        first, after = follows.popitem()
        loop = [first]
        while after != first:
            loop.append(after)
            after = follows.pop(after)
        loops.append(np.array(loop[::-1]))  # a patch turns the other way than the facets around it
    patches = [loop[_triangulate_loop(surface.vertices[loop])] for loop in loops]
    areas = [float(triangle_areas(surface.vertices[patch]).sum()) for patch in patches]
    rims = (surface.vertices[loop] for loop in loops)
    perimeters = [
        float(np.linalg.norm(rim - np.roll(rim, 1, axis=0), axis=1).sum()) for rim in rims
    ]
    return Openings(loops, patches, np.array(areas), np.array(perimeters))


def _triangulate_loop(points: Floats) -> NDArray[np.int64]:
    """Return triangles that close a loop of points, as seen along its mean normal."""
    if len(points) == 3:
        return np.array([[0, 1, 2]])
    points = points - points.mean(axis=0)
    normal = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    axes = np.linalg.svd(np.vstack([points, points[:1]]), full_matrices=False)[2]
    right = axes[0]
    if np.linalg.norm(normal) > 0:
        right = right - (right @ normal) * normal / (normal @ normal)
        right = right / np.linalg.norm(right) if np.linalg.norm(right) > 0 else axes[0]
        up = np.cross(normal / np.linalg.norm(normal), right)
    else:
        up = axes[1]
    triangles = triangulate([points @ np.column_stack([right, up])], allow_convex=False)
    return np.asarray(triangles, dtype=np.int64)

"""Weld surfaces: join vertices and edges that nearly meet along openings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ncti.ships.surfaces import Floats, Surface, components, next_edges, previous_edges, surface_of

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

WELD_DISTANCE = 1e-5  # of the longest extent, up to which vertices along open edges are merged
MAX_PAIRS = 20_000_000  # of vertices, or of an edge and a vertex, that are compared
SAMPLE_POINTS = 200  # points from which the number of pairs is estimated
MAX_PASSES = 10  # over open edges with vertices of other facets on them


def weld_surface(surface: Surface) -> tuple[Surface, list[str]]:
    """Merge close vertices and split edges at vertices along openings; return surface, faults."""
    from scipy.spatial import cKDTree

    vertices, faces = surface.vertices, surface.faces
    distance, faults = WELD_DISTANCE * float(np.ptp(vertices, axis=0).max()), list[str]()
    edges = surface.open_edges
    rim = np.unique(np.concatenate([faces.ravel()[edges], faces.ravel()[next_edges(edges)]]))
    tree = cKDTree(vertices[rim])
    pairs = np.empty((0, 2), np.int64)
    if _has_few_pairs(tree, vertices[rim], np.full(len(rim), distance)):
        pairs = tree.query_pairs(distance, output_type="ndarray")
    if len(pairs):
        group = components(pairs[:, 0], pairs[:, 1], len(rim))
        first = np.unique(group, return_index=True)[1]
        representative = np.arange(len(vertices))
        representative[rim] = rim[first[group]]
        faces = representative[faces]
        faces = faces[(np.diff(np.sort(faces, axis=1), axis=1) > 0).all(axis=1)]
        faults.append(
            f"{count_text(len(rim) - len(first), 'vertex', 'vertices')} less than "
            f"{1000 * distance:.2g} mm from another, both on open edges"
        )
        surface = surface_of(vertices, faces)
    total = 0
    for _ in range(MAX_PASSES):
        surface, count = _split_edges_at_vertices(surface, distance)
        total += count
        if not count:
            break
    if total:
        faults.append(f"{count_text(total, 'vertex', 'vertices')} on open edges of other facets")
    return surface, faults


def _split_edges_at_vertices(surface: Surface, distance: float) -> tuple[Surface, int]:
    """Split facets with a vertex of another on an open edge; return surface, number of vertices.

    Where several edges of a facet have such vertices, only one edge is split.
    """
    from scipy.spatial import cKDTree

    vertices, corner = surface.vertices, surface.faces.ravel()
    edges = surface.open_edges
    start, end = vertices[corner[edges]], vertices[corner[next_edges(edges)]]
    along = end - start
    length = np.linalg.norm(along, axis=1)
    rim, middle = np.unique(corner[edges]), (start + end) / 2
    tree = cKDTree(vertices[rim])
    if not len(edges) or not _has_few_pairs(tree, middle, length / 2):
        return surface, 0
    neighbours = tree.query_ball_point(middle, length / 2)
    row = np.repeat(np.arange(len(edges)), [len(indices) for indices in neighbours])
    vertex = rim[np.concatenate([np.asarray(indices, np.int64) for indices in neighbours])]
    place = np.einsum("ij,ij->i", vertices[vertex] - start[row], along[row]) / length[row]
    offset = vertices[vertex] - start[row] - (place / length[row])[:, None] * along[row]
    inside = (place > distance) & (length[row] - place > distance)
    inside &= np.linalg.norm(offset, axis=1) <= distance
    inside &= vertex != corner[previous_edges(edges[row])]
    row, vertex, place = row[inside], vertex[inside], place[inside]
    if not len(row):
        return surface, 0
    first = np.unique(edges[row] // 3, return_index=True)[1]
    chosen = np.isin(row, row[first])
    row, vertex, place = row[chosen], vertex[chosen], place[chosen]
    order = np.lexsort((place, row))
    row, vertex = row[order], vertex[order]
    begins = np.flatnonzero(np.diff(row, prepend=-1))
    # The parts of an edge: from its start to the first vertex, between vertices, to its end.
    cut = edges[row[begins]]
    ends = np.insert(vertex, np.append(begins[1:], len(vertex)), corner[next_edges(cut)])
    starts = np.insert(vertex, begins, corner[cut])
    apex = np.repeat(corner[previous_edges(cut)], np.diff(begins, append=len(vertex)) + 1)
    parts = np.column_stack([starts, ends, apex])
    faces = np.concatenate([np.delete(surface.faces, cut // 3, axis=0), parts])
    return surface_of(vertices, faces), len(vertex)


def _has_few_pairs(tree: cKDTree, points: Floats, radius: Floats) -> bool:
    """Return whether points have few enough neighbours to compare; a facet soup has too many."""
    sample = slice(None, None, len(points) // SAMPLE_POINTS + 1)
    counts = tree.query_ball_point(points[sample], radius[sample], return_length=True)
    return float(counts.mean()) * len(points) <= MAX_PAIRS


def count_text(number: int, singular: str, plural: str = "") -> str:
    """Return a number of things as text; `plural` ends in s by default."""
    return f"{number:,} {singular if number == 1 else plural or f'{singular}s'}"

"""Range extents without sampling: the reference that rendered extents are compared with.

The part of a solid that a sensor sees at ranges below r is the union of the outlines of all
facets that face the sensor, cut off at r. The union is built bin by bin with exact polygon
clipping; the area that a bin adds is the visible area in that bin. The module uses neither pixels
nor rays, and shares no code with the rest of the library.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
import trimesh
from manifold3d import CrossSection, FillRule
from numpy.typing import NDArray

Floats = NDArray[np.float64]

EDGE_TOLERANCE = 1e-9
"""Distance [m] from the edge of a bin up to which a corner lies on it, and so in the bin
behind, whatever the rounding."""

MAX_MISPLACED_SHARE = 1e-5
"""Share of the area that chords in place of bent lines of equal range may put into a wrong bin;
facets are divided until they put less."""


@dataclass(frozen=True, eq=False)
class ReferenceExtent:
    """Visible projected area (ifov, bin) [m^2] of the IFOVs that see some of a mesh.

    `cell` (ifov, 2) is their column and row; cells (-1, -1) and (0, 0) share the corner on the line
    of sight through the ship origin.
    """

    area: Floats
    cell: NDArray[np.int64]


def reference_range_extent(
    mesh: trimesh.Trimesh,
    *,
    aspect: float,
    depression: float,
    bin_edges: Floats,
    side: float | None = None,
    slant_range: float | None = None,
) -> ReferenceExtent:
    """Return the exact visible projected area of a mesh, by IFOV and range bin.

    `mesh` is closed with outward winding, or a sheet wound towards the sensor; angles are in
    degrees; `bin_edges` (bin + 1,) are down-range [m], the last one beyond the mesh; `side` is the
    side of a square IFOV [m], by default of one that sees the whole mesh; without `slant_range` [m]
    the mesh is seen from the far field.

    Outlines are united, never solids: trimming a solid and projecting it would be shorter, but is
    wrong by percents for hulls with slivers. Areas are accurate to the clipper's grid of 1e-8 m
    along outlines, and those at the range of the ship origin.

    At a finite range R, a point (h, v, z) to the right, up and away from the sensor is seen at h /
    (1 + z/R) and v / (1 + z/R), where straight edges stay straight, at the down-range sqrt(h^2 +
    v^2 + (R + z)^2) - R. Chords between their exact ends replace the curved lines of equal range.
    Over a facet of extent L, range differs from a linear function by at most L^2 / 8R, and this
    share of its depth may lie on the wrong side of a chord: facets across the edge of a bin are
    halved until at most 1e-5 of their area does. A face on the edge of two bins counts in the bin
    behind.
    """
    curvature = 0.0 if slant_range is None else 1.0 / slant_range
    corners = _project(mesh, aspect, depression, curvature)
    if slant_range is not None:
        corners = _divide_facets(corners, np.asarray(bin_edges), curvature)
    pieces, slab = _slice(corners, np.append(-np.inf, bin_edges), curvature)
    # Slab by slab from the near end: the area of its outlines that no nearer one covers.
    covered = CrossSection()
    added: list[list[tuple[tuple[int, int], float]]] = []
    starts = np.searchsorted(slab, np.arange(len(bin_edges) + 1))
    for first, last in pairwise(starts):
        if first == last:
            added.append([])
            continue
        outline = CrossSection(list(pieces[first:last]), FillRule.Positive)
        added.append(_areas(outline - covered, side))
        covered = covered + outline

    # added[0] lies in front of the first edge: it obscures surfaces behind it but is in no bin.
    cells = sorted({cell for areas in added[1:] for cell, _ in areas})
    row = {cell: k for k, cell in enumerate(cells)}
    area = np.zeros((len(cells), len(bin_edges) - 1))
    for number, areas in enumerate(added[1:]):
        for cell, value in areas:
            area[row[cell], number] = value
    return ReferenceExtent(area, np.array(cells, dtype=np.int64).reshape(-1, 2))


def _project(mesh: trimesh.Trimesh, aspect: float, depression: float, curvature: float) -> Floats:
    """Return (facet, corner, 3) right, up, down-range coordinates of facets facing the sensor."""
    a, d = np.radians([aspect, depression])
    u = np.array([np.cos(d) * np.cos(a), np.cos(d) * np.sin(a), np.sin(d)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    axes = np.stack([right, np.cross(u, right), -u])
    corners = (np.asarray(mesh.vertices) @ axes.T)[np.asarray(mesh.faces)]
    return corners[_signed_area(_project_points(corners, curvature)) > 0.0]


def _project_points(points: Floats, curvature: float) -> Floats:
    """Return the projection (..., 2) of points (..., 3), at the range of the ship origin."""
    return points[..., :2] / (1.0 + curvature * points[..., 2:])


def _ranges(points: Floats, curvature: float) -> Floats:
    """Return the down-range of (..., 3) points, sqrt(h^2 + v^2 + (R + z)^2) - R."""
    z, square = points[..., 2], np.sum(points[..., :2] ** 2, axis=-1)
    w = 1.0 + curvature * z
    down_range: Floats = z + curvature * square / (w + np.sqrt(w**2 + curvature**2 * square))
    return down_range


def _divide_facets(corners: Floats, edges: Floats, curvature: float) -> Floats:
    """Halve facets at their longest edge until chords put little enough area into wrong bins."""
    limit = MAX_MISPLACED_SHARE * _signed_area(_project_points(corners, curvature)).sum()
    while True:
        wrong = _misplaced_area(corners, edges, curvature)
        order = np.argsort(wrong)
        below = np.cumsum(wrong[order])
        if not below[-1:].sum() > limit:
            return corners
        # Halve the facets that misplace most; the others may use up half of the limit.
        accurate, corners = np.split(corners[order], [np.searchsorted(below, 0.5 * limit)])
        # The longest edge first: from corner a to corner b, and c opposite.
        length = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        turn = (length.argmax(axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.take_along_axis(corners, turn[..., None], axis=1).swapaxes(0, 1)
        middle = (a + b) / 2.0
        halves = [np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)]
        corners = np.concatenate([accurate, *halves])


def _misplaced_area(corners: Floats, edges: Floats, curvature: float) -> Floats:
    """Return an upper bound on the area of each facet that chords put into wrong bins."""
    ranges = _ranges(corners, curvature)
    order = np.argsort(ranges, axis=1)
    near, middle, far = np.take_along_axis(ranges, order, axis=1).T
    first, second, last = np.take_along_axis(corners, order[..., None], axis=1).swapaxes(0, 1)
    span = np.maximum(far - near, EDGE_TOLERANCE)

    def bend(run: Floats) -> Floats:
        return curvature * np.sum(run**2, axis=1) / (8.0 * (1.0 + curvature * near))

    longest = bend(last - first) + bend(second - first) + bend(last - second)
    cuts = np.searchsorted(edges, far) - np.searchsorted(edges, near - longest)
    # The longest chord is that through the middle corner; a parabola holds 2/3 of its box.
    across = bend(first + (last - first) * ((middle - near) / span)[:, None] - second)
    share = np.where(span > 8.0 * longest, 4.0 / 3.0 * across * cuts / span, 1.0 * (cuts > 0))
    wrong: Floats = share * _signed_area(_project_points(corners, curvature))
    return wrong


def _slice(corners: Floats, edges: Floats, curvature: float) -> tuple[Floats, NDArray[np.intp]]:
    """Cut facets at range edges.

    Returns the (piece, 5, 2) counter-clockwise outlines, and the slab of each, in ascending order.
    """
    ranges = _ranges(corners, curvature)
    closest = np.minimum(np.searchsorted(edges, ranges - EDGE_TOLERANCE), len(edges) - 1)
    ranges = np.where(np.abs(ranges - edges[closest]) < EDGE_TOLERANCE, edges[closest], ranges)
    order = np.argsort(ranges, axis=1)
    ranges = np.take_along_axis(ranges, order, axis=1)
    corners = np.take_along_axis(corners, order[..., None], axis=1)
    begin = np.searchsorted(edges, ranges[:, 0], side="right") - 1
    end = np.searchsorted(edges, ranges[:, 2], side="left") - 1
    end = np.maximum(begin, end)
    if end.max(initial=0) > len(edges) - 2:
        raise ValueError(
            f"bin_edges end at {edges[-1]:g} m, but must reach beyond the mesh, which ends at "
            f"{ranges.max():g} m"
        )

    count = end - begin + 1
    facet = np.repeat(np.arange(len(corners)), count)
    slab = np.arange(len(facet)) - np.repeat(np.cumsum(count) - count, count) + begin[facet]
    (near, middle, far), p = ranges[facet].T, corners[facet]
    start, stop = np.maximum(edges[slab], near), np.minimum(edges[slab + 1], far)

    def edge_point(i: int, j: int, cut: Floats, low: Floats, high: Floats) -> Floats:
        """Return the point at the range `cut` on the edge from corner i to corner j."""
        run, reach = p[:, j] - p[:, i], cut - low
        if curvature == 0.0:
            span = high - low
            t = np.divide(reach, span, out=(cut > low).astype(float), where=span > 0.0)
        else:
            # |sensor to corner i + t run|^2 = (R + cut)^2, divided by R.
            away = p[:, i] * curvature + [0.0, 0.0, 1.0]
            square, slope = curvature * np.sum(run**2, axis=1), np.sum(away * run, axis=1)
            excess = reach * (2.0 + curvature * (cut + low))
            root = slope + np.sqrt(np.maximum(slope**2 + square * excess, 0.0))
            t = np.divide(excess, root, out=(cut > low).astype(float), where=root > 0.0)
            t = np.where(cut >= high, 1.0, np.clip(t, 0.0, 1.0)) * (cut > low)
        return _project_points(p[:, i] + run * t[:, None], curvature)

    def middle_path_point(cut: Floats) -> Floats:
        """Return the point at the range `cut` on the path through the middle corner."""
        before, after = edge_point(0, 1, cut, near, middle), edge_point(1, 2, cut, middle, far)
        return np.where((cut < middle)[:, None], before, after)

    # The piece between two ranges: along the longest edge and back through the middle corner.
    bend = middle_path_point(np.clip(middle, start, stop))
    path = [edge_point(0, 2, start, near, far), edge_point(0, 2, stop, near, far)]
    pieces = np.stack([*path, middle_path_point(stop), bend, middle_path_point(start)], axis=1)
    flat = near == far  # all corners at one range: the whole facet
    pieces[flat] = _project_points(p[flat][:, [0, 1, 2, 2, 2]], curvature)
    area = _signed_area(pieces)
    pieces[area < 0.0] = pieces[area < 0.0, ::-1]
    nonempty = np.flatnonzero(area != 0.0)
    nonempty = nonempty[np.argsort(slab[nonempty], kind="stable")]
    return pieces[nonempty], slab[nonempty]


def _areas(outline: CrossSection, side: float | None) -> list[tuple[tuple[int, int], float]]:
    """Return the area of an outline in each cell that it reaches."""
    if outline.is_empty():
        return []
    if side is None:
        return [((0, 0), outline.area())]
    left, bottom, right, top = (math.floor(bound / side) for bound in outline.bounds())
    if (left, bottom) == (right, top):
        return [((left, bottom), outline.area())]
    square = CrossSection.square((side, side))
    areas = []
    for column, row in product(range(left, right + 1), range(bottom, top + 1)):
        area = (outline ^ square.translate((column * side, row * side))).area()
        if area > 0.0:
            areas.append(((column, row), area))
    return areas


def _signed_area(polygons: Floats) -> Floats:
    """Return the area of (..., corner, 2) polygons, positive if counter-clockwise."""
    x, y = np.moveaxis(polygons - polygons[..., :1, :], -1, 0)
    return 0.5 * np.sum(x * np.roll(y, -1, axis=-1) - np.roll(x, -1, axis=-1) * y, axis=-1)

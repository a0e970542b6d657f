"""Helpers: boxes with difficult facets, views by every engine, and exact outlines."""

import numpy as np
import trimesh
from scipy.spatial import ConvexHull

from ncti.render import available_engines, line_image, range_image
from ncti.render.view import View

LOW, HIGH = np.array([-60.0, -7.0, -2.0]), np.array([70.0, 9.0, 12.0])
ENGINES = ("lines", *(name for name in ("embree", "osmesa") if name in available_engines()))


def box(scale=1.0, offset=0.0):
    """Return a box of a ship's size, its waterline origin off the middle."""
    return trimesh.creation.box(bounds=np.array([LOW, HIGH]) * scale + offset)


def mesh(vertices, faces):
    return trimesh.Trimesh(np.asarray(vertices, dtype=np.float64), faces, process=False)


def with_slivers(share):
    """Return the box, each facet split at a point this share of its height above an edge."""
    corners = np.asarray(box().triangles)
    vertices, faces = [], []
    for a, b, c in corners:
        foot = (a + b) / 2
        n = len(vertices)
        vertices += [a, b, c, foot + (c - foot) * share]
        faces += [[n, n + 1, n + 3], [n + 1, n + 2, n + 3], [n + 2, n, n + 3]]
    return mesh(vertices, faces)


def with_needle(width):
    """Return the box with a mast 28 m high, as thick as `width`."""
    mast = trimesh.creation.box(bounds=[[0.0, 0.0, 11.999], [width, width, 40.0]])
    return trimesh.util.concatenate([box(), mast])


def with_facets_without_area():
    v, f = np.asarray(box().vertices), np.asarray(box().faces)
    middle = (v[f[0, 0]] + v[f[0, 1]]) / 2
    more = [[f[0, 0], len(v), f[0, 1]], [0, 0, 0], [1, 1, 2]]
    return mesh([*v, middle], np.vstack([f, more]))


def with_coincident_facets(*, turned=False):
    """Return the box with every facet twice, the second one reversed if `turned`."""
    v, f = np.asarray(box().vertices), np.asarray(box().faces)
    return mesh(v, np.vstack([f, f[:, ::-1] if turned else f]))


def see(engine, solid, *, pixel=0.5, **view):
    """Return a range image, or lines."""
    if engine == "lines":
        return line_image(solid, spacing=pixel, **view)
    return range_image(solid, pixel=pixel, engine=engine, **view)


def area(image):
    """Return the visible area [m^2] at the range of the ship origin."""
    if hasattr(image, "hit"):
        return np.count_nonzero(image.hit) * image.pixel**2
    return image.area.sum()


def ranges(image):
    """Return the down-range [m] of all visible pixels or pieces."""
    return image.down_range[image.hit] if hasattr(image, "hit") else image.down_range.ravel()


def outline(points, *, aspect, depression, slant_range=None):
    """Return area and perimeter of a convex solid's outline, and its limits of down-range.

    The outline is the convex hull of the points, projected by the definition of h/w and v/w.
    """
    column, row, away = View(aspect, depression).axes @ np.asarray(points, dtype=np.float64).T
    k = 0.0 if slant_range is None else 1.0 / slant_range
    w = 1.0 + k * away
    hull = ConvexHull(np.stack([column / w, row / w], axis=1), qhull_options="QJ Pp")
    # |q| - R0 of the corners bounds the farthest range; no point is nearer than its `away`.
    square = column**2 + row**2
    distance = away + k * square / (w + np.sqrt(w**2 + k**2 * square))
    return hull.volume, hull.area, (away.min(), distance.max())


def sampling_error(perimeter, pixel):
    """Return a bound on the area error [m^2] of pixels or lines on a convex outline.

    Pixels that the outline cuts lie within half a diagonal of it, in a strip of area up to
    perimeter x p / sqrt 2 + pi p^2 / 2. The length of chords rises to a maximum and falls again, so
    lines err by twice the maximum times their spacing; it is at most half the perimeter.
    """
    return perimeter * pixel + np.pi * pixel**2 / 2

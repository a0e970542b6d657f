"""Independent tracer of an upright box by the slab method in extended precision."""

import numpy as np

Long = np.longdouble


def axes(aspect, depression):
    """Return unit vectors right, up and towards the sensor, by the definition of a view."""
    a, d = np.radians(Long(aspect)), np.radians(Long(depression))
    right = np.array([-np.sin(a), np.cos(a), 0])
    towards = np.array([np.cos(d) * np.cos(a), np.cos(d) * np.sin(a), np.sin(d)])
    return right, np.cross(towards, right), towards


def lines_of_sight(view, horizontal, vertical):
    """Return starts and directions of the lines through image points, and the starts' range."""
    right, up, towards = axes(view.aspect, view.depression)
    target = Long(horizontal)[..., None] * right + Long(vertical)[..., None] * up
    if view.slant_range is None:
        return target, np.broadcast_to(-towards, target.shape), Long(0)
    sensor = Long(view.slant_range) * towards
    direction = target - sensor
    direction /= np.sqrt((direction**2).sum(axis=-1, keepdims=True))
    return np.broadcast_to(sensor, target.shape), direction, -Long(view.slant_range)


def trace(view, horizontal, vertical, *, low, high):
    """Return the down-range of a box from `low` to `high`, and the axis normal to the visible side.

    Down-range is NaN where a line misses the box.
    """
    start, direction, offset = lines_of_sight(view, horizontal, vertical)
    with np.errstate(divide="ignore", invalid="ignore"):
        cuts = np.stack([(np.array(side, Long) - start) / direction for side in (low, high)])
    cuts = np.where(np.isnan(cuts), -np.inf, cuts)
    enter, leave = cuts.min(axis=0), cuts.max(axis=0)
    distance = enter.max(axis=-1)
    return np.where(distance < leave.min(axis=-1), distance + offset, np.nan), enter.argmax(axis=-1)


def plane_down_range(view, horizontal, vertical, *, point, normal):
    """Return the down-range of an infinite plane."""
    start, direction, offset = lines_of_sight(view, horizontal, vertical)
    normal = np.array(normal, Long)
    return ((np.array(point, Long) - start) @ normal) / (direction @ normal) + offset

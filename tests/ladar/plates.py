"""Range images of plates with known closed forms, made without a renderer."""

import numpy as np

from ncti.render import RangeImage
from ncti.render.view import ROLL


def plane(*, width, height, slope=(0.0, 0.0), offset=0.0, pixel=0.25, roll=ROLL, slant_range=None):
    """Return a rectangular plate with r = offset + slope . (horizontal, vertical)."""
    side = int(np.ceil(np.hypot(width, height) / pixel)) + 4
    blank = RangeImage(
        np.zeros((side, side)),
        np.zeros((side, side, 2), np.float32),
        pixel,
        (-(side - 1) / 2 * pixel, -(side - 1) / 2 * pixel),
        aspect=0.0,
        depression=0.0,
        roll=roll,
        slant_range=slant_range,
    )
    horizontal, vertical = blank.cross_range()
    inside = (np.abs(horizontal) < width / 2) & (np.abs(vertical) < height / 2)
    r = np.where(inside, offset + slope[0] * horizontal + slope[1] * vertical, np.nan)
    cos, sin = np.cos(np.radians(roll)), np.sin(np.radians(roll))
    along = np.array([slope[0] * cos + slope[1] * sin, -slope[0] * sin + slope[1] * cos])
    gradient = np.where(inside[..., None], along, np.nan).astype(np.float32)
    return RangeImage(r, gradient, pixel, blank.origin, 0.0, 0.0, roll, slant_range)

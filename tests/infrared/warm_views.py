"""Range images to look at in the infrared: real ships, and plates made without any renderer."""

from functools import cache

import numpy as np

from ncti.render import RangeImage, range_image
from ncti.render.view import ROLL
from ncti.ships import load

SHIPS = ("duncan", "horne", "spruance", "texas")


@cache
def ship(name, aspect, slant_range=None):
    return range_image(
        load(name), aspect=aspect, depression=3.84, engine="auto", slant_range=slant_range
    )


def plate(*, width, height, centre=(0.0, 0.0), pixel=0.25, roll=ROLL, slant_range=None):
    """A rectangle square to the line of sight."""
    side = int(np.ceil((np.hypot(width, height) + 2 * np.hypot(*centre)) / pixel)) + 4
    corner = -(side - 1) / 2 * pixel
    blank = RangeImage(
        np.zeros((side, side)),
        np.zeros((side, side, 2), np.float32),
        pixel,
        (corner, corner),
        aspect=0.0,
        depression=0.0,
        roll=roll,
        slant_range=slant_range,
    )
    horizontal, vertical = blank.cross_range()
    inside = (np.abs(horizontal - centre[0]) < width / 2) & (
        np.abs(vertical - centre[1]) < height / 2
    )
    r = np.where(inside, 0.0, np.nan)
    return RangeImage(r, blank.gradient, pixel, blank.origin, 0.0, 0.0, roll, slant_range)


def points(image):
    """Cross-range of the hit pixels."""
    return image.cross_range_at(*np.nonzero(image.hit))

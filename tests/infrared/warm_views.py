"""Helpers: range images of ships for the infrared tests."""

from functools import cache

import numpy as np

from ncti.render import range_image
from ncti.ships import load

SHIPS = ("duncan", "horne", "spruance", "texas")


@cache
def ship(name, aspect):
    return range_image(load(name), aspect=aspect, depression=3.84, engine="auto")


def points(image):
    """Return the cross-range of the hit pixels."""
    return image.cross_range_at(*np.nonzero(image.hit))

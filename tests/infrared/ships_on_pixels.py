"""Helpers: range images of ships, and their templates in half pixels and in whole pixels."""

from functools import cache

import numpy as np

from ncti.infrared import IFOV, coverage_of
from ncti.render import range_image
from ncti.ships import load

SHIPS = ("duncan", "horne", "spruance", "texas")


@cache
def view(name, aspect):
    """Return a range image by an engine that is always installed; others differ in few pixels."""
    return range_image(load(name), aspect=aspect, depression=3.84, engine="embree")


def template(name="duncan", aspect=60.0, *, slant_range=50e3, phase=(0.2, 0.7), rule=0.25):
    """Return the template of half pixels, padded to pairs, and the template of whole pixels."""
    image = view(name, aspect)
    horizontal, vertical = image.cross_range_at(*np.nonzero(image.hit))
    half = IFOV * slant_range / 2
    coverage = coverage_of(horizontal, vertical, area=0.25**2, footprint=half, phase=phase).coverage
    coverage = np.pad(coverage, [(0, n % 2) for n in coverage.shape])
    pixels = coverage.reshape(len(coverage) // 2, 2, -1, 2).mean(axis=(1, 3))
    return coverage >= rule, pixels >= rule

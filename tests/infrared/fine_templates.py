"""Helpers: templates of ships in half pixels and in whole pixels."""

from functools import cache

import numpy as np
from warm_views import points

from ncti.infrared import IFOV, coverage_of
from ncti.render import RangeImage, range_image
from ncti.ships import load


@cache
def view(name: str, aspect: float) -> RangeImage:
    """Return a range image by an engine that is always installed; others differ in few pixels."""
    return range_image(load(name), aspect=aspect, depression=3.84, engine="embree")


def template(name="duncan", aspect=60.0, *, slant_range=50e3, phase=(0.2, 0.7), rule=0.25):
    """Return the template of half pixels, padded to pairs, and the template of whole pixels."""
    horizontal, vertical = points(view(name, aspect))
    silhouette = coverage_of(
        horizontal,
        vertical,
        area=0.25**2,
        footprint=IFOV * slant_range / 2,
        phase=phase,
        margin=4,
    )
    coverage = np.pad(silhouette.coverage, [(0, n % 2) for n in silhouette.coverage.shape])
    pixels = coverage.reshape(len(coverage) // 2, 2, -1, 2).mean(axis=(1, 3))
    return coverage >= rule, pixels >= rule

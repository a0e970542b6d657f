"""Settings of the infrared channel, and views of a ship of two boxes by its detector."""

from dataclasses import replace

import numpy as np

from ncti.infrared import Hits, Imager
from ncti.render import RangeImage
from sweeps.stages import infrared

WAYS = ("none", "perfect", "shifted")
BOXES = ((-65, 65, 0, 9), (-20, 10, 9, 24))  # left, right, bottom, top [m]
DETECTOR = {"ifov": 150e-6, "seed": 3}
IMAGER = {
    "coverage_rule": 0.25,
    "contrast_at_zero": 2.1585,
    "extinction": 0.181e-3,
    "nedt": 0.3,
    "target_spread": 0.15,
    "sea_spread": 0.08,
}


def drawn(pixel=0.5, roll=31.7):
    """Return a range image of the boxes, which are all as far away."""
    shape = (round(160 / pixel),) * 2
    flat = np.zeros((*shape, 2), dtype=np.float32)
    empty = RangeImage(np.zeros(shape), flat, pixel, (-80, -80), 0, 0, roll)
    horizontal, vertical = empty.cross_range()
    hit = np.zeros(shape, dtype=bool)
    for left, right, bottom, top in BOXES:
        hit |= (left < horizontal) & (horizontal < right) & (bottom < vertical) & (vertical < top)
    return replace(empty, down_range=np.where(hit, 0.0, np.nan))


HITS = vars(Hits.of(drawn()))
PATCHES = Hits.of(drawn()).patches()


def view_from(slant_range, **changed):
    """Return the detector's view of the boxes at a range [km]."""
    view = {"ship": "boxes", "aspect": 60.0, "drawn_aspect": 60.0, "range": slant_range * 1e3}
    detector = {name: changed.pop(name, default) for name, default in DETECTOR.items()}
    return infrared.detector_view(HITS, Imager(**{**IMAGER, **changed}), **view, **detector)

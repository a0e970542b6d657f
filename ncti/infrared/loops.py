"""Compiled loops of infrared images, and the call that compiles them."""

from __future__ import annotations

import numpy as np

from ncti.infrared.silhouette import coverage_of
from ncti.infrared.synthesis import thermal_images
from ncti.machine_code import CompiledLoops


def _synthesise() -> None:
    """Call the loops on a tiny image."""
    from ncti.infrared.cells import places_of_bits

    places = places_of_bits(np.full(1, 255, np.uint8), 4, 1.0, (0.0, 0.0), (1.0, 0.0))
    target = coverage_of(*places, area=1.0, footprint=1.0).target(0.5)
    thermal_images(target, contrast=1.0, frame_counts=[16], rng=np.random.default_rng(0))


IMAGES = CompiledLoops(
    "infrared images",
    tuple(
        f"infrared.cells.{name}"
        for name in ("count_points", "places_of_bits", "bounding_box", "lay_out")
    ),
    _synthesise,
)

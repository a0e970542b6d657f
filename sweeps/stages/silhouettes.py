"""Silhouettes of ships, segmented from infrared images and mapped to log-polar cells."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti import features
from sweeps.engine.stage import Output, Stage, stage
from sweeps.stages.infrared import IMAGES, LOOK, VIEW, Infrared, looks_infrared
from sweeps.stages.infrared_look import Bits, Look, Patches, footprint_at
from sweeps.stages.places import place
from sweeps.stages.views import STATUS, Grid

ANGLES, RADII = 64, 32  # cells of the log-polar map
IMPORTS = ("skimage.filters",)  # by its stages, when they are called; takes long
STEPS = 255  # of a cell between empty and full

TEMPLATE = ("coverage_rule", "inner_radius", "interpolation", "phase")
OF_SILHOUETTES = ("coverage_rule", "segmentation", "inner_radius", "interpolation")

Bytes = NDArray[np.uint8]

_stored = partial(stage, uses=(Infrared,), group=IMAGES, when=looks_infrared)
_map = partial(Output, dims=("angle", "radius"), dtype="u1", fill=0, step=1 / STEPS)


@_stored(
    Output("angle", ("angle",), "f8", "angle about the centroid, from the right upwards", "degree"),
    Output("radius", ("radius",), "f8", "place between inner (0) and outer (1) log radius"),
    coordinates=True,
)
def map_cells() -> dict[str, NDArray[Any]]:
    """Return the angles and radii of the cells of log-polar maps."""
    return {
        "angle": 360 / ANGLES * (np.arange(ANGLES) + 0.5),
        "radius": (np.arange(RADII) + 0.5) / RADII,
    }


@stage(
    Output("silhouettes", ("row", "byte"), "u1"),
    uses=(Infrared,),
    along=(Infrared.segmentation, Infrared.phases, Infrared.frame_count),
)
def silhouettes(
    look: Look,
    super_resolution: str,
    segmentation: tuple[str, ...],
    phases: tuple[int, ...],
    frame_count: tuple[int, ...],
) -> Bytes:
    """Return (segmentation, phase, frame_count, row, byte) masks of images, one bit per pixel."""
    shown = look.images(super_resolution, phases, frame_count)
    known: dict[str, Any] = {
        "contrast": look.contrast,
        **look.sigmas(super_resolution, frame_count),
    }
    masks = [features.segment(shown, method=method, **known) for method in segmentation]
    return np.packbits(masks, axis=-1)


@_stored(
    _map("log_polar", label="log-polar map of the segmented silhouette"),
    along=(
        *(Infrared.segmentation, Infrared.inner_radius, Infrared.interpolation),
        *(Infrared.phases, Infrared.frame_count),
    ),
    dims=(*VIEW, *OF_SILHOUETTES, "phase", *LOOK),
    status=STATUS,
)
def log_polar(
    silhouettes: Bytes,
    segmentation: tuple[str, ...],
    inner_radius: tuple[float, ...],
    interpolation: tuple[str, ...],
    phases: tuple[int, ...],
    frame_count: tuple[int, ...],
) -> Bytes:
    """Return maps by segmentation, inner radius, interpolation, phase and number of frames.

    (segmentation, inner_radius, interpolation, phase, frame_count, angle, radius).
    """
    # Padding bits beyond the last column are sea, which does not change the map.
    masks = np.unpackbits(silhouettes, axis=-1).astype(bool)
    # (inner_radius, interpolation, segmentation, ...)
    return np.moveaxis(maps_of(masks, inner_radius, interpolation), 2, 0)


@_stored(
    _map(
        "template_log_polar",
        label="log-polar map of the noiseless silhouette at the training range",
    ),
    uses=(Infrared, Grid),
    reads={"hits": "training_hits"},
    along=(Infrared.inner_radius, Infrared.interpolation, Infrared.phases),
    dims=(*VIEW, *TEMPLATE),
    status=STATUS,
)
def template_log_polar(
    hits: Bits,
    aspect: float,
    drawn_aspect: float,
    training_range: float,
    ifov: float,
    coverage_rule: float,
    inner_radius: tuple[float, ...],
    interpolation: tuple[str, ...],
    phases: tuple[int, ...],
) -> Bytes:
    """Return (inner_radius, interpolation, phase, angle, radius) noiseless maps."""
    patches = Patches.of(hits, mirrored=aspect != drawn_aspect)
    footprint = footprint_at(training_range, ifov)
    shown = [
        patches.covering(footprint, place(phase), subdivision=1).target(coverage_rule)
        for phase in phases
    ]
    # Without noise every segmentation gives the same mask.
    return maps_of(features.segment(shown, method="otsu"), inner_radius, interpolation)


def maps_of(
    masks: NDArray[np.bool_], inner_radius: tuple[float, ...], interpolation: tuple[str, ...]
) -> Bytes:
    """Return (inner_radius, interpolation, ..., angle, radius) maps of (..., row, col) masks.

    In 255ths of a cell: half a step is nothing beside what a pixel's noise does.
    """
    size = {"angles": ANGLES, "radii": RADII}
    cells: Any = [
        [
            features.log_polar(masks, inner_radius=radius, interpolation=between, **size)
            for between in interpolation
        ]
        for radius in inner_radius
    ]
    return np.rint(STEPS * np.array(cells)).astype(np.uint8)


STAGES: tuple[Stage, ...] = (map_cells, silhouettes, log_polar, template_log_polar)

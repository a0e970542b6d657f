"""Simulated signatures of the rows of one view, each row from its own random streams."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require_instance, require_word
from ncti.features import segment, silhouette_map
from ncti.infrared import SUPER_RESOLUTIONS, DetectorView, Hits, Imager, footprint
from ncti.ladar.beam import Beam, Signal
from ncti.ladar.budget import power_ratio
from ncti.ladar.expected import expected_profile
from ncti.ladar.extent import bins_of, range_extent
from ncti.ladar.frames import averaged_frames
from ncti.ladar.moments import frame_variance
from ncti.ladar.pulse import noise_floor
from ncti.render import LineImage, drawn_range, line_image
from ncti.render.far_field import SHARE, reach_of
from ncti.ships.shape import Mesh
from ncti.simulate.subject import Ship, read_ship, roll_at

Arrays = dict[str, NDArray[Any]]

VIEW = ("ship", "aspect", "depression", "slant_range")
"""Parameters of a view."""

SIGNAL = ("pulse_width", "cnr", "frames", "gain", "floor")
"""Parameters of a row of the laser radar, besides those of its view."""

IFOV_OFFSET = ("right", "up")
"""Place of the ship on the grid of IFOVs in a row of the laser radar."""

VIEW_STREAM, ROW_STREAM, SPECKLE_STREAM, IMAGE_STREAM = range(4)
"""Streams of random numbers: parameters of a view, of a row, its speckle, and its image."""

SENSOR_SETS = {"range": ("range",), "infrared": ("infrared",), "both": ("range", "infrared")}
"""Sensors by their name in a data set."""


@dataclass(frozen=True)
class Recipe:
    """Settings that all rows of a data set share, in any process.

    `ships` are names, paths or meshes, and `sensor` is a word of `SENSOR_SETS`. Each frame
    accumulates `target_free_ifovs` besides the ship's. The imager's pixels are as wide as the
    IFOVs. Lines are `spacing` [m] apart, and `far_field_error` [1] is the largest error of drawing
    the far field in place of a slant range. `expected` requests expected profiles as well.
    """

    ships: tuple[Ship, ...]
    seed: int
    sensor: str
    beam: Beam
    target_free_ifovs: int
    imager: Imager
    super_resolution: str
    spacing: float
    far_field_error: float
    expected: bool

    def __post_init__(self) -> None:
        require_word("sensor", self.sensor, SENSOR_SETS)
        require_word("super_resolution", self.super_resolution, SUPER_RESOLUTIONS)
        require_instance("imager", self.imager, Imager)
        bins_of(self.beam.window, self.beam.bin_width)

    def rng(self, key: int, row: int) -> np.random.Generator:
        """Return the random generator of one row."""
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(key, row)))


def simulated(recipe: Recipe, drawn: Arrays) -> Arrays:
    """Return the signatures (row, ...) of rows, in which equal views are consecutive.

    `drawn` has number and parameters (row,) of each row, its ship as an index. The laser radar has
    `profile`, optionally `expected`, both with noise floor, and `error_bound`; the imager has
    `silhouette`, log-polar maps in bytes. BLAS has one thread, as the last bit of a product depends
    on the number of threads.
    """
    from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

    with threadpool_limits(1):
        views = list(_views(recipe, drawn))
    return {name: np.concatenate([view[name] for view in views]) for name in views[0]}


def _views(recipe: Recipe, drawn: Arrays) -> Iterator[Arrays]:
    """Yield the signatures of each view."""
    image, last_sight = None, None
    for rows in equal_rows(drawn, VIEW):
        ship, aspect, depression, slant_range = (drawn[name][rows.start].item() for name in VIEW)
        mesh = read_ship(recipe.ships[ship])
        sight = (ship, aspect, depression, drawing_range(mesh, slant_range, recipe.far_field_error))
        # Ranges of a far field share its image.
        if image is None or sight != last_sight:
            last_sight = sight
            image = line_image(
                mesh,
                aspect=aspect,
                depression=depression,
                slant_range=sight[-1],
                roll=roll_at(aspect),
                spacing=min(recipe.spacing, recipe.beam.ifov * slant_range),
            )
        parameters = {name: values[rows] for name, values in drawn.items()}
        signatures: Arrays = {}
        if "range" in SENSOR_SETS[recipe.sensor]:
            signatures |= profiles(recipe, image, slant_range, parameters)
        if "infrared" in SENSOR_SETS[recipe.sensor]:
            signatures["silhouette"] = silhouettes(recipe, image, slant_range, parameters)
        yield signatures


def drawing_range(mesh: Mesh, slant_range: float, error: float) -> float | None:
    """Return the slant range [m] to draw a ship at; None if the far field is accurate enough."""
    return drawn_range(reach_of(mesh.vertices), slant_range, tolerance=error / SHARE)


def equal_rows(drawn: Arrays, names: Sequence[str]) -> list[slice]:
    """Return the runs of rows with equal values of the parameters `names`."""
    differ = [drawn[name][1:] != drawn[name][:-1] for name in names]
    starts = np.flatnonzero(np.any(differ, axis=0)) + 1
    ends = [0, *starts.tolist(), len(drawn[names[0]])]
    return [slice(*bounds) for bounds in pairwise(ends)]


def profiles(recipe: Recipe, image: LineImage, slant_range: float, drawn: Arrays) -> Arrays:
    """Return the profiles of the rows of one view, and optionally the expected ones."""
    beam, free = recipe.beam, recipe.target_free_ifovs
    count, bins = len(drawn["row"]), bins_of(beam.window, beam.bin_width)[1]
    arrays: Arrays = {
        name: np.empty((count, bins), dtype=np.float32)
        for name in ("profile", *(["expected"] if recipe.expected else []))
    }
    arrays["error_bound"] = np.empty(count)
    for k, row in enumerate(drawn["row"].tolist()):
        right, up = (drawn[name][k].item() for name in IFOV_OFFSET)
        extent = range_extent(image, slant_range=slant_range, shift=(right, up), **vars(beam))
        floor = (len(extent.fraction) + free) * noise_floor()
        pulse_width, cnr, frames, gain, shift = (drawn[name][k].item() for name in SIGNAL)
        signal = vars(Signal(pulse_width, power_ratio(cnr), free))
        [profile] = averaged_frames(extent, [frames], rng=recipe.rng(SPECKLE_STREAM, row), **signal)
        change = np.zeros(profile.shape)
        if recipe.expected or gain != 1.0:
            mean = expected_profile(extent, **signal)
            change += (gain - 1.0) * (mean - floor)
        if shift:
            change += shift * math.sqrt(frame_variance(extent, **signal).mean())
        arrays["profile"][k] = profile + change
        if recipe.expected:
            arrays["expected"][k] = mean + change
        arrays["error_bound"][k] = extent.error_after(pulse_width)
    return arrays


def silhouettes(
    recipe: Recipe, image: LineImage, slant_range: float, drawn: Arrays
) -> NDArray[np.uint8]:
    """Return the log-polar maps of the rows of one view, each at its own place on the pixels.

    They map the silhouettes of the matched segmentation.
    """
    imager, method = recipe.imager, recipe.super_resolution
    patches = Hits.of(image).patches()
    side, contrast = footprint(slant_range, recipe.beam.ifov), imager.contrast(slant_range)
    images = []
    for row, frames in zip(drawn["row"].tolist(), drawn["frames"].tolist(), strict=True):
        rng = recipe.rng(IMAGE_STREAM, row)
        view = DetectorView(patches, side, contrast, imager, lambda rng=rng, **_: rng)
        images.append(view.images(method, (0,), (frames,))[0, 0])
    known: Any = imager.sigmas(drawn["frames"], method)
    return silhouette_map(segment(images, method="matched", contrast=contrast, **known))

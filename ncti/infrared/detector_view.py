"""Images, reconstruction errors and detection of a ship at subpixel offsets on the detector."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, cached_property, lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from ncti.infrared.detection import detection_probability
from ncti.infrared.hits import MARGIN, Patches
from ncti.infrared.imager import Imager
from ncti.infrared.silhouette import Silhouette, coverage_of, footprint
from ncti.infrared.super_resolution import enlarge, reconstruction_error

Floats = NDArray[np.float64]
SubpixelOffset = tuple[float, float]  # of the ship origin in a pixel, across and up [pixel]

HALF_PIXELS = {"none": 2, "perfect": 1, "shifted": 1}
"""Width of a pixel in half pixels of the detector, by super-resolution method."""

FULL_PIXEL = HALF_PIXELS["none"]  # width of a detector pixel

MAX_OFFSETS = 1000
"""Largest number of places of a ship on the pixels."""

MIN_CONTRAST = 1e-6
"""Contrast [K] below which the relative error of images is undefined."""


@dataclass(frozen=True)
class LargestWindow:
    """Window that holds the image of the largest ship, at any aspect.

    Attributes
    ----------
    slant_range : float
        Sensor to ship [m].
    depression : float
        Depression of the line of sight [deg].
    ifov : float
        Field of view of a pixel [rad].
    length, height : float
        Length and height of the largest ship [m].

    See Also
    --------
    DetectorView.image_in : Image of a ship in it.

    Examples
    --------
    >>> from ncti.infrared import LargestWindow
    >>> window = LargestWindow(100e3, 3.84, 150e-6, 200.0, 50.0)
    >>> window.half_pixels().coverage.shape
    (28, 46)
    """

    slant_range: float
    depression: float
    ifov: float
    length: float
    height: float

    def half_pixels(self, place: SubpixelOffset = (0.0, 0.0)) -> Silhouette:
        """Return the window's half pixels, all sea, for a ship origin at `place` in its pixel."""
        return _half_pixels(self, place)  # cached, as all super-resolution methods share it

    def axes(self, super_resolution: str) -> dict[str, Floats]:
        """Return cross-ranges of its pixel centres [m], `vertical` (row,), `horizontal` (col,)."""
        pixels = self.half_pixels()
        places = {}
        for axis, name in enumerate(("vertical", "horizontal")):
            halves = pixels.origin[1 - axis] + pixels.footprint * np.arange(
                pixels.coverage.shape[axis]
            )
            places[name] = halves.reshape(-1, HALF_PIXELS[super_resolution]).mean(axis=1)
        return places


@lru_cache(maxsize=8)
def _half_pixels(window: LargestWindow, place: SubpixelOffset) -> Silhouette:
    half, down = window.length / 2, np.radians(window.depression)
    bottom = -half * np.sin(down)
    top = half * np.sin(down) + window.height * np.cos(down)
    # The nearest part of the ship looks this much larger than at the range of the ship origin.
    nearest = half * np.cos(down) + window.height * np.sin(down)
    larger = 1.0 / (1.0 - min(nearest / window.slant_range, 0.5))
    sides = (-half * larger, half * larger, bottom * larger, top * larger)
    sea, pixel = np.zeros(0), footprint(window.slant_range, window.ifov)
    options = {"footprint": pixel, "phase": place, "margin": MARGIN, "extent": sides}
    return coverage_of(sea, sea, area=1.0, **options, subdivision=2)  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class DetectorView:
    """A ship at one aspect and range on one detector, imaged on request.

    Only the ship and a margin of sea around it are synthesised: sea farther off does not
    affect the ship.

    Attributes
    ----------
    patches : Patches
        The ship across the line of sight, as of `Hits.patches`.
    footprint : float
        Side of a pixel on the target [m].
    contrast : float
        Ship above sea, after the air [K].
    imager : Imager
        The imager.
    stream : callable
        Function of `stage` and optionally `super_resolution` that returns a random generator, the
        same for equal arguments. Stage `infrared_place` is for subpixel offsets of the ship,
        `infrared` for images.

    See Also
    --------
    Hits : Its patches.
    thermal_images, shifted_images : Images of a target.

    Examples
    --------
    The probability of detecting a box of 100 m at 50 km, at two subpixel offsets, for 1 and 16
    frames:

    >>> import numpy as np
    >>> import trimesh
    >>> from ncti.infrared import DetectorView, Hits, Imager
    >>> from ncti.render import line_image
    >>> box = trimesh.creation.box((100, 12, 10)).apply_translation((0, 0, 5))
    >>> hits = Hits.of(line_image(box, aspect=90, depression=3.84, spacing=1.0))
    >>> imager = Imager(nedt=0.3)
    >>> view = DetectorView(hits.patches(), 7.5, imager.contrast(50e3), imager,
    ...                     lambda stage, **more: np.random.default_rng(0))
    >>> view.detection_probability(1e-6, (0, 1), (1, 16)).round(2)
    array([[0.22, 1.  ],
           [0.23, 1.  ]])
    """

    patches: Patches
    footprint: float
    contrast: float
    imager: Imager
    stream: Callable[..., np.random.Generator]
    _drawn: dict[tuple[str, tuple[int, ...]], tuple[np.random.Generator, list[Floats]]] = field(
        default_factory=dict
    )

    @cached_property
    def _places(self) -> list[list[float]]:
        # One stream for all places, so that a place does not depend on their number.
        return self.stream(stage="infrared_place").random((MAX_OFFSETS, 2)).tolist()

    def place(self, offset: int) -> SubpixelOffset:
        """Return the position of the ship origin in a pixel, by its number."""
        across, up = self._places[offset]
        return across, up

    @cached_property
    def coverage_at(self) -> Callable[[int], Silhouette]:
        """Coverage of half pixels by the ship at one of its places on the detector, by number."""
        covering = partial(self.patches.covering, self.footprint, subdivision=2)
        return cache(lambda offset: covering(self.place(offset)))

    def mask(self, offset: int, halves: int) -> NDArray[np.bool_]:
        """Return the (row, col) mask of the ship, in pixels 1 or 2 half pixels wide."""
        pixels = self.coverage_at(offset).coverage
        if halves > 1:
            rows, cols = (size // halves for size in pixels.shape)
            pixels = pixels.reshape(rows, halves, cols, halves).mean(axis=(1, 3))
        return pixels >= self.imager.coverage_rule

    def images(
        self, super_resolution: str, subpixel_offsets: tuple[int, ...], frame_count: tuple[int, ...]
    ) -> Floats:
        """Return (offset, frame_count, row, col) images [K] of one super-resolution method.

        One stream draws all offsets in turn, so every offset up to the largest requested is drawn.
        """
        key = super_resolution, frame_count
        if key not in self._drawn:
            rng = self.stream(stage="infrared", super_resolution=super_resolution)
            self._drawn[key] = rng, []
        rng, drawn = self._drawn[key]
        for offset in range(len(drawn), max(subpixel_offsets) + 1):
            images = self.imager.images(
                self.mask(offset, HALF_PIXELS[super_resolution]),
                contrast=self.contrast,
                frame_counts=frame_count,
                rng=rng,
                super_resolution=super_resolution,
            )
            drawn.append(images)
        return np.array([drawn[offset] for offset in subpixel_offsets])

    def image_in(
        self, window: LargestWindow, super_resolution: str, frame_count: tuple[int, ...]
    ) -> Floats:
        """Return (frame_count, row, col) images [K] at the first offset, placed in a window.

        NaN outside the synthesised surroundings of the ship.
        """
        (images,) = self.images(super_resolution, (0,), frame_count)
        full, origin = window.half_pixels(self.place(0)), self.coverage_at(0).origin
        cells = HALF_PIXELS[super_resolution]
        rows, cols = (n // cells for n in full.coverage.shape)
        row, col = (
            round((origin[axis] - full.origin[axis]) / full.footprint) // cells for axis in (1, 0)
        )
        placed = np.full((len(frame_count), rows, cols), np.nan)
        # The ship's window may end with a pixel of sea beyond the full window.
        images = images[:, : rows - row, : cols - col]
        placed[:, row : row + images.shape[1], col : col + images.shape[2]] = images
        return placed

    def detection_probability(
        self, false_alarm: float, subpixel_offsets: tuple[int, ...], frame_count: tuple[int, ...]
    ) -> Floats:
        """Return the (offset, frame_count) probability that a ship pixel exceeds the threshold.

        A pixel of sea exceeds the threshold with the false-alarm probability.
        """
        pixels = [np.count_nonzero(self.mask(offset, FULL_PIXEL)) for offset in subpixel_offsets]
        return np.vectorize(detection_probability)(
            np.array(pixels)[:, None],
            contrast=self.contrast,
            false_alarm=false_alarm,
            **self.imager.sigmas(np.array(frame_count)),
        )

    def reconstruction_error(
        self, super_resolution: str, subpixel_offsets: tuple[int, ...], frame_count: tuple[int, ...]
    ) -> Floats:
        """Return the (offset, frame_count) error of images, NaN for negligible contrast.

        See `ncti.infrared.reconstruction_error`; the noiseless image has half pixels.
        """
        if self.contrast < MIN_CONTRAST:  # no contrast to divide by
            return np.full((len(subpixel_offsets), len(frame_count)), np.nan)
        images = self.images(super_resolution, subpixel_offsets, frame_count)
        finer = enlarge(images) if HALF_PIXELS[super_resolution] == FULL_PIXEL else images
        return np.array(
            [
                reconstruction_error(image, self.mask(offset, 1), contrast=self.contrast)
                for offset, image in zip(subpixel_offsets, finer, strict=True)
            ]
        )

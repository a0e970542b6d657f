"""A ship on an infrared detector: its positions on the pixels, and its images."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.infrared import (
    Silhouette,
    coverage_of,
    pixel_sigma,
    shifted_images,
    silhouette,
    thermal_images,
)
from ncti.render import LineImage, RangeImage
from ncti.render.image import Lattice
from sweeps.engine.seeds import cell_rng

MARGIN = 4  # pixels of sea around a ship

Place = tuple[float, float]  # of the ship origin in a pixel, across and up [pixel]
Bits = dict[str, NDArray[Any]]
Floats = NDArray[np.float64]

HALVES = {"none": 2, "perfect": 1, "shifted": 1}
"""By way of super-resolution: how many half pixels of the detector a pixel is wide."""


def pack_hits(image: RangeImage | LineImage) -> Bits:
    """Return where a range image, or lines, show the ship.

    Returns
    -------
    dict of str to ndarray
        lattice : (4,) float64, pixel, origin across and up, and roll; of lines their spacing, 0,
        phase and roll. bits : (byte,) uint8, a bit a pixel; columns : (), of the image, 0 of lines.
        line : (piece,) int32 and span : (piece, 2) float64, begin and end of what lines see.
    """
    if isinstance(image, LineImage):
        return {
            "lattice": np.array([image.spacing, 0.0, image.phase, image.roll]),
            "bits": np.zeros(0, np.uint8),
            "columns": np.array(0),
            "line": image.line,
            "span": image.piece[:, :2],
        }
    return {
        "lattice": np.array([image.pixel, *image.origin, image.roll]),
        "bits": np.packbits(image.hit),
        "columns": np.array(image.hit.shape[1]),
        "line": np.zeros(0, np.int32),
        "span": np.zeros((0, 2)),
    }


@dataclass(frozen=True, eq=False)
class Patches:
    """Patches of a ship: (point,) cross-ranges [m], and the area of one [m^2].

    Of lines, points are the corners of their bounding box, and `lines` has what lies between.
    """

    horizontal: Floats
    vertical: Floats
    area: float
    lines: LineImage | None = None

    @classmethod
    def of(cls, hits: Bits, *, mirrored: bool = False) -> Patches:
        """Patches of a stage `hits`, with left and right swapped or not."""
        pixel, left, bottom, roll = hits["lattice"].tolist()
        if not hits["columns"]:
            span = hits["span"]
            if mirrored:
                span, roll = -span[:, ::-1], -roll
            lines = _flat(hits["line"], span, spacing=pixel, phase=bottom, roll=roll)
            return cls(*lines.bounds, pixel**2, lines)
        from ncti.infrared.cells import places_of_bits  # numba takes long to import

        lattice = pixel, (left, bottom), Lattice(pixel, (left, bottom), roll).turn
        horizontal, vertical = places_of_bits(hits["bits"], int(hits["columns"]), *lattice)
        return cls(-horizontal if mirrored else horizontal, vertical, pixel**2)

    @cached_property
    def extent(self) -> tuple[float, float, float, float]:
        """The bounding box, for windows of one shape at all places on the detector."""
        (left, right), (bottom, top) = (
            (float(line.min()), float(line.max())) for line in (self.horizontal, self.vertical)
        )
        return left, right, bottom, top

    def covering(self, footprint: float, place: Place, *, subdivision: int) -> Silhouette:
        """Coverage of a detector's pixels with this footprint [m], or of parts of them."""
        window: dict[str, Any] = {"footprint": footprint, "phase": place, "margin": MARGIN}
        window |= {"extent": self.extent, "subdivision": subdivision}
        if self.lines is not None:
            return silhouette(self.lines, **window)
        return coverage_of(self.horizontal, self.vertical, area=self.area, **window)


def _flat(
    line: NDArray[np.int32], span: Floats, *, spacing: float, phase: float, roll: float
) -> LineImage:
    """Lines of which only the place across the line of sight counts."""
    nothing = np.zeros_like(span)
    surface = np.zeros(len(line), np.int32)
    piece = np.concatenate([span, nothing], axis=1)
    return LineImage(line, piece, surface, np.zeros((1, 3)), spacing, phase, 0.0, 0.0, roll)


def footprint_at(slant_range: float, ifov: float) -> float:
    """Return the side of a pixel on the target [m] at a slant range [km], of an IFOV [urad]."""
    return ifov * 1e-6 * slant_range * 1e3


@dataclass(frozen=True, eq=False)
class Look:
    """A ship at one aspect and range on one detector, imaged on request.

    Only the ship and a margin of sea around it are synthesised: sea farther off does not
    affect the ship.
    """

    patches: Patches
    footprint: float  # side of a pixel on the target [m]
    coverage_rule: float  # share of a pixel that the ship fills to show
    contrast: float  # ship above sea, after the air [K]
    nedt: float  # noise of one frame, and own spread of ship and sea [K]
    target_spread: float
    sea_spread: float
    seed: int
    name: dict[str, Any]  # ship, aspect and range, which name the noise
    _places: list[Place] = field(default_factory=list)
    _covered: dict[int, Silhouette] = field(default_factory=dict)
    _shown: dict[tuple[int, int], NDArray[np.bool_]] = field(default_factory=dict)
    _drawn: dict[tuple[str, tuple[int, ...]], tuple[np.random.Generator, list[Floats]]] = field(
        default_factory=dict
    )

    def place(self, phase: int) -> Place:
        """Return the position of the ship origin in a pixel, by its number."""
        # One stream for all places, one after the other.
        while len(self._places) <= phase:
            across, up = self._placing.random(2).tolist()
            self._places.append((across, up))
        return self._places[phase]

    @cached_property
    def _placing(self) -> np.random.Generator:
        return cell_rng(self.seed, stage="infrared_place", **self.name)

    def covered(self, phase: int) -> Silhouette:
        """Coverage of half pixels by the ship at one of its places on the detector."""
        if phase not in self._covered:
            place = self.place(phase)
            self._covered[phase] = self.patches.covering(self.footprint, place, subdivision=2)
        return self._covered[phase]

    def shown(self, phase: int, halves: int) -> NDArray[np.bool_]:
        """(row, col): pixels of 1 or 2 half pixels' width that show the ship."""
        if (phase, halves) not in self._shown:
            pixels = self.covered(phase).coverage
            if halves > 1:
                rows, cols = (size // halves for size in pixels.shape)
                pixels = pixels.reshape(rows, halves, cols, halves).mean(axis=(1, 3))
            self._shown[phase, halves] = pixels >= self.coverage_rule
        return self._shown[phase, halves]

    def images(self, way: str, phases: tuple[int, ...], frame_counts: tuple[int, ...]) -> Floats:
        """Return (phase, frame_count, row, col) images [K] of one super-resolution method.

        All places are drawn from one stream in turn, so those before the last one wanted, too.
        """
        draw = shifted_images if way == "shifted" else thermal_images
        if (way, frame_counts) not in self._drawn:
            rng = cell_rng(self.seed, stage="infrared", super_resolution=way, **self.name)
            self._drawn[way, frame_counts] = rng, []
        rng, drawn = self._drawn[way, frame_counts]
        for phase in range(len(drawn), max(phases) + 1):
            images = draw(
                self.shown(phase, HALVES[way]),
                contrast=self.contrast,
                frame_counts=frame_counts,
                rng=rng,
                nedt=self.nedt,
                target_spread=self.target_spread,
                sea_spread=self.sea_spread,
            )
            drawn.append(images)
        return np.array([drawn[phase] for phase in phases])

    def sigmas(self, way: str, frame_counts: tuple[int, ...]) -> dict[str, Floats]:
        """target_sigma, sea_sigma : (frame_count,) deviations of a pixel of such an image [K]."""
        noise: dict[str, Any] = {"nedt": self.nedt, "super_resolution": way}
        counts = np.array(frame_counts)
        return {
            f"{name}_sigma": np.asarray(pixel_sigma(spread, frame_count=counts, **noise))
            for name, spread in (("target", self.target_spread), ("sea", self.sea_spread))
        }


@lru_cache(maxsize=8)  # all ways of super-resolution at one place have it
def whole_window(
    slant_range: float,
    depression: float,
    ifov: float,
    length: float,
    height: float,
    *,
    place: Place = (0.0, 0.0),
) -> Silhouette:
    """Return half pixels of a window for the largest ship, all of them sea.

    At a slant range [km] and depression [deg], of an IFOV [urad]; length and height are the ship's
    [m], and its origin is at a place in a pixel.
    """
    half, down = length / 2, np.radians(depression)
    bottom = -half * np.sin(down)
    top = half * np.sin(down) + height * np.cos(down)
    # The nearest part of the ship looks this much larger than at the range of the ship origin.
    nearest = half * np.cos(down) + height * np.sin(down)
    larger = 1.0 / (1.0 - min(nearest / (slant_range * 1e3), 0.5))
    sides = (-half * larger, half * larger, bottom * larger, top * larger)
    frame: dict[str, Any] = {"extent": sides, "margin": MARGIN}
    pixel = footprint_at(slant_range, ifov)
    sea = np.zeros(0)
    return coverage_of(sea, sea, area=1.0, footprint=pixel, phase=place, **frame, subdivision=2)

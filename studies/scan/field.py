"""Field of regard: places of targets, thermal image, and detection."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncti.infrared import thermal_images

Pixels = NDArray[np.int64]


class Box(NamedTuple):
    """Rectangle of pixels: the first column and row, and one past the last."""

    left: int
    bottom: int
    right: int
    top: int

    @property
    def size(self) -> tuple[int, int]:
        """Number of columns and rows."""
        return self.right - self.left, self.top - self.bottom

    def relative_to(self, column: int, row: int) -> Box:
        """Return the same pixels, counted from another pixel."""
        return Box(self.left - column, self.bottom - row, self.right - column, self.top - row)

    def holds(self, cells: Pixels) -> NDArray[np.bool_]:
        """Return the mask (cell,) of columns and rows (cell, 2) inside."""
        return np.all((cells >= self[:2]) & (cells < self[2:]), axis=-1)


MAX_PIXELS = 1e8
"""Pixels of a field: an image of them takes 0.8 GB."""


@dataclass(frozen=True, kw_only=True)
class Field:
    """Field of regard, divided into square pixels.

    `width` in azimuth, `height` in elevation, and `ifov`, the side of a pixel [rad].
    """

    width: float
    height: float
    ifov: float

    def __post_init__(self) -> None:
        finest = math.sqrt(self.width * self.height / MAX_PIXELS)
        if self.ifov < finest:
            raise ValueError(
                f"ifov is {self.ifov!r} rad, but must be at least {finest:.3g} rad, of which a "
                f"field of {self.width:g} by {self.height:g} rad has {MAX_PIXELS:g} pixels"
            )

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of pixels that cover the field."""
        rows, columns = (math.ceil(side / self.ifov) for side in (self.height, self.width))
        return rows, columns

    @property
    def box(self) -> Box:
        """All pixels of the field."""
        rows, columns = self.shape
        return Box(0, 0, columns, rows)

    def pixel(self, bearing: float, elevation: float) -> tuple[int, int]:
        """Return column and row of the pixel corner nearest to a direction from the middle [rad].

        A target's origin lies on a corner: its IFOVs are those of `ncti.ladar.RangeExtent`.
        """
        rows, columns = self.shape
        return round(bearing / self.ifov + columns / 2), round(elevation / self.ifov + rows / 2)


@dataclass(frozen=True, kw_only=True)
class Detection:
    """Pixels above the threshold that may belong to one ship, `pixel` (pixel, 2) in their `box`."""

    box: Box
    pixel: Pixels


def elevation(slant_range: float, *, middle_range: float, depression: float) -> float:
    """Return the elevation of a target on a flat sea above the middle of the field [rad].

    `slant_range` and `middle_range` [m] lead to the target and the middle, `depression` [rad] to
    the middle. The sensor's height is common: slant_range sin(d) = middle_range sin(depression).
    """
    return depression - math.asin(middle_range * math.sin(depression) / slant_range)


def thermal_field(
    field: Field,
    targets: Sequence[Pixels],
    contrasts: Sequence[float],
    *,
    frame_count: int,
    rng: np.random.Generator,
    nedt: float,
    target_spread: float,
    sea_spread: float,
) -> NDArray[np.float64]:
    """Return a (row, column) thermal image of targets on the sea, against the mean sea [K].

    `targets` are (pixel, 2) columns and rows; pixels outside the field are ignored. Each target has
    one of the `contrasts` [K]; in a shared pixel the later target counts. Row 0 is the lowest. The
    noise model is that of `ncti.infrared.thermal_images`.
    """
    signal, covered = np.zeros(field.shape), np.zeros(field.shape, dtype=bool)
    for pixel, contrast in zip(targets, contrasts, strict=True):
        column, row = pixel[field.box.holds(pixel)].T
        signal[row, column], covered[row, column] = contrast, True
    [image] = thermal_images(
        covered,
        contrast=0.0,
        frame_counts=[frame_count],
        rng=rng,
        nedt=nedt,
        target_spread=target_spread,
        sea_spread=sea_spread,
    )
    return image + signal


def detect(
    image: NDArray[np.float64], *, threshold: float, reach: tuple[int, int]
) -> tuple[Detection, ...]:
    """Return groups of pixels above a threshold, by single linkage, sorted by left side.

    `reach` is the largest difference of columns, and of rows, between two pixels of one ship.
    Pixels within reach are grouped, and groups that share a pixel merged: one ship never makes two
    detections; a false alarm within reach joins and widens its detection.
    """
    hot = np.argwhere(image > threshold)[:, ::-1]
    if not len(hot):
        return ()
    # Imported where they are used: scipy takes a tenth of a second.
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    # In units of the reach, neighbours are those within 1 in either direction; a reach of 0 too.
    tree = KDTree(hot / (np.array(reach) + 0.5))
    pairs = tree.query_pairs(1.0, p=np.inf, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=(len(hot), len(hot)))
    count, label = connected_components(links, directed=False)
    parts = (hot[label == number] for number in range(count))
    detections = [Detection(box=_box(pixel), pixel=pixel) for pixel in parts]
    return tuple(sorted(detections, key=lambda detection: detection.box))


def _box(pixel: Pixels) -> Box:
    left, bottom = pixel.min(axis=0).tolist()
    right, top = (pixel.max(axis=0) + 1).tolist()
    return Box(left, bottom, right, top)


def cue(box: Box, *, reach: tuple[int, int], detector: int) -> Box:
    """Return the box to visit: every pixel that a ship with the detected ones could reach.

    It is a whole number of detector positions, `detector` elements along a side. A single pixel
    gives 2 reach + 1 columns, a ship detected from end to end reach + 1.
    """
    lower, upper = [], []
    for low, high, steps in zip(box[:2], box[2:], reach, strict=True):
        begin = min(low, high - 1 - steps)
        size = max(high, low + 1 + steps) - begin
        lower.append(begin)
        upper.append(begin + -(-size // detector) * detector)
    return Box(*lower, *upper)

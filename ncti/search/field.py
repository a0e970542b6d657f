"""The field of regard: where targets lie in it, its thermal image, and what is detected there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require
from ncti.infrared import thermal_images

Pixels = NDArray[np.int64]


class Box(NamedTuple):
    """Pixels of a rectangle: the first column and row, and those behind the last."""

    left: int
    bottom: int
    right: int
    top: int

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows."""
        return self.right - self.left, self.top - self.bottom

    def less(self, column: int, row: int) -> Box:
        """Return the same pixels, counted from another one."""
        return Box(self.left - column, self.bottom - row, self.right - column, self.top - row)

    def holds(self, cells: Pixels) -> NDArray[np.bool_]:
        """(cell,) bool ndarray: which of some (cell, 2) columns and rows are inside."""
        return np.all((cells >= self[:2]) & (cells < self[2:]), axis=-1)


@dataclass(frozen=True, kw_only=True)
class Field:
    """A field of regard on pixels of one size.

    Attributes
    ----------
    width, height : float
        Its sides, in azimuth and in elevation [rad].
    ifov : float
        Side of a pixel [rad].
    """

    width: float
    height: float
    ifov: float

    def __post_init__(self) -> None:
        for name in ("width", "height", "ifov"):
            require(name, getattr(self, name), positive=True, maximum=math.pi)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of pixels that cover it."""
        rows, columns = (math.ceil(side / self.ifov) for side in (self.height, self.width))
        return rows, columns

    @property
    def box(self) -> Box:
        """All its pixels."""
        rows, columns = self.shape
        return Box(0, 0, columns, rows)

    def pixel(self, bearing: float, elevation: float) -> tuple[int, int]:
        """Column and row of the pixel corner nearest to a direction from the field's middle [rad].

        A target's origin lies on a corner: its IFOVs are those of `ncti.ladar.RangeExtent`.
        """
        rows, columns = self.shape
        return round(bearing / self.ifov + columns / 2), round(elevation / self.ifov + rows / 2)


@dataclass(frozen=True, kw_only=True)
class Detection:
    """Pixels above the threshold that one ship could have.

    Attributes
    ----------
    box : Box
        Their bounding box.
    pixel : (pixel, 2) int64 ndarray
        Column and row of each.
    """

    box: Box
    pixel: Pixels


def elevation(slant_range: float, *, middle_range: float, depression: float) -> float:
    """Return where a target on a flat sea lies above the middle of the field.

    Parameters
    ----------
    slant_range : float
        Sensor to target [m].
    middle_range : float
        Sensor to the sea in the middle of the field [m].
    depression : float
        Depression of the line of sight to the middle [rad], above 0 and below pi / 2.

    Returns
    -------
    float
        Elevation of the target less that of the middle [rad]: above 0 behind it.

    Raises
    ------
    ValueError
        If a parameter is out of range, or the target nearer than the sea below the sensor.

    Notes
    -----
    The sensor is as high above either: slant_range sin(d) = middle_range sin(depression).
    """
    require("slant_range", slant_range, positive=True)
    require("middle_range", middle_range, positive=True)
    require("depression", depression, positive=True, below=math.pi / 2)
    sine = middle_range * math.sin(depression) / slant_range
    if sine > 1:
        raise ValueError(
            f"slant_range is {slant_range:g} m, but must be at least the sensor's height, "
            f"{middle_range * math.sin(depression):g} m"
        )
    return depression - math.asin(sine)


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
    """Return a thermal image of warm targets on the sea.

    Parameters
    ----------
    field : Field
        The field of regard.
    targets : sequence of (pixel, 2) int64 ndarray
        Column and row of the pixels that show each target; those outside the field are not seen.
    contrasts : sequence of float
        Mean temperature of each against the mean sea [K]. Of two in one pixel the later counts.
    frame_count : int
        Frames averaged.
    rng : numpy.random.Generator
        Source of randomness, as for `ncti.infrared.thermal_images`.
    nedt, target_spread, sea_spread : float
        As for `ncti.infrared.thermal_images` [K].

    Returns
    -------
    (row, column) float64 ndarray
        Temperature against the mean sea [K]; row 0 is the lowest.

    Raises
    ------
    ValueError
        If a parameter is out of range, or there are not as many contrasts as targets.
    """
    signal, shown = np.zeros(field.shape), np.zeros(field.shape, dtype=bool)
    for pixel, contrast in zip(targets, contrasts, strict=True):
        require("contrasts", contrast)
        column, row = pixel[field.box.holds(pixel)].T
        signal[row, column], shown[row, column] = contrast, True
    [image] = thermal_images(
        shown,
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
    """Return detections: pixels above a threshold, those together that one ship could have.

    Parameters
    ----------
    image : (row, column) float64 ndarray
        Temperature against the mean sea [K].
    threshold : float
        That of `ncti.infrared.detection_threshold` [K].
    reach : (int, int)
        How many columns and rows two pixels of one ship differ by at most.

    Returns
    -------
    tuple of Detection
        By their left side. Every pixel above the threshold is in exactly one of them.

    Raises
    ------
    ValueError
        If the reach is negative, or the threshold no number.

    Notes
    -----
    Single linkage: pixels within reach of one another belong together, and so do those that
    others join. One ship never makes two detections; false alarms in its reach become part of its
    detection, and widen it.
    """
    require("threshold", threshold)
    for steps in reach:
        require("reach", steps, minimum=0, whole=True)
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
    found = [Detection(box=_box(pixel), pixel=pixel) for pixel in parts]
    return tuple(sorted(found, key=lambda one: one.box))


def _box(pixel: Pixels) -> Box:
    left, bottom = pixel.min(axis=0).tolist()
    right, top = (pixel.max(axis=0) + 1).tolist()
    return Box(left, bottom, right, top)


def cue(box: Box, *, reach: tuple[int, int], detector: int) -> Box:
    """Return what a visit covers: wherever a ship with all of some pixels could reach.

    Parameters
    ----------
    box : Box
        Bounding box of the pixels detected.
    reach : (int, int)
        As for `detect`.
    detector : int
        Elements along either side of the detector, whose places the result is made of.

    Returns
    -------
    Box
        A whole number of places of the detector. It holds the whole ship, if the pixels are those
        of one: 2 reach + 1 columns for a single pixel, reach + 1 for a ship seen from end to end.

    Raises
    ------
    ValueError
        If the detector has no element.
    """
    require("detector", detector, minimum=1, whole=True)
    first, last = [], []
    for low, high, steps in zip(box[:2], box[2:], reach, strict=True):
        begin = min(low, high - 1 - steps)
        size = max(high, low + 1 + steps) - begin
        first.append(begin)
        last.append(begin + -(-size // detector) * detector)
    return Box(*first, *last)

"""Field of regard: places of targets, thermal image, and detection."""

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
    """Rectangle of pixels: the first column and row, and one past the last.

    See Also
    --------
    Field.box, Detection, cue

    Examples
    --------
    >>> from studies.scan import Box
    >>> Box(left=2, bottom=0, right=5, top=1).size
    (3, 1)
    """

    left: int
    bottom: int
    right: int
    top: int

    @property
    def size(self) -> tuple[int, int]:
        """Number of columns and rows."""
        return self.right - self.left, self.top - self.bottom

    def less(self, column: int, row: int) -> Box:
        """Return the same pixels, counted from another pixel."""
        return Box(self.left - column, self.bottom - row, self.right - column, self.top - row)

    def holds(self, cells: Pixels) -> NDArray[np.bool_]:
        """Return (cell,) bool: True for those of (cell, 2) columns and rows that are inside."""
        return np.all((cells >= self[:2]) & (cells < self[2:]), axis=-1)


MOST_PIXELS = 1e8
"""Pixels of a field: an image of them takes 0.8 GB."""


@dataclass(frozen=True, kw_only=True)
class Field:
    """Field of regard, divided into square pixels.

    Attributes
    ----------
    width, height : float
        Sides of the field, in azimuth and in elevation [rad].
    ifov : float
        Side of a pixel [rad].

    See Also
    --------
    thermal_field : Image of a field.
    elevation : Place of a target in it.

    Examples
    --------
    >>> from studies.scan import Field
    >>> field = Field(width=0.03, height=0.015, ifov=150e-6)
    >>> field.shape
    (100, 200)
    >>> field.pixel(0.0, 0.0)  # its middle
    (100, 50)
    """

    width: float
    height: float
    ifov: float

    def __post_init__(self) -> None:
        for name in ("width", "height", "ifov"):
            require(name, getattr(self, name), positive=True, maximum=math.pi)
        least = math.sqrt(self.width * self.height / MOST_PIXELS)
        if self.ifov < least:
            raise ValueError(
                f"ifov is {self.ifov!r} rad, but must be at least {least:.3g} rad, of which a "
                f"field of {self.width:g} by {self.height:g} rad has {MOST_PIXELS:g} pixels"
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
    """Pixels above the threshold that may belong to one ship.

    Attributes
    ----------
    box : Box
        Bounding box of the pixels.
    pixel : (pixel, 2) int64 ndarray
        Column and row of each pixel.

    See Also
    --------
    detect : Returns detections.
    cue : Pixels for the laser radar to visit.

    Examples
    --------
    >>> import numpy as np
    >>> from studies.scan import detect
    >>> [found] = detect(np.eye(3), threshold=0.5, reach=(1, 1))
    >>> found.box, len(found.pixel)
    (Box(left=0, bottom=0, right=3, top=3), 3)
    """

    box: Box
    pixel: Pixels


def elevation(slant_range: float, *, middle_range: float, depression: float) -> float:
    """Return the elevation of a target on a flat sea from the middle of the field.

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
        Elevation of the target less that of the middle [rad], positive behind it.

    Raises
    ------
    ValueError
        If a parameter is out of range, or the target nearer than the sea below the sensor.

    See Also
    --------
    Field.pixel : Pixel of a bearing and an elevation.

    Notes
    -----
    The height of the sensor is the same for both: slant_range sin(d) = middle_range
    sin(depression).

    Examples
    --------
    >>> from math import radians
    >>> from studies.scan import elevation
    >>> 1e3 * elevation(101e3, middle_range=100e3, depression=radians(3.84))  # [mrad]
    0.664
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
        Column and row of the pixels that show each target; pixels outside the field are ignored.
    contrasts : sequence of float
        Mean temperature of each against the mean sea [K]. In a shared pixel the later one counts.
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

    See Also
    --------
    detect : Finds ships in the image.
    ncti.infrared.thermal_images : Image of one ship.

    Examples
    --------
    >>> import numpy as np
    >>> from studies.scan import Field, thermal_field
    >>> field = Field(width=0.00295, height=0.00145, ifov=150e-6)
    >>> ship = np.array([[4, 5], [5, 5]])
    >>> calm = {"nedt": 0.0, "target_spread": 0.0, "sea_spread": 0.0}
    >>> rng = np.random.default_rng(0)
    >>> image = thermal_field(field, [ship], [0.7], frame_count=16, rng=rng, **calm)
    >>> image.shape, image[5, 3:7]
    ((10, 20), array([0. , 0.7, 0.7, 0. ]))
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
    """Return detections: pixels above a threshold, grouped by the reach of a ship.

    Parameters
    ----------
    image : (row, column) float64 ndarray
        Temperature against the mean sea [K].
    threshold : float
        Threshold, as of `ncti.infrared.detection_threshold` [K].
    reach : (int, int)
        Largest difference of columns, and of rows, between two pixels of one ship.

    Returns
    -------
    tuple of Detection
        Sorted by left side. Every pixel above the threshold belongs to exactly one.

    Raises
    ------
    ValueError
        If the reach is negative, or the threshold is not a number.

    See Also
    --------
    cue : Pixels for the laser radar to visit.
    ncti.infrared.detection_threshold : Threshold of a false-alarm probability.

    Notes
    -----
    Single linkage: pixels within reach of one another are grouped, and groups that share a pixel
    are merged. One ship never makes two detections. False alarms within its reach join its
    detection and widen it.

    Examples
    --------
    >>> import numpy as np
    >>> from studies.scan import detect
    >>> image = np.zeros((5, 30))
    >>> image[2, [3, 5, 20]] = 1.0
    >>> [found.box.left for found in detect(image, threshold=0.5, reach=(4, 2))]
    [3, 20]
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
    detections = [Detection(box=_box(pixel), pixel=pixel) for pixel in parts]
    return tuple(sorted(detections, key=lambda detection: detection.box))


def _box(pixel: Pixels) -> Box:
    left, bottom = pixel.min(axis=0).tolist()
    right, top = (pixel.max(axis=0) + 1).tolist()
    return Box(left, bottom, right, top)


def cue(box: Box, *, reach: tuple[int, int], detector: int) -> Box:
    """Return the pixels of a visit: all that a ship with the detected pixels could reach.

    Parameters
    ----------
    box : Box
        Bounding box of the pixels detected.
    reach : (int, int)
        As for `detect`.
    detector : int
        Elements along either side of the detector.

    Returns
    -------
    Box
        A whole number of positions of the detector. It holds the whole ship, if the pixels are
        those of one: 2 reach + 1 columns for a single pixel, reach + 1 for a ship that is detected
        from end to end.

    Raises
    ------
    ValueError
        If the detector has no element.

    See Also
    --------
    detect : Boxes of detected pixels.
    position_count : Positions of the detector in such a box.

    Examples
    --------
    One pixel of a ship that reaches over six columns and two rows:

    >>> from studies.scan import Box, cue
    >>> cue(Box(10, 4, 11, 5), reach=(6, 2), detector=2)
    Box(left=4, bottom=2, right=18, top=8)
    """
    require("detector", detector, minimum=1, whole=True)
    first, last = [], []
    for low, high, steps in zip(box[:2], box[2:], reach, strict=True):
        begin = min(low, high - 1 - steps)
        size = max(high, low + 1 + steps) - begin
        first.append(begin)
        last.append(begin + -(-size // detector) * detector)
    return Box(*first, *last)

"""The correction chain: a raw scan becomes a snapshot, segmented, and its range profile."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from ncti.checks import require
from ncti.irar.clusters import histogram_cluster_average
from ncti.irar.flight import Flight
from ncti.irar.looks import average, gather_looks, looks_of, median
from ncti.irar.mirror import MIRROR_FORMS, mirror_rotation
from ncti.irar.profiling import RANGE_BIN, range_profile
from ncti.irar.receiver import noiseless
from ncti.irar.registration import (
    MOTION_METHODS,
    mirror_displacement,
    motion_displacement,
    raw_places,
    rotated,
)
from ncti.irar.scan import Scan
from ncti.irar.scene import RAYS, Returns
from ncti.irar.segmentation import noise_threshold, segment
from ncti.irar.time_delay import time_delay_integrate
from ncti.render import cast_rays

Floats = NDArray[np.float64]

RANGE_FILTERS = ("cluster", "median", "mean")
MIRROR_METHODS = (*MIRROR_FORMS, "rotation", "none")
FALSE_ALARM = 1e-3
"""Probability that a pixel of the sea passes the threshold."""

STANDS_OUT = 3.0
"""Intensity of samples that are of the ship, over the median one, which is of the sea."""


@dataclass(frozen=True, kw_only=True)
class Correction:
    """How a scan is corrected.

    Attributes
    ----------
    azimuth, height, motion : str
        How columns, rows and ranges follow the motion: `pixel`, `line` or `constant`, as of
        `motion_displacement`; for `azimuth` and `motion` also `none`.
    mirror : str
        `exact` or `printed` shear, `rotation` of the whole image, or `none`.
    range_filter : str
        What makes one range of a pixel's looks: `cluster`, `median` or `mean`.
    window : float
        Width of a cluster, over the standard deviation of a range.
    threshold : float or None
        Least averaged intensity of the ship, in noise powers; None: what one pixel of the sea in
        1,000 exceeds.
    """

    azimuth: str = "pixel"
    height: str = "pixel"
    motion: str = "pixel"
    mirror: str = "exact"
    range_filter: str = "cluster"
    window: float = 4.0
    threshold: float | None = None

    def __post_init__(self) -> None:
        """Refuse what there is not."""
        choices = {
            "azimuth": (*MOTION_METHODS, "none"),
            "height": MOTION_METHODS,
            "motion": (*MOTION_METHODS, "none"),
            "mirror": MIRROR_METHODS,
            "range_filter": RANGE_FILTERS,
        }
        for name, allowed in choices.items():
            if getattr(self, name) not in allowed:
                raise ValueError(
                    f"{name} is {getattr(self, name)!r}, but must be one of {', '.join(allowed)}"
                )
        require("window", self.window, positive=True)
        if self.threshold is not None:
            require("threshold", self.threshold, minimum=0)


@dataclass(frozen=True)
class Window:
    """Pixels of a corrected image.

    Attributes
    ----------
    bottom, left : int
        Row and column of its first pixel, from the line of sight to the ship's origin.
    rows, columns : int
        How many there are.
    """

    bottom: int
    left: int
    rows: int
    columns: int


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A corrected image: the ship as from the aircraft at one moment.

    Attributes
    ----------
    window : Window
        Its pixels, square, of one IFOV.
    row, column : (row,) and (column,) float64 ndarray
        Centres of its rows and columns [pixel]; rows are closer than a pixel where it is still
        overscanned.
    intensity : (row, column) float64 ndarray
        Mean of the looks, in noise powers; NaN where there is no look.
    range : (row, column) float64 ndarray
        [m]; NaN where there is no range.
    infrared : (row, column) float64 ndarray
        Apparent temperature over the sea's [K]; NaN where there is no look.
    looks : (row, column) intp ndarray
        Samples averaged.
    """

    window: Window
    row: Floats
    column: Floats
    intensity: Floats
    range: Floats
    infrared: Floats
    looks: NDArray[np.intp]


def nearest_ship_range(scan: Scan) -> Floats:
    """Range of the ship's sample nearest to each sample.

    Parameters
    ----------
    scan : Scan
        Raw images.

    Returns
    -------
    (line, sample) float64 ndarray
        [m]; the measured ranges where nothing stands out of the sea.

    Notes
    -----
    By how much a sample moves depends on its range a little, by up to half a pixel over a ship's
    depth. A sample of the sea beside the ship has a range that noise chose: it must move as the
    ship's edge does, or it eats into it.
    """
    there = scan.intensity > STANDS_OUT * np.median(scan.intensity)
    if not there.any():
        return scan.range
    nearest = distance_transform_edt(~there, return_distances=False, return_indices=True)
    found: Floats = scan.range[tuple(nearest)]
    return found


def places(
    scan: Scan, correction: Correction, *, belief: Flight | None = None
) -> tuple[Floats, Floats, Floats]:
    """Row, column and range of every sample after the geometric corrections.

    Parameters
    ----------
    scan : Scan
        Raw images.
    correction : Correction
        How they are corrected.
    belief : Flight, optional
        The flight as navigation has it; as it was, when not given.

    Returns
    -------
    row, column : (line, sample) float64 ndarray
        [pixel].
    range : (line, sample) float64 ndarray
        [m].
    """
    flight = scan.flight if belief is None else belief
    samples, time = np.arange(flight.samples), scan.time
    row, column = raw_places(flight, samples)
    if correction.mirror in MIRROR_FORMS:
        up, right = mirror_displacement(flight, samples, form=correction.mirror)
        row, column = row + up, column + right
    # A method that two directions share is worked out once.
    wanted = {correction.azimuth, correction.height, correction.motion} - {"none"}
    reach = nearest_ship_range(scan)
    moved = {method: motion_displacement(flight, time, reach, method=method) for method in wanted}
    row = row + moved[correction.height][0]
    column = column + (moved[correction.azimuth][1] if correction.azimuth != "none" else 0.0)
    column = np.broadcast_to(column, row.shape)
    ranges = scan.range
    if correction.motion != "none":
        ranges = ranges + moved[correction.motion][2]
    if correction.mirror == "rotation":
        lean = mirror_rotation(flight.depression, mirror_angle=flight.mirror_angle)
        row, column = rotated(row, column, clockwise=-lean)
    return row, column, ranges


def window_of(row: Floats, column: Floats) -> Window:
    """The pixels that samples at some places fill."""
    bottom, left = math.floor(row.min() + 0.5), math.floor(column.min() + 0.5)
    top, right = math.floor(row.max() + 0.5), math.floor(column.max() + 0.5)
    return Window(bottom, left, top - bottom + 1, right - left + 1)


def correct(
    scan: Scan,
    correction: Correction | None = None,
    *,
    belief: Flight | None = None,
    window: Window | None = None,
    overscanned: bool = False,
) -> Snapshot:
    """The whole chain up to the averaged, filtered images.

    Parameters
    ----------
    scan : Scan
        Raw images.
    correction : Correction, optional
        How they are corrected; as physics has it when not given.
    belief : Flight, optional
        The flight as navigation has it; as it was, when not given.
    window : Window, optional
        Pixels of the result; all that samples fill when not given.
    overscanned : bool
        Whether rows stay as close as lines, each averaged over a pixel's height, as range
        profiling wants them; they are a pixel apart otherwise.

    Returns
    -------
    Snapshot

    Notes
    -----
    Article, 'Data Processing'. Its order is average, correct ranges, segment, then shift and
    rotate. Here samples are put in their place before any of them is averaged: a shift within a
    pixel's looks would otherwise blur mast and range alike.
    """
    how = Correction() if correction is None else correction
    flight = scan.flight if belief is None else belief
    row, column, ranges = places(scan, how, belief=belief)
    if window is None:
        window = window_of(row, column)
    step = 1 / max(1, round(flight.lines_per_pixel)) if overscanned else 1.0
    rows = np.asarray(window.bottom + np.arange(round(window.rows / step)) * step, dtype=np.float64)
    index = gather_looks(row, column - window.left, rows=rows, columns=window.columns)
    if how.range_filter == "cluster":
        width = how.window * max(flight.range_sigma, 1e-3)
        found = histogram_cluster_average(looks_of(ranges, index), window=width)
    else:
        found = (median if how.range_filter == "median" else average)(ranges, index)
    infrared = time_delay_integrate(scan.infrared)
    return Snapshot(
        window,
        rows,
        window.left + np.arange(window.columns, dtype=np.float64),
        average(scan.intensity, index),
        found,
        average(infrared, index),
        np.count_nonzero(index >= 0, axis=-1),
    )


def segmented(snapshot: Snapshot, flight: Flight, *, threshold: float | None = None) -> Snapshot:
    """A corrected image with the sea set to nothing.

    Parameters
    ----------
    snapshot : Snapshot
        Corrected.
    flight : Flight
        For the noise of the sea.
    threshold : float, optional
        Least intensity of the ship, in noise powers; when not given, what one pixel of the sea in
        1,000 exceeds.

    Returns
    -------
    Snapshot
        Intensity 0 and range NaN where there is no ship; infrared as it was.
    """
    if threshold is None:
        looks = max(1, round(float(np.median(snapshot.looks[snapshot.looks > 0]))))
        # At the level that a gate's peak has, Rice's crossings are those of so many cells.
        cells = 2.5 * max(flight.range_gate / flight.pulse_length, 1.0)
        threshold = noise_threshold(cells=cells, looks=looks, false_alarm=FALSE_ALARM)
    intensity, ranges = segment(snapshot.intensity, snapshot.range, threshold=threshold)
    return replace(snapshot, intensity=intensity, range=ranges)


def ship_window(mesh: trimesh.Trimesh, flight: Flight, *, margin: int = 3) -> Window:
    """The pixels that a ship fills in the snapshot.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        The ship, in its frame.
    flight : Flight
        The pass.
    margin : int
        Pixels of sea around it.

    Returns
    -------
    Window
    """
    right, up, away = flight.snapshot_axes @ np.asarray(mesh.vertices, dtype=np.float64).T
    scale = flight.ifov * (flight.slant_range + away)
    ends = window_of(up / scale, right / scale)
    return Window(
        ends.bottom - margin, ends.left - margin, ends.rows + 2 * margin, ends.columns + 2 * margin
    )


def true_snapshot(
    mesh: trimesh.Trimesh,
    flight: Flight,
    window: Window,
    *,
    reflectivity: Floats | None = None,
    lambertian: bool = False,
    cells: int = 1,
    resolved: bool = False,
) -> Snapshot:
    """What a correction should give: the noiseless view from the snapshot's place itself.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        The ship, in its frame.
    flight : Flight
        The pass.
    window : Window
        Pixels of the result.
    reflectivity, lambertian
        As for `scan_scene`.
    cells : int
        Looks along each side of a pixel, evenly spread over it.
    resolved : bool
        Whether each of them sees its own cell only, by one ray; they see an IFOV otherwise, as
        the sensor does.

    Returns
    -------
    Snapshot
        Of `cells` times the window's rows and columns; infrared is the share of ship.
    """
    require("cells", cells, whole=True, minimum=1, maximum=64)
    row, column = (
        start - 0.5 + (np.arange(count * cells) + 0.5) / cells
        for start, count in ((window.bottom, window.rows), (window.left, window.columns))
    )
    rays = 1 if resolved else RAYS
    part = (np.arange(rays) - (rays - 1) / 2) / rays
    up, right = np.broadcast_arrays(
        row[:, None, None, None] + part[:, None], column[:, None, None] + part
    )
    image = np.stack([right * flight.ifov, up * flight.ifov, np.ones_like(up)], axis=-1)
    image /= np.linalg.norm(image, axis=-1, keepdims=True)
    ways = (image @ flight.snapshot_axes).reshape(-1, 3)
    start = np.broadcast_to(flight.position(np.zeros(())), ways.shape)
    hits = cast_rays(mesh, start, ways)
    power = np.ones(len(hits.ray)) if reflectivity is None else reflectivity[hits.facet]
    power = power * hits.cosine if lambertian else power
    place, ray = np.divmod(hits.ray, rays**2)
    shape = len(row), len(column)
    returns = Returns(shape, place, ray, hits.distance, power / rays**2, rays**2)
    intensity, ranges = noiseless(returns, flight=flight)
    looks = np.ones(shape, dtype=np.intp)
    return Snapshot(
        window,
        row,
        column,
        intensity.astype(np.float64),
        ranges,
        returns.coverage(),
        looks,
    )


def profile(
    snapshot: Snapshot, flight: Flight, *, bins: int = 250, bin_width: float = RANGE_BIN
) -> Floats:
    """Range profile of a segmented snapshot, centred on the ship's origin.

    Parameters
    ----------
    snapshot : Snapshot
        Segmented.
    flight : Flight
        For the range of the ship's origin.
    bins : int
        Number of bins.
    bin_width : float
        Their width [m].

    Returns
    -------
    (bin,) float64 ndarray
        Summed intensity of whole pixels, in noise powers: where rows or columns are closer than
        a pixel, each counts by its share of one. Bin n is centred on
        (n - (bins - 1) / 2) bin_width.

    Notes
    -----
    Article, 'Range Profiling'.
    """
    share = math.prod(
        float(place[1] - place[0]) for place in (snapshot.row, snapshot.column) if len(place) > 1
    )
    summed = range_profile(
        np.nan_to_num(snapshot.intensity),
        snapshot.range - flight.slant_range,
        start=-bins * bin_width / 2,
        bins=bins,
        bin_width=bin_width,
    )
    return summed * share

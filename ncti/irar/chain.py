"""The correction chain: from a raw scan to a segmented snapshot and its range profile."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require, require_all, require_word
from ncti.irar.flight import Flight
from ncti.irar.looks import (
    average,
    cluster_width,
    gather_looks,
    histogram_cluster_average,
    looks_of,
    median,
)
from ncti.irar.mirror import MIRROR_FORMS, mirror_rotation
from ncti.irar.receiver import noise_peak
from ncti.irar.registration import (
    MOTION_METHODS,
    mirror_displacement,
    motion_displacement,
    raw_places,
    rotate,
)
from ncti.irar.scan import Scan
from ncti.irar.segmentation import noise_threshold
from ncti.irar.snapshot import Snapshot, Window, centres, window_of
from ncti.irar.time_delay import time_delay_integrate

Floats = NDArray[np.float64]

RANGE_FILTERS = ("cluster", "median", "mean")
MIRROR_METHODS = (*MIRROR_FORMS, "rotation", "none")
RANGE_BIN = 1.0  # m; the down-range resolution of the sensor
FALSE_ALARM = 1e-3
"""Probability that a pixel of the sea passes the threshold."""

SHIP_CONTRAST = 3.0
"""Intensity above which a sample counts as ship, over the median of the sea's samples."""


@dataclass(frozen=True, kw_only=True)
class Correction:
    """Methods by which a scan is corrected.

    Attributes
    ----------
    azimuth : str
        Motion correction of columns: `pixel`, `line` or `constant`, as for `motion_displacement`,
        or `none`. Rows and ranges are always corrected pixel by pixel.
    mirror : str
        Correction of the mirror's effect: `exact` or `printed` shear, `rotation` of the whole
        image, or `none`.
    range_filter : str
        Filter that combines the ranges of a pixel's looks: `cluster`, `median` or `mean`.

    Raises
    ------
    ValueError
        If a method is unknown.

    See Also
    --------
    correct : Apply these methods.
    correct_as_printed : The printed order and equations.

    Examples
    --------
    >>> Correction(mirror="none")
    Correction(azimuth='pixel', mirror='none', range_filter='cluster')
    """

    azimuth: str = "pixel"
    mirror: str = "exact"
    range_filter: str = "cluster"

    def __post_init__(self) -> None:
        """Raise for an unknown method."""
        require_word("azimuth", self.azimuth, (*MOTION_METHODS, "none"))
        require_word("mirror", self.mirror, MIRROR_METHODS)
        require_word("range_filter", self.range_filter, RANGE_FILTERS)


def nearest_ship_range(scan: Scan) -> Floats:
    """Return the range (line, sample) [m] of the ship sample nearest to each sample.

    The displacement of a sample depends on its range, by up to half a pixel over a ship's depth.
    The range of a sample of sea beside the ship is noise: the sample must move with the ship's
    edge, or it would cover part of it. Measured ranges remain if nothing is brighter than the sea.
    """
    ship = scan.intensity > SHIP_CONTRAST * _sea_median(scan)
    if not ship.any():
        return scan.range
    from scipy.ndimage import distance_transform_edt

    nearest = distance_transform_edt(~ship, return_distances=False, return_indices=True)
    return scan.range[tuple(nearest)]


def _sea_median(scan: Scan) -> float:
    """Return the median intensity of samples of the sea, which are most of a scan.

    If the receiver's threshold drops more than half of them, return the median of noise peaks.
    """
    median = float(np.median(scan.intensity))
    flight, reported = scan.flight, scan.intensity[scan.intensity > 0]
    # A scan without noise has weaker returns than the threshold.
    if median or not reported.size or reported.min() < flight.threshold:
        return median
    gate, length = flight.range_gate, flight.pulse_length
    return float(noise_peak(np.array(0.5), depth=gate, pulse_length=length))


def places(scan: Scan, correction: Correction, flight: Flight) -> tuple[Floats, Floats, Floats]:
    """Return row, column [pixel] and range [m] of every sample in the snapshot, (line, sample).

    `flight` is as navigation measures it, or the true one.
    """
    # Mirror: the shear of the lines.
    samples, time = np.arange(flight.samples), scan.time
    row, column = raw_places(flight, samples)
    if correction.mirror in MIRROR_FORMS:
        up, right = mirror_displacement(flight, samples, form=correction.mirror)
        row, column = row + up, column + right
    # Motion: rows and ranges by each pixel's own range and direction, columns by the given method.
    reach = nearest_ship_range(scan)
    up, right, closer = motion_displacement(flight, time, reach)
    row, ranges = row + up, scan.range + closer
    if correction.azimuth not in ("pixel", "none"):
        _, right, _ = motion_displacement(flight, time, reach, method=correction.azimuth)
    column = column + (right if correction.azimuth != "none" else 0.0)
    column = np.broadcast_to(column, row.shape)
    if correction.mirror == "rotation":
        lean = mirror_rotation(flight.depression, mirror_angle=flight.mirror_angle)
        row, column = rotate(row, column, clockwise=-lean)
    return row, column, ranges


def correct(
    scan: Scan,
    correction: Correction | None = None,
    *,
    estimate: Flight | None = None,
    window: Window | None = None,
    overscanned: bool = False,
) -> Snapshot:
    """Correct a scan for motion and mirror, average its looks and filter its ranges.

    Parameters
    ----------
    scan : Scan
        Raw images.
    correction : Correction, optional
        Methods; the exact ones when not given.
    estimate : Flight, optional
        The flight as navigation measures it; the true one when not given.
    window : Window, optional
        Pixels of the result; all that contain samples when not given.
    overscanned : bool
        Keep rows as close as lines, each averaged over a pixel's height, as range profiling needs
        them. Otherwise rows are a pixel apart.

    Returns
    -------
    Snapshot
        Corrected image, not yet segmented.

    See Also
    --------
    segmented : Remove the sea from the result.
    correct_as_printed : The article's own order and equations.
    autofocus : Find the closing speed in the scan.

    Notes
    -----
    The article averages, corrects ranges, segments, and then shifts and rotates [1]_. Here samples
    are put in their place before any are averaged, because a shift within the looks of a pixel
    would otherwise blur both mast and range.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, 'Data Processing'.

    Examples
    --------
    A box 40 m long and 14 m high, seen from astern at 4 km:

    >>> import numpy as np
    >>> import trimesh
    >>> from ncti.irar import fly, ship_heading, ship_window
    >>> box = trimesh.creation.box((40, 10, 14)).apply_translation((0, 0, 7))
    >>> heading = ship_heading(aspect=180, sight=5)
    >>> flight = Flight(slant_range=4e3, ship_heading=heading, samples=60)
    >>> scan = fly(box, flight).record(np.random.default_rng(0))
    >>> image = correct(scan, window=ship_window(box, flight))
    >>> scan.intensity.shape, image.intensity.shape
    ((345, 60), (30, 19))
    """
    methods = Correction() if correction is None else correction
    flight = scan.flight if estimate is None else estimate
    row, column, ranges = places(scan, methods, flight)
    if window is None:
        window = window_of(row, column)
    # Looks of each pixel: overscanned rows overlap.
    cells = max(1, round(flight.lines_per_pixel)) if overscanned else 1
    rows = centres(window.bottom, window.rows, cells)
    index = gather_looks(row, column - window.left, rows=rows, columns=window.columns)
    # One range from the looks of a pixel, some of them false.
    if methods.range_filter == "cluster":
        combined = histogram_cluster_average(looks_of(ranges, index), window=cluster_width(flight))
    else:
        combined = (median if methods.range_filter == "median" else average)(ranges, index)
    infrared = time_delay_integrate(scan.infrared)
    return Snapshot(
        window,
        rows,
        centres(window.left, window.columns, 1),
        average(scan.intensity, index),
        combined,
        average(infrared, index),
        np.count_nonzero(index >= 0, axis=-1),
    )


def sea_level(looks: NDArray[np.intp], flight: Flight) -> Floats:
    """Return the intensity (...) that one averaged pixel of the sea in 1,000 reaches.

    It is in noise powers. `looks` (...) counts averaged samples, including dropouts; 0 gives 0. The
    sea returns nothing, so its samples are the receiver's noise, independent from pulse to pulse at
    any line rate. Overscanned rows share looks: neighbours exceed the level together, but each at
    the same rate.
    """
    levels, valid = np.zeros(looks.shape), looks > 0
    levels[valid] = noise_threshold(
        looks[valid],
        depth=flight.range_gate,
        pulse_length=flight.pulse_length,
        dropout=flight.threshold,
        false_alarm=FALSE_ALARM,
    )
    return levels


def segmented(snapshot: Snapshot, flight: Flight, *, threshold: float | None = None) -> Snapshot:
    """Return a corrected image with the sea removed.

    Parameters
    ----------
    snapshot : Snapshot
        Corrected image.
    flight : Flight
        Flight whose noise the sea has.
    threshold : float, optional
        Least intensity of the ship, in noise powers; when not given, the level that one pixel of
        the sea in 1,000 reaches.

    Returns
    -------
    Snapshot
        Intensity 0 and range NaN where there is no ship; the infrared image is unchanged.

    Raises
    ------
    ValueError
        If the threshold is negative or not finite.

    See Also
    --------
    correct : Make the corrected image.
    profile : Range profile of the result.

    Examples
    --------
    A box with a projected area of 185 m^2; partly filled pixels at its outline count as whole ones:

    >>> import numpy as np
    >>> import trimesh
    >>> from ncti.irar import fly, ship_heading, ship_window
    >>> box = trimesh.creation.box((40, 10, 14)).apply_translation((0, 0, 7))
    >>> heading = ship_heading(aspect=180, sight=5)
    >>> flight = Flight(slant_range=4e3, ship_heading=heading, samples=60)
    >>> scan = fly(box, flight).record(np.random.default_rng(1))
    >>> image = segmented(correct(scan, window=ship_window(box, flight)), flight)
    >>> print(f"{np.count_nonzero(image.intensity) * flight.pixel**2:.0f} m^2")
    212 m^2
    """
    level = sea_level(snapshot.looks, flight) if threshold is None else threshold
    ship = snapshot.intensity >= require_all("threshold", level, minimum=0.0)
    # A range of zero is valid, at the ship's origin, so NaN marks no range.
    intensity = np.where(ship, snapshot.intensity, 0.0)
    return replace(snapshot, intensity=intensity, range=np.where(ship, snapshot.range, math.nan))


def profile(
    snapshot: Snapshot, flight: Flight, *, bins: int = 250, bin_width: float = RANGE_BIN
) -> Floats:
    """Return the range profile of a segmented snapshot, centred on the ship's origin.

    Parameters
    ----------
    snapshot : Snapshot
        Segmented image.
    flight : Flight
        Flight, for the range of the ship's origin.
    bins : int
        Number of bins.
    bin_width : float
        Width of a bin [m].

    Returns
    -------
    (bin,) float64 ndarray
        Intensity summed over whole pixels, in noise powers: rows or columns closer than a pixel
        count by their share of one. Bin n is centred on (n - (bins - 1) / 2) bin_width.

    Raises
    ------
    ValueError
        If the number of bins or their width is out of range.

    See Also
    --------
    segmented : Make the segmented snapshot.
    landmarks : Measure a profile's landmarks.
    measured_extent : The snapshot as the range-profiling sensor would see it.

    Notes
    -----
    The intensities of all pixels are added by range [1]_. A pixel counts as a point: if bins are
    narrower than the range that a pixel spans on a grazing deck, the deck appears as a comb (Figure
    16 of the article).

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, 'Range Profiling'.

    Examples
    --------
    Seen from astern, a box 40 m long returns most from its stern, which is 21 m nearer than its
    origin:

    >>> import numpy as np
    >>> import trimesh
    >>> from ncti.irar import fly, ship_heading, ship_window
    >>> box = trimesh.creation.box((40, 10, 14)).apply_translation((0, 0, 7))
    >>> heading = ship_heading(aspect=180, sight=5)
    >>> flight = Flight(slant_range=4e3, ship_heading=heading, samples=60)
    >>> scan = fly(box, flight).noiseless()
    >>> image = segmented(correct(scan, window=ship_window(box, flight)), flight)
    >>> int(profile(image, flight, bins=61).argmax()) - 30
    -21
    """
    require("bins", bins, whole=True, minimum=1)
    require("bin_width", bin_width, positive=True)
    share = math.prod(
        float(place[1] - place[0]) for place in (snapshot.row, snapshot.column) if len(place) > 1
    )
    edges = -bins * bin_width / 2 + bin_width * np.arange(int(bins) + 1)
    down_range = (snapshot.range - flight.slant_range).ravel()
    place = np.searchsorted(edges, down_range, side="right") - 1  # NaN sorts beyond the last
    inside = (place >= 0) & (place < bins)
    intensity = np.nan_to_num(snapshot.intensity).ravel()[inside]
    total = np.bincount(place[inside], weights=intensity, minlength=int(bins)).astype(np.float64)
    return total * share

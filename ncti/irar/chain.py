"""The correction chain: a raw scan becomes a snapshot, segmented, and its range profile."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ncti.irar.clusters import cluster_width, histogram_cluster_average
from ncti.irar.flight import Flight
from ncti.irar.looks import average, gather_looks, looks_of, median
from ncti.irar.mirror import MIRROR_FORMS, mirror_rotation
from ncti.irar.profiling import RANGE_BIN, range_profile
from ncti.irar.registration import (
    MOTION_METHODS,
    mirror_displacement,
    motion_displacement,
    raw_places,
    rotated,
)
from ncti.irar.scan import Scan
from ncti.irar.segmentation import noise_threshold, segment
from ncti.irar.snapshot import Snapshot, Window, centres, window_of
from ncti.irar.time_delay import time_delay_integrate

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
    azimuth : str
        How columns follow the motion: `pixel`, `line` or `constant`, as for `motion_displacement`,
        or `none`. Rows and ranges always follow it pixel by pixel.
    mirror : str
        `exact` or `printed` shear, `rotation` of the whole image, or `none`.
    range_filter : str
        What makes one range of a pixel's looks: `cluster`, `median` or `mean`.
    """

    azimuth: str = "pixel"
    mirror: str = "exact"
    range_filter: str = "cluster"

    def __post_init__(self) -> None:
        """Refuse what there is not."""
        choices = {
            "azimuth": (*MOTION_METHODS, "none"),
            "mirror": MIRROR_METHODS,
            "range_filter": RANGE_FILTERS,
        }
        for name, allowed in choices.items():
            if getattr(self, name) not in allowed:
                raise ValueError(
                    f"{name} is {getattr(self, name)!r}, but must be one of {', '.join(allowed)}"
                )


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
    # Imported where it is used: scipy takes a tenth of a second or more.
    from scipy.ndimage import distance_transform_edt

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
    # Motion: rows and ranges by each pixel's own range and direction, columns as asked for.
    reach = nearest_ship_range(scan)
    up, right, closer = motion_displacement(flight, time, reach)
    row, ranges = row + up, scan.range + closer
    if correction.azimuth not in ("pixel", "none"):
        _, right, _ = motion_displacement(flight, time, reach, method=correction.azimuth)
    column = column + (right if correction.azimuth != "none" else 0.0)
    column = np.broadcast_to(column, row.shape)
    if correction.mirror == "rotation":
        lean = mirror_rotation(flight.depression, mirror_angle=flight.mirror_angle)
        row, column = rotated(row, column, clockwise=-lean)
    return row, column, ranges


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
    cells = max(1, round(flight.lines_per_pixel)) if overscanned else 1
    rows = centres(window.bottom, window.rows, cells)
    index = gather_looks(row, column - window.left, rows=rows, columns=window.columns)
    if how.range_filter == "cluster":
        found = histogram_cluster_average(looks_of(ranges, index), window=cluster_width(flight))
    else:
        found = (median if how.range_filter == "median" else average)(ranges, index)
    infrared = time_delay_integrate(scan.infrared)
    return Snapshot(
        window,
        rows,
        centres(window.left, window.columns, 1),
        average(scan.intensity, index),
        found,
        average(infrared, index),
        np.count_nonzero(index >= 0, axis=-1),
    )


def sea_level(looks: NDArray[np.intp], flight: Flight) -> Floats:
    """Intensity that averages of the sea reach in one pixel of 1,000.

    Parameters
    ----------
    looks : (...) intp ndarray
        Samples averaged, dropouts among them.
    flight : Flight
        For the gate, the pulse and what is not reported.

    Returns
    -------
    (...) float64 ndarray
        In noise powers; 0 where there is no look.

    Notes
    -----
    The sea answers with the receiver's noise alone, which is drawn anew for every pulse: looks at
    it are independent, whatever the line rate. Overscanned rows share looks: neighbours pass
    together, each as seldom as any.
    """
    levels, there = np.zeros(looks.shape), looks > 0
    levels[there] = noise_threshold(
        looks[there],
        depth=flight.range_gate,
        pulse_length=flight.pulse_length,
        dropout=flight.threshold,
        false_alarm=FALSE_ALARM,
    )
    return levels


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
        1,000 reaches.

    Returns
    -------
    Snapshot
        Intensity 0 and range NaN where there is no ship; infrared as it was.
    """
    least = sea_level(snapshot.looks, flight) if threshold is None else threshold
    intensity, ranges = segment(snapshot.intensity, snapshot.range, threshold=least)
    return replace(snapshot, intensity=intensity, range=ranges)


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

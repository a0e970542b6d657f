"""The correction chain in the article's own order and with its own equations, for comparison."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require_word
from ncti.irar.flight import Flight
from ncti.irar.looks import average, cluster_width, gather_looks, histogram_cluster_average
from ncti.irar.mirror import mirror_rotation
from ncti.irar.registration import approach_rate, azimuth_shift, rotate
from ncti.irar.scan import Scan
from ncti.irar.snapshot import Snapshot, Window, centres, window_of
from ncti.irar.time_delay import time_delay_integrate

Floats = NDArray[np.float64]

RATES = ("line", "pulse")


def correct_as_printed(
    scan: Scan,
    *,
    estimate: Flight | None = None,
    window: Window | None = None,
    rate: str = "line",
) -> Snapshot:
    """Correct a scan as the article prints it: average, shift rows, then rotate the whole image.

    Parameters
    ----------
    scan : Scan
        Raw images.
    estimate : Flight, optional
        The flight as navigation measures it; the true one when not given.
    window : Window, optional
        Pixels of the result; all that the rotated image fills when not given.
    rate : str
        Meaning of f in the azimuthal shift: `line`, the line rate, or `pulse`, the pulse-repetition
        frequency, as the article calls it.

    Returns
    -------
    Snapshot
        Corrected image, not yet segmented.

    Raises
    ------
    ValueError
        If the rate is unknown.

    See Also
    --------
    correct : The exact corrections.
    azimuth_shift : The printed shift.
    mirror_rotation : The printed rotation.

    Notes
    -----
    In the article's order [1]_: N scans are averaged, ranges are corrected from scan to scan by the
    closing speed, each row is shifted by the sum of the shifts up to it, each with the range of its
    row, and the image is rotated by the effect of the mirror. Compared with `correct`, three errors
    remain. Looks that drift apart by up to a pixel before they are averaged blur masts. With f as
    the pulse-repetition frequency, hardly anything is shifted. With one scanned detector the mirror
    causes a shear, so the rotation levels the waterline and tilts the mast.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, 'Data Enhancement and Compensation' and 'Data Processing'.

    Examples
    --------
    The mast of the printed corrections leans, at a depression of 6.7 deg and near the stern:

    >>> import trimesh
    >>> from ncti.irar import fly, ship_heading, ship_window, tilts, true_snapshot
    >>> box = trimesh.creation.box((10, 12, 14)).apply_translation((0, 0, 7))
    >>> heading = ship_heading(aspect=180, sight=5)
    >>> flight = Flight(slant_range=4e3, ship_heading=heading, samples=60)
    >>> window = ship_window(box, flight)
    >>> image = correct_as_printed(fly(box, flight).noiseless(), window=window)
    >>> truth = true_snapshot(box, flight, window, cells=4)
    >>> print(f"{tilts(image.infrared, truth.infrared).mast:.0f} deg")
    6 deg
    """
    require_word("rate", rate, RATES)
    flight = scan.flight if estimate is None else estimate
    # Average N scans at a time, with ranges corrected for the approach.
    scans = max(1, round(flight.lines_per_pixel))
    rows = len(scan.intensity) // scans
    used = slice(0, rows * scans)
    closer = approach_rate(flight) * scan.time[used]
    looks = (scan.range[used] + closer).reshape(rows, scans, -1)
    ranges = histogram_cluster_average(np.moveaxis(looks, 1, -1), window=cluster_width(flight))
    intensity, infrared = (
        np.asarray(image[used], dtype=np.float64).reshape(rows, scans, -1).mean(axis=1)
        for image in (scan.intensity, time_delay_integrate(scan.infrared))
    )
    # Shift and rotate the averaged rows, and resample them to pixels.
    time = scan.time[used].reshape(rows, scans, -1).mean(axis=(1, 2))
    row, column = _places(flight, time, scans, rate)
    if window is None:
        window = window_of(row, column)
    across = centres(window.left, window.columns, 1)
    up = centres(window.bottom, window.rows, 1)
    index = gather_looks(row, column - window.left, rows=up, columns=window.columns)
    return Snapshot(
        window,
        up,
        across,
        average(intensity, index),
        average(ranges, index),
        average(infrared, index),
        scans * np.count_nonzero(index >= 0, axis=-1),
    )


def _places(flight: Flight, time: Floats, scans: int, rate: str) -> tuple[Floats, Floats]:
    """Return rows and columns of averaged pixels after shift and rotation, (row, sample)."""
    frequency = flight.line_rate if rate == "line" else flight.pulse_rate
    ranges = (flight.slant_range - approach_rate(flight) * time).tolist()
    shifts = [azimuth_shift(flight, reach, rate=frequency, scans=scans) for reach in ranges]
    # Sum of the shifts up to each row, zero in the row of the ship's origin.
    total_shift = np.cumsum(shifts)
    total_shift -= np.interp(0.0, time, total_shift)
    pointing = flight.offset if flight.pointing is None else flight.pointing
    turn = (pointing - flight.offset + 180.0) % 360.0 - 180.0
    aside = math.radians(turn) * math.cos(math.radians(flight.depression))
    along = np.arange(flight.samples) - (flight.samples - 1) / 2 + aside / flight.ifov
    row = np.broadcast_to((flight.climb * time / flight.pixel)[:, None], (len(time), len(along)))
    lean = mirror_rotation(flight.depression, mirror_angle=flight.mirror_angle, form="printed")
    return rotate(row, along - total_shift[:, None], clockwise=-lean)

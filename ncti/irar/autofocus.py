"""Estimate the closing speed from a scan, as the speed at which upright faces appear upright."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ncti.checks import NothingSeenError
from ncti.irar.chain import Correction, correct, segmented
from ncti.irar.flight import Flight
from ncti.irar.mirror import compass_directions
from ncti.irar.scan import Scan

Floats = NDArray[np.float64]

SLOPE_HEIGHT = 3.2
"""Height over which slopes are measured [m]: about one deck, so that few pairs span two tiers."""

SMOOTHING = 0.1
"""Width of the kernel that smooths the counts of slopes: their noise, 0.3 m twice over a rise.

A wider kernel mixes upright faces with receding tiers, and finds their mean as a speed.
"""

MAX_ROUNDS = 3
"""Number of iterations. A wrong speed smears the looks of a pixel, less in each round."""

STEP = 0.01
REACH = 0.1
"""Largest error of the closing speed that is searched for, as a fraction of it."""


def slope_spectrum(slopes: Floats, *, steepest: float) -> tuple[Floats, Floats]:
    """Return slopes [m/m] up to `steepest` either way, and the number of pairs of pixels at each.

    `slopes` (pair,) are changes of horizontal distance with height. A Gaussian of standard
    deviation `SMOOTHING` smooths the counts.
    """
    # Counts reach beyond the spectrum, so that its ends are smoothed like its middle.
    centres = np.arange(-math.ceil(steepest / STEP), math.ceil(steepest / STEP) + 1) * STEP
    edges = np.append(centres, centres[-1] + STEP) - STEP / 2
    reach = 4 * SMOOTHING
    wide_edges = np.arange(edges[0] - reach, edges[-1] + reach, STEP)
    counts, _ = np.histogram(slopes, wide_edges)
    middle = (wide_edges[1:] + wide_edges[:-1]) / 2
    kernel = np.exp(-(((centres[:, None] - middle) / SMOOTHING) ** 2) / 2)
    smooth: Floats = kernel @ counts
    return centres.astype(np.float64), smooth


def autofocus(scan: Scan, estimate: Flight) -> Flight:
    """Return the flight with the aircraft speed at which most steep faces are upright.

    Parameters
    ----------
    scan : Scan
        Raw images.
    estimate : Flight
        The flight as navigation measures it, with a closing speed at most 10 % off.

    Returns
    -------
    Flight
        The estimate with a corrected `aircraft_speed`.

    Raises
    ------
    ncti.checks.NothingSeenError
        If nothing in the corrected image is a deck high.

    See Also
    --------
    correct : Correct a scan with the resulting flight.

    Notes
    -----
    A method of this project. An error of 1 % in the closing speed moves the ranges of a
    ship's top against those of its waterline by 4 m: every upright face leans by the error over
    tan(depression), 5 deg. Pairs of pixels a deck apart in height give the slopes of faces. Most
    faces are upright, so the most frequent slope measures the error of the speed.

    Maximising the contrast of the profile is a worse criterion: the visible parts of a ship recede
    with height, tier by tier, and a closing speed some 2 % too low draws the tiers together. Raked
    faces count as upright, so the residual error is the ship's rake: for the six ships, up to
    1.3 % seen from near the stern and 3 % from ahead. The ship's speed acts on ranges as the
    aircraft's does; only the aircraft's is adjusted.

    Examples
    --------
    Navigation measures 94 m/s for an aircraft that flies at 90 m/s:

    >>> from dataclasses import replace
    >>> import numpy as np
    >>> import trimesh
    >>> from ncti.irar import fly, ship_heading
    >>> box = trimesh.creation.box((40, 10, 14)).apply_translation((0, 0, 7))
    >>> heading = ship_heading(aspect=180, sight=5)
    >>> flight = Flight(slant_range=4e3, ship_heading=heading, samples=60)
    >>> scan = fly(box, flight).record(np.random.default_rng(1))
    >>> corrected = autofocus(scan, replace(flight, aircraft_speed=94.0))
    >>> print(f"{corrected.aircraft_speed:.0f} m/s")
    90 m/s
    """
    flight = estimate
    for _ in range(MAX_ROUNDS):
        slope = _modal_slope(scan, flight)
        # An error dv of the closing speed makes an upright face lean by dv / climb.
        error = -slope * flight.climb / closing_per_speed(flight)
        flight = replace(flight, aircraft_speed=flight.aircraft_speed + error)
    return flight


def closing_per_speed(flight: Flight) -> float:
    """Return the derivative of the closing speed by the aircraft speed."""
    gain = float(compass_directions(flight.track, 0.0) @ compass_directions(flight.sight, 0.0))
    return math.copysign(max(abs(gain), 1e-3), gain)


def _modal_slope(scan: Scan, flight: Flight) -> float:
    """Return the most frequent slope of faces in the corrected image [m/m]."""
    image = segmented(correct(scan, Correction(), estimate=flight, overscanned=True), flight)
    # Horizontal distance of every pixel, from its range and its angle below the horizon.
    below = math.radians(flight.depression) - np.arctan(image.row * flight.ifov)
    level = image.range * np.cos(below)[:, None]
    spacing = float(image.row[1] - image.row[0]) * flight.pixel
    # Slopes between pixels of a column a deck apart, with no gap in between.
    rows = max(2, round(SLOPE_HEIGHT / spacing))
    gaps = np.cumsum(~np.isfinite(level), axis=0)
    is_unbroken = np.isfinite(level[:-rows]) & (gaps[rows:] == gaps[:-rows])
    slopes = (level[rows:] - level[:-rows])[is_unbroken] / (rows * spacing)
    if not slopes.size:
        raise NothingSeenError(
            f"scan shows nothing {SLOPE_HEIGHT:g} m high after correction, but must show a ship"
        )
    slope, count = slope_spectrum(slopes, steepest=REACH * flight.closing_speed / flight.climb)
    return float(slope[np.argmax(count)])

"""Closing speed from the scan itself: the one at which upright faces stand upright."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require
from ncti.irar.chain import Correction, correct, segmented
from ncti.irar.flight import Flight
from ncti.irar.mirror import compass
from ncti.irar.scan import Scan

Floats = NDArray[np.float64]

RISE = 3.2
"""Height over which slopes are taken [m]: about that of a deck, so that few pairs bridge a tier."""

WIDTH = 0.1
"""Width of the kernel that slopes are counted with: about their noise, 0.3 m twice over a rise.

A wider one reaches from upright faces to tiers that recede, and takes these for a speed.
"""

ROUNDS = 3
"""Corrections in turn. The looks of a pixel are smeared by a wrong speed, less each time."""

STEP = 0.01


def slope_spectrum(slopes: Floats, *, steepest: float) -> tuple[Floats, Floats]:
    """How many pairs of pixels recede at each slope.

    Parameters
    ----------
    slopes : (pair,) float64 ndarray
        Change of horizontal distance with height [m/m].
    steepest : float
        Largest slope of the spectrum, either way.

    Returns
    -------
    slope, count : (slope,) float64 ndarray
        Counts smoothed with a Gaussian of standard deviation `WIDTH`.
    """
    centres = np.arange(-math.ceil(steepest / STEP), math.ceil(steepest / STEP) + 1) * STEP
    edges = np.append(centres, centres[-1] + STEP) - STEP / 2
    reach = 4 * WIDTH
    wide = np.arange(edges[0] - reach, edges[-1] + reach, STEP)
    counts, _ = np.histogram(slopes, wide)
    middle = (wide[1:] + wide[:-1]) / 2
    kernel = np.exp(-(((centres[:, None] - middle) / WIDTH) ** 2) / 2)
    smooth: Floats = kernel @ counts
    return centres.astype(np.float64), smooth


def autofocus(scan: Scan, belief: Flight, *, reach: float = 0.1) -> Flight:
    """A belief whose aircraft's speed makes most of the ship's steep faces upright.

    Parameters
    ----------
    scan : Scan
        Raw images.
    belief : Flight
        The flight as navigation has it.
    reach : float
        Largest error of the closing speed that is looked for, as a fraction of it, below 1.

    Returns
    -------
    Flight
        The belief with another `aircraft_speed`.

    Raises
    ------
    ValueError
        If the reach is out of range, or nothing in the corrected image stands a deck high.

    Notes
    -----
    Ours. An error of 1 % in the closing speed moves the ranges of a ship's top against those of
    its waterline by 4 m: every upright face leans by the error over tan(depression), 5 deg. Pairs
    of pixels a deck apart in height give the slopes of faces; most faces are upright, and the
    slope that most pairs have (the contrast of their spectrum) is what the speed is wrong by.

    The sharpest profile, the obvious contrast, is a worse guide: what is seen of a ship recedes
    with height, tier by tier, and a closing speed some 2 % too low draws the tiers together. Faces
    that are raked are taken for upright, so that what is left is the ship's own rake: up to 1.3 %
    near the stern, and 3 % ahead, of the six ships. The ship's speed acts on ranges as the
    aircraft's does, which is the one adjusted.
    """
    require("reach", reach, positive=True, below=1)
    flight = belief
    for _ in range(ROUNDS):
        slope = _commonest_slope(scan, flight, reach=reach)
        # A face seen at a closing speed v + dv leans by dv / climb.
        error = -slope * flight.climb / closing_per_speed(flight)
        flight = replace(flight, aircraft_speed=flight.aircraft_speed + error)
    return flight


def closing_per_speed(flight: Flight) -> float:
    """Closing speed gained for each metre a second that the aircraft is faster."""
    gain = float(compass(flight.track, 0.0) @ compass(flight.sight, 0.0))
    return math.copysign(max(abs(gain), 1e-3), gain)


def _commonest_slope(scan: Scan, flight: Flight, *, reach: float) -> float:
    image = segmented(correct(scan, Correction(), belief=flight, overscanned=True), flight)
    below = math.radians(flight.depression) - np.arctan(image.row * flight.ifov)
    level = image.range * np.cos(below)[:, None]
    apart = float(image.row[1] - image.row[0]) * flight.pixel
    rows = max(2, round(RISE / apart))
    gaps = np.cumsum(~np.isfinite(level), axis=0)
    unbroken = np.isfinite(level[:-rows]) & (gaps[rows:] == gaps[:-rows])
    slopes = (level[rows:] - level[:-rows])[unbroken] / (rows * apart)
    if not slopes.size:
        raise ValueError(
            f"scan has nothing that stands {RISE:g} m high after correction, but must show a ship"
        )
    slope, count = slope_spectrum(slopes, steepest=reach * flight.closing_speed / flight.climb)
    return float(slope[np.argmax(count)])

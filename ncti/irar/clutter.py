"""Clutter of the sea in the passive image: a temperature field that is fixed to the water."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require, require_generator
from ncti.irar.flight import Flight

Floats = NDArray[np.float64]

WAVES = 64
"""Number of cosines that make up a field."""


def sea_places(flight: Flight, time: Floats, along: Floats, across: Floats) -> Floats:
    """Return the points where lines of sight meet the water.

    Parameters
    ----------
    flight : Flight
        The pass, with its pointing settled.
    time : (...) float64 ndarray
        Time after the snapshot [s].
    along, across : (...) float64 ndarray
        Scan angle, and angle above the scan plane, as for `Flight.directions` [rad].

    Returns
    -------
    (..., 2) float64 ndarray
        Place on the water, along and across the ship's course, from the ship's origin in the
        snapshot [m]; NaN above the horizon. The ship moves relative to the water.
    """
    origin, ways = flight.position(time), flight.directions(along, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(ways[..., 2] < 0, -origin[..., 2] / ways[..., 2], np.nan)
    place = origin[..., :2] + reach[..., None] * ways[..., :2]
    place[..., 0] += flight.ship_speed * time
    return place


def clutter(
    places: Floats,
    *,
    deviation: float,
    length: float,
    rng: np.random.Generator,
) -> Floats:
    """Draw temperatures of the sea about their mean.

    Parameters
    ----------
    places : (..., 2) float64 ndarray
        Places on the water [m]; NaN where there is none.
    deviation : float
        Standard deviation of a sample [K].
    length : float
        Distance on the water at which the correlation has fallen to 1/e [m].
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    (...) float64 ndarray
        [K]; 0 where there is no sea.

    Raises
    ------
    ValueError
        If the deviation is negative, the length not above 0, or either not finite.

    See Also
    --------
    sea_places : Places that samples see.

    Notes
    -----
    deviation sqrt(2 / W) times the sum of W cosines of phases k.x + phi, phi uniform and both
    components of k normal of variance 2 / length^2. Over draws its mean is 0 and its covariance
    deviation^2 exp(-r^2 / length^2), exactly, at any places; over an area of many lengths its
    variance is deviation^2 in every draw. A value is normal but for a kurtosis of -3 / (2 W).

    The field lies still on the water: lines that overscan a place see the same of it, so that it
    does not average away, as the noise of detectors does. Waves that move meanwhile, and glint,
    are left out.

    Examples
    --------
    >>> grid = np.stack(np.meshgrid(np.arange(0.0, 500, 5), np.arange(0.0, 500, 5)), axis=-1)
    >>> field = clutter(grid, deviation=0.2, length=10.0, rng=np.random.default_rng(0))
    >>> print(f"{field.std():.2f} K")
    0.20 K
    """
    require("deviation", deviation, minimum=0.0)
    require("length", length, positive=True)
    require_generator("rng", rng)
    vectors = rng.standard_normal((WAVES, 2)) * (math.sqrt(2.0) / length)
    phases = rng.random(WAVES) * (2 * math.pi)
    seen = np.isfinite(places).all(axis=-1)
    x, y = places[seen].T
    total = np.zeros(x.size)
    for (k, m), phase in zip(vectors, phases, strict=True):
        total += np.cos(k * x + m * y + phase)
    temperature = np.zeros(seen.shape)
    temperature[seen] = deviation * math.sqrt(2 / WAVES) * total
    return temperature

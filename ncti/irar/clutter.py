"""Clutter of the sea in the passive image: a temperature field that is fixed to the water."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncti.irar.flight import Flight

Floats = NDArray[np.float64]

WAVES = 64
"""Number of cosines that make up a field."""


def sea_places(flight: Flight, time: Floats, along: Floats, across: Floats) -> Floats:
    """Return the points (..., 2) [m] where lines of sight meet the water, NaN above the horizon.

    They lie along and across the ship's course, from the ship's origin in the snapshot; the ship
    moves relative to the water. `time` (...) [s] is after the snapshot; `along`, `across` (...)
    [rad] are as for `Flight.directions`.
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
    """Draw temperatures (...) of the sea about their mean [K], 0 where there is no sea.

    `places` (..., 2) [m] lie on the water; `deviation` [K] is that of a sample; over `length` [m]
    the correlation falls to 1/e. The field is deviation sqrt(2 / W) times the sum of W cosines of
    phases k.x + phi, phi uniform and both components of k normal of variance 2 / length^2. Over
    draws its mean is 0 and its covariance deviation^2 exp(-r^2 / length^2), exactly, at any places;
    over an area of many lengths its variance is deviation^2 in every draw. A value is normal except
    for a kurtosis of -3 / (2 W).

    The field lies still on the water: lines that overscan a place see the same temperature there,
    so that it does not average out like detector noise. Moving waves and glint are left out.
    """
    vectors = rng.standard_normal((WAVES, 2)) * (math.sqrt(2.0) / length)
    phases = rng.random(WAVES) * (2 * math.pi)
    on_water = np.isfinite(places).all(axis=-1)
    x, y = places[on_water].T
    total = np.zeros(x.size)
    for (k, m), phase in zip(vectors, phases, strict=True):
        total += np.cos(k * x + m * y + phase)
    temperature = np.zeros(on_water.shape)
    temperature[on_water] = deviation * math.sqrt(2 / WAVES) * total
    return temperature

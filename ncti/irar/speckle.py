"""Speckle of one detector, and its correlation from line to line."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncti.irar.flight import WAVELENGTH, Flight

MIN_CORRELATION = 1e-3
"""Correlation of the field below which looks are drawn independently."""


def speckle_correlation(flight: Flight) -> float:
    """Return the correlation of the received field between one line and the next, 0 to 1.

    A beam and a receiver matched to it, both Gaussian with 1/e^2 intensity diameter phi R on the
    ship, weight its rough surface with the field E(x)^2. When the sensor moves by D across the line
    of sight, the phase of E^2 tilts; as the beam keeps its direction, the footprint also moves by
    D. For a delta-correlated surface the overlap is

        mu = exp(-(pi phi D / (2 lambda))^2 - (2 D / (phi R))^2).

    The tilt dominates. At 90 m/s, 5 deg off and 6.7 deg down, D is 0.1 m a line against a speckle
    lobe of lambda / phi = 5 cm, and mu is 1e-4 or less; at a hundredth of the speed mu is nearly 1
    and averaging lines gains nothing. The footprints of neighbouring samples are a whole IFOV
    apart, with mu = exp(-4), and are drawn independently.
    """
    across = math.hypot(flight.climb, flight.drift) / flight.line_rate
    lobe = math.pi * flight.ifov * across / (2 * WAVELENGTH)
    return math.exp(-(lobe**2) - (2 * across / flight.pixel) ** 2)


def speckle(
    shape: tuple[int, int, int], *, correlation: float, rng: np.random.Generator
) -> NDArray[np.complex64]:
    """Draw (line, column, ray) circular complex Gaussian amplitudes, correlated along the lines.

    Their mean power is 1. In this first-order Markov sequence lines k apart correlate by mu^k,
    while those of the surface do by mu^(k^2). For partly correlated frames this understates the
    gain of averaging; for independent or identical frames it is exact.
    """
    field = rng.standard_normal((*shape, 2), dtype=np.float32).view(np.complex64)[..., 0]
    field *= np.float32(math.sqrt(0.5))
    if correlation < MIN_CORRELATION:
        return field
    from scipy.signal import lfilter

    field[1:] *= np.float32(math.sqrt(1 - correlation**2))
    filtered: NDArray[np.complex64] = lfilter([1.0], [1.0, -correlation], field, axis=0)
    return filtered.astype(np.complex64)

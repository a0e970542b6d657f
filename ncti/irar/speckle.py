"""Speckle of one detector from line to line: when successive looks are independent."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncti.irar.flight import WAVELENGTH, Flight

INDEPENDENT = 1e-3
"""Correlation of the field below which looks are drawn independently."""


def speckle_correlation(flight: Flight) -> float:
    """Correlation of the received field between one line and the next.

    Parameters
    ----------
    flight : Flight
        The pass.

    Returns
    -------
    float
        From 0, independent looks, to 1, the same speckle again.

    Notes
    -----
    A beam and a receiver matched to it, both Gaussian with 1/e^2 intensity diameter phi R on the
    ship, weigh its rough surface with the field E(x)^2. When the sensor moves by D across the line
    of sight, the phase of E^2 tilts; and as the beam keeps its direction, the footprint moves
    along by as much. The overlap gives, for a delta-correlated surface,

        mu = exp(-(pi phi D / (2 lambda))^2 - (2 D / (phi R))^2).

    The tilt is what matters: at 90 m/s, 5 deg off and 6.7 deg down D is 0.1 m a line against a
    speckle lobe of lambda / phi = 5 cm, mu = 1e-4 or less; at a hundredth of the speed mu is
    nearly 1 and averaging lines gains nothing. Of neighbouring samples the footprints are a whole
    IFOV apart and mu = exp(-4); they are drawn independently.
    """
    across = math.hypot(flight.climb, flight.drift) / flight.line_rate
    lobe = math.pi * flight.ifov * across / (2 * WAVELENGTH)
    return math.exp(-(lobe**2) - (2 * across / flight.pixel) ** 2)


def speckle(
    shape: tuple[int, int, int], *, correlation: float, rng: np.random.Generator
) -> NDArray[np.complex64]:
    """Circular complex Gaussian amplitudes, correlated along the lines.

    Parameters
    ----------
    shape : (int, int, int)
        Lines, columns and rays.
    correlation : float
        From line to line, as of `speckle_correlation`.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    (line, column, ray) complex64 ndarray
        Of unit mean power.

    Notes
    -----
    A first-order Markov sequence of lines: k lines apart the correlation is mu^k, where the
    surface has mu^(k^2). Of frames that are partly correlated it understates what averaging
    gains; where they are independent, or the same, it is exact.
    """
    drawn = rng.standard_normal((*shape, 2), dtype=np.float32).view(np.complex64)[..., 0]
    drawn *= np.float32(math.sqrt(0.5))
    if correlation < INDEPENDENT:
        return drawn
    # Imported where it is used: scipy.signal takes half a second.
    from scipy.signal import lfilter

    drawn[1:] *= np.float32(math.sqrt(1 - correlation**2))
    followed: NDArray[np.complex64] = lfilter([1.0], [1.0, -correlation], drawn, axis=0)
    return followed.astype(np.complex64)

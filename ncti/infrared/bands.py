"""Black-body radiance in a wavelength band, and the contrast of a warm ship in it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all
from ncti.infrared.radiometry import CONTRAST_AT_ZERO, Values

PLANCK = 6.62607015e-34
"""h [J s], exact."""

BOLTZMANN = 1.380649e-23
"""k [J/K], exact."""

SPEED_OF_LIGHT = 299_792_458.0
"""c [m/s], exact."""

MID_WAVE = (3e-6, 5e-6)
"""Band of the proposed imager [m]; article, 'The NCTI Sensor Suite'."""

LONG_WAVE = (8e-6, 12e-6)
"""Band of IRAR's passive detectors [m]; article, 'The Infrared Airborne Radar (IRAR) System'."""

SEA_TEMPERATURE = 288.15
"""Temperature of the sea [K], 15 degrees Celsius: an assumption, as the article states none."""

LONG_WAVE_EXTINCTION = 0.5e-3
"""One-way extinction of radiance at 8 to 12 um [dB/m]: assumed, for clear maritime air."""

# 2 k^4 / (h^3 c^2): a black body's radiance is this times T^4 times an integral over
# h c / (lambda k T).
_RADIANCE = 2 * BOLTZMANN**4 / (PLANCK**3 * SPEED_OF_LIGHT**2)
_TERMS = 45  # exp(-45) is below the rounding of the first term
_NEAR_ZERO = 1.0  # below it, the power series
# Power series of the integral of t^3 / (exp(t) - 1) from 0 to x: powers of x and coefficients from
# Bernoulli's numbers. The next coefficient, of x^17, is 8e-13.
_POWERS = (
    *((3, 1 / 3), (4, -1 / 8), (5, 1 / 60), (7, -1 / 5040), (9, 1 / 272160)),
    *((11, -1 / 13305600), (13, 1 / 622702080), (15, -691 / 19615115520000)),
)

Floats = NDArray[np.float64]


def band_radiance(temperature: ArrayLike, *, band: tuple[float, float]) -> Any:
    """Return the radiance of a black body between two wavelengths [W m-2 sr-1].

    `temperature` (...) [K], `band` [m]. The integral of 2 h c^2 / lambda^5 / (exp(h c / (lambda k
    T)) - 1) is, with x = h c / (lambda k T), 2 k^4 T^4 / (h^3 c^2) times the integral of x^3 /
    (exp(x) - 1), summed as a series of exp(-n x), or of powers of x below 1 (Widger and Woodall,
    Bull. Amer. Meteor. Soc. 57, 1217 (1976)). Over all wavelengths it is the Stefan-Boltzmann law,
    sigma T^4 / pi.
    """
    kelvin, near, far = _reduced_energies(temperature, band)
    return _RADIANCE * kelvin**4 * (_tail_integral(far) - _tail_integral(near))


def radiance_slope(temperature: ArrayLike, *, band: tuple[float, float]) -> Any:
    """Return the derivative of `band_radiance` by temperature [W m-2 sr-1 K-1].

    With F(x) the integral of t^3 / (exp(t) - 1) from x on, the derivative of T^4 F(a / T) is T^3 (4
    F(x) + x^4 / (exp(x) - 1)).
    """
    kelvin, near, far = _reduced_energies(temperature, band)
    parts = [4 * _tail_integral(x) + x**4 * np.exp(-x) / -np.expm1(-x) for x in (near, far)]
    return _RADIANCE * kelvin**3 * (parts[1] - parts[0])


def band_contrast(
    slant_range: Values,
    *,
    band: tuple[float, float] = LONG_WAVE,
    contrast_at_zero: float = CONTRAST_AT_ZERO,
    sea_temperature: float = SEA_TEMPERATURE,
    extinction: float = LONG_WAVE_EXTINCTION,
) -> Values:
    """Return the apparent temperature of a black ship above a black sea, in a band.

    Parameters
    ----------
    slant_range : (...) array_like
        Sensor to target [m].
    band : (float, float)
        Shortest and longest wavelength [m].
    contrast_at_zero : float
        Temperature of the ship above the sea [K]; negative for a colder ship.
    sea_temperature : float
        Temperature of the sea [K].
    extinction : float
        One-way extinction of radiance in that band [dB/m].

    Returns
    -------
    float or (...) float64 ndarray
        Contrast [K].

    Raises
    ------
    ValueError
        If a range or the extinction is negative, a temperature not above 0, the band empty, or
        anything not finite.

    See Also
    --------
    contrast : Contrast as Table 1 has it, for the imager at 3 to 5 um.

    Notes
    -----
    10^(-extinction R / 10) (L(T + dT) - L(T)) / (dL/dT)(T), with L the radiance in the band: the
    reading of a sensor that is calibrated about the sea's temperature. A noise-equivalent
    temperature difference is a noise-equivalent radiance in the same unit, so their ratio is the
    signal-to-noise ratio, 1 where they are equal, as the article defines it.

    The decibels are of radiance; those of `contrast` are of its square, as in Table 1 [1]_.
    Emissivity below 1, and with it the sky reflected by ship and sea, is neglected.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, Table 1.

    Examples
    --------
    In the 8 to 12 um band of the airborne radar's passive detectors, at 3 and 5 km:

    >>> import numpy as np
    >>> band_contrast(np.array([3e3, 5e3])).round(2)
    array([1.55, 1.23])
    """
    distance = require_all("slant_range", slant_range, minimum=0.0)
    require("contrast_at_zero", contrast_at_zero)
    require("sea_temperature", sea_temperature, positive=True)
    require("extinction", extinction, minimum=0.0)
    ship = sea_temperature + contrast_at_zero
    if ship <= 0:
        raise ValueError(
            f"contrast_at_zero is {contrast_at_zero:g}, but must be above {-sea_temperature:g}, "
            "so that the ship is above 0 K"
        )
    difference = band_radiance(ship, band=band) - band_radiance(sea_temperature, band=band)
    transmission = 10.0 ** (-extinction * distance / 10)
    return transmission * difference / radiance_slope(sea_temperature, band=band)


def _reduced_energies(
    temperature: ArrayLike, band: tuple[float, float]
) -> tuple[Floats, Floats, Floats]:
    """Return temperatures, and h c / (lambda k T) at the shortest and the longest wavelength."""
    kelvin = require_all("temperature", temperature, positive=True)
    shortest, longest = require_all("band", band, positive=True)
    if not shortest < longest:
        raise ValueError(
            f"band is {shortest:g} to {longest:g} m, but must go from a shorter to a longer "
            "wavelength"
        )
    scale = PLANCK * SPEED_OF_LIGHT / (BOLTZMANN * kelvin)
    return kelvin, scale / shortest, scale / longest


def _tail_integral(x: Floats) -> Floats:
    """Return the integral of t^3 / (exp(t) - 1) from x to infinity, for x above 0."""
    far = np.maximum(x, _NEAR_ZERO)
    series = np.zeros_like(far)
    for n in range(1, _TERMS + 1):
        series += np.exp(-n * far) * (((far / n + 3 / n**2) * far + 6 / n**3) * far + 6 / n**4)
    near = np.minimum(x, _NEAR_ZERO)
    return np.where(
        x < _NEAR_ZERO,
        math.pi**4 / 15 - sum(coefficient * near**power for power, coefficient in _POWERS),
        series,
    )

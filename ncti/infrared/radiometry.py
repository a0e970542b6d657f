"""Thermal contrast, noise and signal-to-noise ratio of the passive sensor, by range."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require_all

CONTRAST_AT_ZERO = 2.1585
"""Temperature of the ship above the sea at zero range [K].

Inverted from the article's Table 1: with NEDT / 4 = 0.1 K of noise, the SNR printed as 58.0 at
50 km, behind 9.05 dB, is a contrast of 0.7613 to 0.7619 K there and of 2.1579 to 2.1598 K at zero
range; the 164 at 25 km, as an integer, narrows that to 2.1579 to 2.1594 K. Any value in that
interval reproduces the table.
"""

EXTINCTION = 0.181e-3
"""One-way extinction of the atmosphere at 3 to 5 um [dB/m]: 18.1 dB over 100 km in Table 1.

The 9.05 dB over 50 km limit it to 0.1809e-3 to 0.1811e-3.
"""

NEDT = 0.4
"""Noise-equivalent temperature difference of one frame [K].

The article's design value, 0.1 K, is that of the 16-frame average: the contrasts and 16-frame
ratios of Table 1 give 0.27 / sqrt(7.2) = 0.1 K, and averaging 16 frames reduces the noise by 4.
"""

IFOV = 150e-6
"""Side of the square instantaneous field of view [rad]; article, 'NCTI Sensor Suite'."""

SPREAD = 0.1
"""Standard deviation of the ship's temperature, and of the sea's, about their means [K].

An assumption: the article takes it from measurements that it does not print. It hardly matters at
25 and 50 km and does not explain the fall from 25 km to 50 km super-resolved in Table 5, but it
determines detection and identification at 100 km (docs/reproduction.md gives both).
"""

Values = TypeVar("Values", float, NDArray[Any])


def attenuation(slant_range: Values, *, extinction: float = EXTINCTION) -> Values:
    """Return the one-way loss through the atmosphere.

    Parameters
    ----------
    slant_range : (...) array_like
        Sensor to target [m].
    extinction : float
        One-way extinction [dB/m].

    Returns
    -------
    float or (...) float64 ndarray
        Attenuation [dB].

    Raises
    ------
    ValueError
        If a range or the extinction is negative or not finite.

    See Also
    --------
    contrast : Thermal contrast after this loss.

    Notes
    -----
    Extinction times range, for a homogeneous path. Table 1 of the article prints 4.5, 9.05 and 18.1
    dB at 25, 50 and 100 km [1]_.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, Table 1.

    Examples
    --------
    >>> print(f"{attenuation(100e3):.1f} dB")
    18.1 dB
    """
    distance = require_all("slant_range", slant_range, minimum=0.0)
    return float_or_array(require_all("extinction", extinction, minimum=0.0) * distance)


def contrast(
    slant_range: Values,
    *,
    contrast_at_zero: float = CONTRAST_AT_ZERO,
    extinction: float = EXTINCTION,
) -> Values:
    """Return the apparent temperature of the ship above the sea, by range.

    Parameters
    ----------
    slant_range : (...) array_like
        Sensor to target [m].
    contrast_at_zero : float
        Contrast without an atmosphere [K]; negative for a ship colder than the sea.
    extinction : float
        One-way extinction [dB/m].

    Returns
    -------
    float or (...) float64 ndarray
        Contrast [K].

    Raises
    ------
    ValueError
        If a range or the extinction is negative, or anything is not finite.

    See Also
    --------
    snr : Signal-to-noise ratio of one pixel.
    band_contrast : Contrast in any wavelength band, by Planck's law.

    Notes
    -----
    dT(R) = dT(0) 10^(-attenuation / 20), which reproduces the 1.28, 0.76 and 0.27 K of Table 1
    [1]_. The decibels act on the temperature with 20 in the exponent: they are decibels of the SNR,
    the square of the temperature, and not of the radiance.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, Table 1.

    Examples
    --------
    The contrasts of Table 1, at 25, 50 and 100 km:

    >>> import numpy as np
    >>> contrast(np.array([25e3, 50e3, 100e3])).round(2)
    array([1.28, 0.76, 0.27])
    >>> print(f"{contrast(100e3):.2f} K")
    0.27 K
    """
    loss = np.asarray(attenuation(slant_range, extinction=extinction))
    return float_or_array(require_all("contrast_at_zero", contrast_at_zero) * 10.0 ** (-loss / 20))


def noise_temperature(frame_count: Values, *, nedt: float = NEDT) -> Values:
    """Return the detector noise of the average of some frames.

    Parameters
    ----------
    frame_count : (...) array_like of int
        Frames averaged, N.
    nedt : float
        Noise of one frame [K].

    Returns
    -------
    float or (...) float64 ndarray
        nedt / sqrt(N) [K].

    Raises
    ------
    ValueError
        If a count is not a whole number of at least 1, or the noise is negative or not finite.

    See Also
    --------
    snr : Signal-to-noise ratio with this noise.
    pixel_sigma : Standard deviation of a pixel, spread of the scene included.

    Notes
    -----
    The noise of each frame is independent, so 16 frames improve the sensor by a factor of 4 [1]_.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, 'Passive-IR Signatures'.

    Examples
    --------
    >>> import numpy as np
    >>> noise_temperature(np.array([1, 4, 16]))
    array([0.4, 0.2, 0.1])
    """
    counts = require_all("frame_count", frame_count, whole=True, minimum=1.0)
    return float_or_array(require_all("nedt", nedt, minimum=0.0) / np.sqrt(counts))


def snr(
    slant_range: Values,
    *,
    frame_count: Values | int = 16,
    contrast_at_zero: float = CONTRAST_AT_ZERO,
    extinction: float = EXTINCTION,
    nedt: float = NEDT,
) -> Values:
    """Return the signal-to-noise ratio of one pixel of a frame average, as a power ratio.

    Parameters
    ----------
    slant_range : (...) array_like
        Sensor to target [m].
    frame_count : (...) array_like of int
        Frames averaged.
    contrast_at_zero : float
        Contrast without an atmosphere [K].
    extinction : float
        One-way extinction [dB/m].
    nedt : float
        Noise of one frame [K].

    Returns
    -------
    float or (...) float64 ndarray
        (contrast / noise temperature)^2, of the shape that range and frame count broadcast to.

    Raises
    ------
    ValueError
        If a range is negative, a frame count is not a whole number of at least 1, or the noise is
        zero or too small for the ratio to be finite.

    See Also
    --------
    contrast : Signal.
    noise_temperature : Noise.

    Notes
    -----
    Table 1 of the article prints 164.0, 58.0 and 7.2 at 25, 50 and 100 km for 16 frames [1]_. The
    last two are reproduced as printed, the first as the integer 164 (164.4): no single extinction
    gives its decimal too. The 9.05 dB at 50 km make the ratio of the first two at least 10^(4.5225
    / 10) = 2.833, while the printed figures allow 164.05 / 57.95 = 2.831 at most.

    The temperature spread of ship and sea is not counted as noise, nor is it in the table.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, Table 1.

    Examples
    --------
    >>> import numpy as np
    >>> snr(np.array([25e3, 50e3, 100e3])).round(1)
    array([164.4,  58. ,   7.2])

    One frame instead of 16 loses a factor of 16:

    >>> print(f"{snr(100e3, frame_count=1):.2f}")
    0.45
    """
    require_all("nedt", nedt, positive=True)
    signal = contrast(slant_range, contrast_at_zero=contrast_at_zero, extinction=extinction)
    noise = noise_temperature(np.asarray(frame_count), nedt=nedt)
    with np.errstate(over="ignore"):
        ratio = (np.asarray(signal) / np.asarray(noise)) ** 2
    if not np.isfinite(ratio).all():
        raise ValueError(
            f"contrast_at_zero is {contrast_at_zero!r} and nedt {nedt!r}, but the square of their "
            "ratio must be a finite number"
        )
    return float_or_array(ratio)


def float_or_array(values: NDArray[np.float64] | np.float64) -> Any:
    """Return a float for a scalar, the array otherwise."""
    return float(values) if np.ndim(values) == 0 else values

"""Bounds on the sampling error of range extents from lines and from pixels."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.ladar.pulse import Pulse, target_response
from ncti.render.lines import STRANDS

Floats = NDArray[np.float64]

HARMONICS = (6, 7, 8)
"""Harmonics of the strands near the spacing, in sixteenths of a cycle per line."""

ROUGHNESS, FACTOR, FEW_LINES = -0.148, 0.95, 34.0
"""Constants of `sampling_error`; quantile regression gave the first two."""

PIXEL_FACTOR = 0.6
"""Factor of `pixel_error`."""

EXPONENT = 1.6
"""Exponent of the error as a power of the spacing."""


def sampling_error(
    strands: Floats, line_count: int, pulse_width: float, *, bin_width: float
) -> float:
    """Return a bound on the error sum |p - q| / sum q of lines, after a pulse's power response.

    `strands` (16, bin) are the extents p by every sixteenth line, strand k by the lines k, k + 16
    ...; q is exact; `pulse_width` [s] is at 1/e^2, 0 for none. NaN if nothing is visible.

    Lines at the spacing d sample the extent as a function f(y) of the place across the lines, and
    by Poisson's summation formula their sum errs by the components of f at the frequencies 1/d, 2/d
    ... A Fourier sum over the strands measures those below 1/2d: A(j) is the sum over bins of its
    magnitude at j/16d, over the sum of the extent. With a the mean of A at 6, 7 and 8, the bound
    for n lines is

        0.95 (1 + (34/n)^2) a (a n^1.6)^-0.148.

    The last factor shrinks a towards the value for a typical ship, which falls as n^-1.6; 1 +
    (34/n)^2 allows for few lines that agree by chance. The constants come from quantile regressions
    on true errors, including errors of extents refined to a tolerance, since adding lines until a
    bound is small enough favours bounds that are too small; docs/accuracy.md tests them in other
    views. The logarithm of the error scatters about any such estimate by 0.25 to 0.45, most after
    long pulses: the phase of the harmonics at 1/d depends on where the lines lie.
    """
    if line_count < 1:
        return math.nan
    missed = magnitude(strands, pulse_width, bin_width=bin_width)
    if not missed > 0:
        return missed  # 0, or NaN if nothing is visible
    return FACTOR * scarcity(line_count) * missed * (missed * line_count**EXPONENT) ** ROUGHNESS


def pixel_error(strands: Floats, extent: Floats, pulse_width: float, *, bin_width: float) -> float:
    """Return a bound on the error sum |p - q| / sum q of pixels, after a pulse's power response.

    `strands` (4, bin) are the extents by every second row and column, each a quarter of an image
    with pixels twice as wide; `extent` (bin,) is p, by all pixels; q is exact; `pulse_width` is at
    1/e^2 [s], 0 for none. NaN if nothing is visible. With s_k the strands after the pulse, the
    bound is

        0.6 sum sqrt(mean over k of (4 s_k - p)^2) / sum p.

    The sum estimates the error of pixels twice as wide. Errors fall roughly as the pixel size to
    the power of 1.5, and the error of spreading pixels in range, which all strands share, at least
    as fast, so the median error of all pixels is a third of the sum. The error scatters with the
    positions of the pixels: 98 of 100 errors are within 0.6 of the sum, for pixels of 0.09 to 1.4 m
    and spreads of 0 to 1, in the views from which the factor was set. docs/accuracy.md validates it
    on others.
    """
    total = float(extent.sum())
    if not total > 0:
        return math.nan
    deviation = len(strands) * strands - extent
    occupied = np.flatnonzero(deviation.any(axis=0))
    if not occupied.size:
        return 0.0
    deviation = deviation[:, occupied[0] : occupied[-1] + 1]
    deviation, gain = _after_pulse(deviation, pulse_width, bin_width)
    return PIXEL_FACTOR * float(np.sqrt((deviation**2).mean(axis=0)).sum()) / (total * gain)


def magnitude(strands: Floats, pulse_width: float, *, bin_width: float) -> float:
    """Return the mean magnitude a of the fine harmonics; see `sampling_error`."""
    total = float(strands.sum())
    if not total > 0:
        return math.nan
    occupied = np.flatnonzero(strands.any(axis=0))
    fourier_sums = _FOURIER_ROWS @ strands[:, occupied[0] : occupied[-1] + 1]
    fourier_sums, gain = _after_pulse(fourier_sums, pulse_width, bin_width)
    return float(np.abs(fourier_sums).sum()) / (len(HARMONICS) * (total * gain))


def _after_pulse(
    rows: NDArray[Any], pulse_width: float, bin_width: float
) -> tuple[NDArray[Any], float]:
    """Return rows (row, bin) after a pulse's power response, and the sum of the response."""
    if not pulse_width > 0.0:
        return rows, 1.0
    response = target_response(Pulse(pulse_width, bin_width)) ** 2
    return np.array([np.convolve(row, response) for row in rows]), float(response.sum())


def scarcity(line_count: int) -> float:
    """Return the factor of a bound for few lines, which may agree by chance."""
    return 1.0 + (FEW_LINES / line_count) ** 2


_FOURIER_ROWS = np.exp(-2j * np.pi * np.outer(HARMONICS, np.arange(STRANDS)) / STRANDS)

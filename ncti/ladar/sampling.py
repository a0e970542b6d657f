"""Bounds on the sampling error of range extents from lines and from pixels."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncti.ladar.pulse import target_response
from ncti.render.lines import STRANDS

Floats = NDArray[np.float64]

FINE = (6, 7, 8)
"""Harmonics of the strands, in sixteenths of a cycle a line, near the spacing."""

ROUGHNESS, FACTOR, FEW = -0.148, 0.95, 34.0
"""Of `sampling_error`; the first two are fitted by quantile regression."""

PIXELS = 0.6
"""Of `pixel_error`."""

SLOPE = 1.6
"""Power of the spacing with which the error falls."""


def sampling_error(
    strands: Floats, line_count: int, pulse_width: float, *, bin_width: float
) -> float:
    """Return a bound on the error of the sum of strands after convolution with a pulse.

    Parameters
    ----------
    strands : (16, bin) float64 ndarray
        Extent of the ship by every sixteenth line; strand k is of the lines k, k + 16 ...
    line_count : int
        Lines across the ship.
    pulse_width : float
        Full width of pulse and matched filter at 1/e^2 of the intensity [s]; 0 for none.
    bin_width : float
        Width of a range bin [m].

    Returns
    -------
    float
        Bound on sum |p - q| / sum q, p the sum of the strands, q the exact extent, both after the
        power response of the pulse; NaN if nothing is visible, or there are no lines.

    Notes
    -----
    Lines at the spacing d sample the extent of the ship as a function f(y) of the place across
    the lines. Their sum errs by what f has at the frequencies 1/d, 2/d ... (Poisson's summation
    formula). What it has below 1/2d can be read from the lines themselves, by a Fourier sum over
    the strands: A(j) is the sum over bins of its magnitude at j/16d, over the sum of the extent.
    The harmonics 6, 7 and 8 (8 is the difference of odd and even lines) are averaged to a, and the
    bound is

        0.95 (1 + (34/n)^2) a (a n^1.6)^-0.148

    for n lines. The last factor draws a towards that of a typical ship, whose a falls as n^-1.6;
    and few lines may agree by chance. Range along a line is exact, so nothing else is to bound.

    Fitted by quantile regressions on true errors: of lines 1 m to 1/32 m apart in random views and
    in views nearly end-on and abeam, with and without a pulse, and of extents within tolerances,
    since adding lines until a bound is small enough favours bounds that are too small. Other views
    judge it in docs/accuracy.md.

    The logarithm of the error scatters about any such estimate by 0.25 to 0.45, most after long
    pulses, where few range bins share it: where the lines lie decides the phase of the
    harmonics at 1/d.
    """
    if line_count < 1:
        return math.nan
    missed = magnitude(strands, pulse_width, bin_width=bin_width)
    if not missed > 0:
        return missed  # 0, or NaN where there is nothing
    return FACTOR * scarcity(line_count) * missed * (missed * line_count**SLOPE) ** ROUGHNESS


def pixel_error(strands: Floats, extent: Floats, pulse_width: float, *, bin_width: float) -> float:
    """Return a bound on the error of an extent by pixels after convolution with a pulse.

    Parameters
    ----------
    strands : (4, bin) float64 ndarray
        Extent of the ship by every second row and column, each a quarter of one by an image of
        pixels twice as wide.
    extent : (bin,) float64 ndarray
        That by all pixels.
    pulse_width : float
        Full width of pulse and matched filter at 1/e^2 of the intensity [s]; 0 for none.
    bin_width : float
        Width of a range bin [m].

    Returns
    -------
    float
        Bound on sum |p - q| / sum q, p the extent, q the exact one, both after the power response
        of the pulse; NaN if nothing is visible.

    Notes
    -----
    With s_k the strands after the pulse, the bound is

        0.6 sum sqrt(mean over k of (4 s_k - p)^2) / sum p.

    What it is 0.6 of is an error by pixels twice as wide. Errors fall as the pixel to the power of
    some 1.5, and that of spreading pixels in range, which all strands share, as fast or faster, so
    that errors by all pixels are a third of it in the median. Where the pixels lie decides how much
    more they are: 98 of 100 are within 0.6 of it, by pixels of 0.09 to 1.4 m and spreads of 0 to 1,
    in the views that the factor was set on. Other views judge it in docs/accuracy.md.
    """
    total = float(extent.sum())
    if not total > 0:
        return math.nan
    apart = len(strands) * strands - extent
    occupied = np.flatnonzero(apart.any(axis=0))
    if not occupied.size:
        return 0.0
    apart = apart[:, occupied[0] : occupied[-1] + 1]
    if pulse_width > 0.0:
        response = target_response(pulse_width=pulse_width, bin_width=bin_width) ** 2
        total *= float(response.sum())
        apart = np.array([np.convolve(each, response) for each in apart])
    return PIXELS * float(np.sqrt((apart**2).mean(axis=0)).sum()) / total


def magnitude(strands: Floats, pulse_width: float, *, bin_width: float) -> float:
    """Return the mean magnitude a of the fine harmonics; see `sampling_error`."""
    total = float(strands.sum())
    if not total > 0:
        return math.nan
    occupied = np.flatnonzero(strands.any(axis=0))
    waves = _WAVES @ strands[:, occupied[0] : occupied[-1] + 1]
    if pulse_width > 0.0:
        response = target_response(pulse_width=pulse_width, bin_width=bin_width) ** 2
        total *= float(response.sum())
        waves = np.array([np.convolve(wave, response) for wave in waves])
    return float(np.abs(waves).sum()) / (len(FINE) * total)


def scarcity(line_count: int) -> float:
    """Return the factor of a bound for few lines, which may agree by chance."""
    return 1.0 + (FEW / line_count) ** 2


_WAVES = np.exp(-2j * np.pi * np.outer(FINE, np.arange(STRANDS)) / STRANDS)

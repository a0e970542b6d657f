"""Error of a sampled range extent, and its order of convergence."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.ladar import RangeExtent

Floats = NDArray[np.float64]

EDGES = np.arange(-125.0, 126.0)  # the default window of 250 m, in bins of 1 m
SIDE = 15.0  # an IFOV of 150 microradians at 100 km [m]
DEPRESSION = 3.84  # from 22,000 ft, 100 km away [deg]
PULSE = 30e-9  # [s]

MEDIAN, WORST = 0.003, 0.015  # required accuracy of 0.25 m pixels after the 30 ns pulse

# An outline meets the rows of a lattice at varying phases, so each row's end errs by an independent
# part of a pixel: the L/p ends of an outline of length L add up to p^2 sqrt(L/p), or p^(3/2).
# A regular lattice may converge faster, up to p^2; parts thinner than a pixel converge slower.
SLOPE = 1.25

FAR = 1e12  # [m]: wavefronts are flat to 1e-8 m


def areas(extent: RangeExtent) -> Floats:
    """Return the visible projected area [m^2], (ifov, bin) ndarray."""
    return extent.fraction * (extent.ifov * extent.slant_range) ** 2


def after_pulse(area: Floats, pulse_width: float) -> Floats:
    """Return extents in bins of 1 m blurred by a pulse of `pulse_width` [s]; 0 is no pulse."""
    if pulse_width == 0.0:
        return area
    bins = area.shape[-1]
    lag = np.subtract.outer(np.arange(bins), np.arange(bins))
    n_z = 299_792_458.0 * pulse_width / math.sqrt(2.0)
    return area @ np.exp(-8.0 * lag**2 / n_z**2)


def error(area: Floats, truth: Floats, pulse_width: float) -> float:
    """Return the sum of absolute differences over the sum of the truth."""
    blurred = after_pulse(truth, pulse_width)
    return float(np.abs(after_pulse(area, pulse_width) - blurred).sum() / blurred.sum())


def slope(pixels: ArrayLike, errors: ArrayLike) -> float:
    """Return the exponent of the power law through the errors."""
    return float(np.polyfit(np.log(pixels), np.log(errors), 1)[0])

"""What the configuration of the laser radar comes to in the library's terms."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from ncti.ladar import RangeExtent, banded_frame_moments, carrier_to_noise
from sweeps.classifier_schema import WITH_MOMENTS
from sweeps.schema import RANGE, SweepConfig
from sweeps.sensor_schema import LadarConfig


def bin_centres(ladar: LadarConfig) -> NDArray[np.float64]:
    """Down-range bins [m] of every profile of a sweep."""
    count = round(ladar.window / ladar.bin_width)
    return ladar.bin_width * (np.arange(count, dtype=np.float64) - (count - 1) / 2)


def cnr_at(slant_range: float, ladar: LadarConfig) -> float:
    """Carrier-to-noise power ratio of a filled IFOV at a range [km]."""
    return carrier_to_noise(
        slant_range * 1e3,
        reference=10 ** (ladar.cnr / 10),
        reference_range=ladar.cnr_range * 1e3,
        extinction=ladar.extinction * 1e-3,
    )


def lags(config: SweepConfig) -> NDArray[np.float64]:
    """Lags [m] at which profiles are correlated, for the widest reach of the sweep's pulses.

    Asked for only where a classifier needs covariances; they reach as far with no ship there.
    """
    names = set(config.classifiers)
    if not names & set(WITH_MOMENTS) or RANGE not in config.sensors:
        return np.zeros(1)
    ladar = config.ladar
    grid = config.grid.expand()
    bands = [
        banded_frame_moments(_nowhere(ladar), pulse_width=t * 1e-9, cnr=cnr_at(r, ladar))[1]
        for t, r in product(grid.pulse_width, grid.range)
    ]
    return ladar.bin_width * np.arange(max(map(len, bands)), dtype=np.float64)


def _nowhere(ladar: LadarConfig) -> RangeExtent:
    """A range extent without a ship."""
    bins = bin_centres(ladar)
    return RangeExtent(
        fraction=np.zeros((0, bins.size)),
        down_range=bins,
        cell=np.zeros((0, 2), dtype=np.int64),
        bin_width=ladar.bin_width,
        ifov=ladar.ifov * 1e-6,
        slant_range=1.0,
    )

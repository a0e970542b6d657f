"""Cost of a setting of the laser radar: transmitted energy times the area of its aperture."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require_all
from ncti.ladar.beam import Beam, Signal

FRAMES, CNR, IFOV = 16, 10 * math.log10(Signal.cnr), Beam.ifov
"""Setting of the article, of cost 1: frames averaged, CNR at 100 km [dB], and IFOV [rad]."""


def relative_cost(frame_count: ArrayLike, cnr: ArrayLike, ifov: ArrayLike) -> NDArray[np.float64]:
    """Return energy times aperture area, relative to the article's sensor: frames CNR / IFOV^2.

    `frame_count` (...), `cnr` [dB] (...) of a filled IFOV at the reference range, `ifov` [rad]
    (...).

    A diffraction-limited aperture is as wide as wavelength / IFOV. For a given range, energy per
    pulse and IFOV goes as CNR IFOV^2, the number of IFOVs in the box around a ship as 1 / IFOV^2,
    so the energy sent to the box as frames CNR. Pulses of any width carry the same energy. The cost
    of a faster detector and that of the imager are not counted.
    """
    frames = np.asarray(frame_count, dtype=np.float64)
    if not (frames >= 0).all():
        raise ValueError(f"frame_count is {frame_count!r}, but must be at least 0")
    level, side = require_all("cnr", cnr), require_all("ifov", ifov, positive=True)
    cost: NDArray[np.float64] = frames / FRAMES * 10 ** ((level - CNR) / 10) * (IFOV / side) ** 2
    return cost

"""Cost of a setting of the laser radar: transmitted energy times the area of its aperture."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncti.ladar.beam import Beam, Signal

Numbers = float | NDArray[np.float64]

FRAMES, CNR, IFOV = 16, 10 * math.log10(Signal.cnr), Beam.ifov
"""Setting of the article, of cost 1: frames averaged, CNR at 100 km [dB], and IFOV [rad]."""


def relative_cost(frame_count: Numbers, cnr: Numbers, ifov: Numbers) -> Numbers:
    """Return energy times aperture area, relative to the article's sensor: frames CNR / IFOV^2.

    `frame_count` (...), `cnr` [dB] (...) of a filled IFOV at the reference range, `ifov` [rad]
    (...).

    A diffraction-limited aperture is as wide as wavelength / IFOV. For a given range, energy per
    pulse and IFOV goes as CNR IFOV^2, the number of IFOVs in the box around a ship as 1 / IFOV^2,
    so the energy sent to the box as frames CNR. Pulses of any width carry the same energy. The cost
    of a faster detector and that of the imager are not counted.
    """
    return frame_count / FRAMES * 10 ** ((cnr - CNR) / 10) * (IFOV / ifov) ** 2

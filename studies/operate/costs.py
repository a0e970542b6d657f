"""Cost of a setting of the laser radar: transmitted energy times the area of its aperture."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require_all

FRAMES, CNR, IFOV = 16, 32.0, 150e-6
"""Setting of the article, of cost 1: frames averaged, CNR at 100 km [dB], and IFOV [rad]."""


def relative_cost(frame_count: ArrayLike, cnr: ArrayLike, ifov: ArrayLike) -> NDArray[np.float64]:
    """Return energy times aperture area, relative to the article's sensor.

    Parameters
    ----------
    frame_count : (...) array_like
        Frames averaged.
    cnr : (...) array_like
        Carrier-to-noise ratio of a filled IFOV at the reference range [dB].
    ifov : (...) array_like
        Side of an IFOV [rad].

    Returns
    -------
    (...) float64 ndarray
        Cost; infinite for infinitely many frames.

    Raises
    ------
    ValueError
        If an IFOV is not above 0, or a number of frames is negative.

    See Also
    --------
    ncti.evaluate.crossing : Frames that suffice.

    Notes
    -----
    A beam as wide as the IFOV is limited by diffraction, so an aperture is as wide as
    wavelength / IFOV. A filled IFOV returns what was sent into it, and the aperture collects it in
    proportion to its area: energy per pulse and IFOV goes as CNR IFOV^2 for a given range, and the
    IFOVs in the box around a ship as 1 / IFOV^2. So the energy sent to the box goes as
    frames CNR, and the cost, times the area of the aperture, as

        frames CNR / IFOV^2.

    Pulses of any width carry the same energy. What a shorter one asks of detector and electronics
    is not counted, and neither is the imager, which sends nothing.

    Examples
    --------
    Half the IFOV, with an aperture twice as wide, costs as much as 6 dB:

    >>> from studies.operate import relative_cost
    >>> relative_cost([16, 16, 16], [32, 32, 38.0206], [150e-6, 75e-6, 150e-6]).round(3)
    array([1., 4., 4.])
    """
    frames = np.asarray(frame_count, dtype=np.float64)
    if not (frames >= 0).all():
        raise ValueError(f"frame_count is {frame_count!r}, but must be at least 0")
    level, side = require_all("cnr", cnr), require_all("ifov", ifov, positive=True)
    cost: NDArray[np.float64] = frames / FRAMES * 10 ** ((level - CNR) / 10) * (IFOV / side) ** 2
    return cost

"""A measured image as the proposed sensor would see it: pixels gathered into its wider beams."""

from __future__ import annotations

import numpy as np

from ncti.checks import require
from ncti.irar.flight import Flight
from ncti.irar.snapshot import Snapshot
from ncti.ladar import RangeExtent


def measured_extent(
    snapshot: Snapshot,
    flight: Flight,
    *,
    slant_range: float,
    ifov: float = 150e-6,
    bin_width: float = 1.0,
    window: float = 250.0,
) -> RangeExtent:
    """Range-extent fractions of a segmented image, for the range-profiling sensor's IFOVs.

    Parameters
    ----------
    snapshot : Snapshot
        Segmented.
    flight : Flight
        The pass that made it.
    slant_range : float
        From which the range-profiling sensor sees the ship [m].
    ifov : float
        Side of its instantaneous field of view [rad].
    bin_width : float
        Range bin [m].
    window : float
        Length of the range window [m], centred on the ship's origin.

    Returns
    -------
    RangeExtent
        Of the IFOVs that see some of the ship.

    Raises
    ------
    ValueError
        If a parameter is not positive, or the image shows nothing inside the window.

    Notes
    -----
    Article, 'Range Profiling': a pixel is a sub-pixel of the proposed sensor, and profiles of
    resolved, peak-detected images stand for those of its unresolved returns. A pixel's share of
    an IFOV is its area times its intensity over that of a flat target that fills it, at most its
    area: speckle takes some above that.
    """
    require("slant_range", slant_range, positive=True)
    require("ifov", ifov, positive=True)
    require("bin_width", bin_width, positive=True)
    require("window", window, positive=True)
    row, column = np.nonzero(np.isfinite(snapshot.range) & (snapshot.intensity > 0))
    down_range = snapshot.range[row, column] - flight.slant_range
    bins = round(window / bin_width)
    place = np.floor(down_range / bin_width + bins / 2).astype(np.intp)
    inside = (place >= 0) & (place < bins)
    if not inside.any():
        raise ValueError(
            f"window is {window:g} m, but must hold some of the ship that the image shows"
        )
    row, column, place = row[inside], column[inside], place[inside]
    side = ifov * slant_range
    cells = np.stack([snapshot.column[column], snapshot.row[row]], axis=1) * flight.pixel
    cell, which = np.unique(np.floor(cells / side).astype(np.int64), axis=0, return_inverse=True)
    spacing = [
        float(places[1] - places[0]) if len(places) > 1 else 1.0
        for places in (snapshot.row, snapshot.column)
    ]
    filled = np.minimum(snapshot.intensity[row, column] / flight.cnr, 1.0)
    area = filled * flight.pixel**2 * spacing[0] * spacing[1] / side**2
    fraction = np.zeros((len(cell), bins))
    np.add.at(fraction, (which.ravel(), place), area)
    centres = np.arange(-(bins - 1) / 2, bins / 2, dtype=np.float64) * bin_width
    return RangeExtent(fraction, centres, bin_width, cell, ifov, slant_range)

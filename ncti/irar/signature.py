"""Range extent of a measured image for the proposed sensor: pixels gathered into wider beams."""

from __future__ import annotations

import numpy as np

from ncti.checks import NothingSeenError, require
from ncti.irar.flight import Flight
from ncti.irar.snapshot import ShipPixels, Snapshot
from ncti.ladar import Beam, RangeExtent, bin_centres


def measured_extent(
    image: Snapshot | ShipPixels,
    flight: Flight,
    *,
    slant_range: float,
    ifov: float = Beam.ifov,
    bin_width: float = Beam.bin_width,
    window: float = Beam.window,
) -> RangeExtent:
    """Return range-extent fractions of a segmented image, for the range-profiling sensor's IFOVs.

    Parameters
    ----------
    image : Snapshot or ShipPixels
        Segmented image, or its pixels that show the ship.
    flight : Flight
        The pass that made it.
    slant_range : float
        Distance from the range-profiling sensor to the ship [m].
    ifov : float
        Side of that sensor's instantaneous field of view [rad].
    bin_width : float
        Range bin [m].
    window : float
        Length of the range window [m], centred on the ship's origin.

    Returns
    -------
    RangeExtent
        Fractions of the IFOVs that see part of the ship.

    Raises
    ------
    ValueError
        If a parameter is not positive.
    ncti.checks.NothingSeenError
        If the image shows nothing inside the window.

    See Also
    --------
    segmented : Make the segmented image.
    ncti.ladar.expected_profile : Range profile of the result.
    ncti.ladar.range_extent : The same for a ship's model.

    Notes
    -----
    A pixel of the image is a sub-pixel of the proposed sensor: profiles of resolved, peak-detected
    images represent those of its unresolved returns [1]_. A pixel's share of an IFOV is its area
    times its intensity over that of a flat target that fills it, at most its area, because speckle
    may exceed that intensity.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, 'Range Profiling'.

    Examples
    --------
    A box at 4 km as seen from 100 km, where six IFOVs of 15 m see part of it:

    >>> import numpy as np
    >>> import trimesh
    >>> from ncti.irar import correct, fly, segmented, ship_heading, ship_window
    >>> box = trimesh.creation.box((40, 10, 14)).apply_translation((0, 0, 7))
    >>> heading = ship_heading(aspect=180, sight=5)
    >>> flight = Flight(slant_range=4e3, ship_heading=heading, samples=60)
    >>> scan = fly(box, flight).noiseless()
    >>> image = segmented(correct(scan, window=ship_window(box, flight)), flight)
    >>> extent = measured_extent(image, flight, slant_range=100e3)
    >>> extent.fraction.shape
    (6, 250)
    """
    require("slant_range", slant_range, positive=True)
    require("ifov", ifov, positive=True)
    require("bin_width", bin_width, positive=True)
    require("window", window, positive=True)
    # Pixels of the ship and their range bins.
    pixels = image if isinstance(image, ShipPixels) else image.ship_pixels
    down_range = pixels.range - flight.slant_range
    centres = bin_centres(window, bin_width)
    bins = centres.size
    place = np.floor(down_range / bin_width + bins / 2).astype(np.intp)
    inside = (place >= 0) & (place < bins)
    if not inside.any():
        raise NothingSeenError(
            f"window is {window:g} m, but must contain part of the ship in the image"
        )
    # IFOVs of the range-profiling sensor to which the pixels belong.
    side = ifov * slant_range
    cells = np.stack([pixels.column[inside], pixels.row[inside]], axis=1) * flight.pixel
    cell, index = np.unique(np.floor(cells / side).astype(np.int64), axis=0, return_inverse=True)
    # Returning area of each pixel, as a fraction of such an IFOV.
    filled = np.minimum(pixels.intensity[inside] / flight.cnr, 1.0)
    area = filled * flight.pixel**2 * pixels.height * pixels.width / side**2
    fraction = np.zeros((len(cell), bins))
    np.add.at(fraction, (index.ravel(), place[inside]), area)
    return RangeExtent(fraction, centres, bin_width, cell, ifov, slant_range)

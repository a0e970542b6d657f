"""Line images of a given accuracy."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ncti.checks import require
from ncti.ladar.extent import estimated_error
from ncti.render.lines import LineImage, line_image, refined
from ncti.render.view import ROLL

if TYPE_CHECKING:
    import trimesh

FINEST = 1 / 64
"""Smallest distance between lines [m]: the error of ships is then some 0.003 %."""

FEWEST = 32
"""Lines across a ship below which odd and even lines may agree by chance."""

SPARE = 0.98
"""Part of the tolerance that is used. The estimate is made in the far field; at the range of the
sensor, wavefront curvature moves some of the extent, and of the estimate, into the next bin."""


def lines_within(
    mesh: trimesh.Trimesh,
    *,
    aspect: float,
    depression: float,
    tolerance: float,
    pulse_width: float,
    roll: float = ROLL,
    slant_range: float | None = None,
    bin_width: float = 1.0,
    spacing: float = 1.0,
) -> LineImage:
    """Return the coarsest line image whose range extent is accurate to a tolerance.

    Parameters
    ----------
    mesh, aspect, depression, roll, slant_range
        See `ncti.render.line_image`.
    tolerance : float
        Largest error of the summed range extent after the pulse, sum |p - q| / sum q.
    pulse_width : float
        Full width of pulse and matched filter at 1/e^2 of the intensity [s].
    bin_width : float
        Width of the range bins of the extent [m].
    spacing : float
        Distance between the lines tried first [m].

    Returns
    -------
    LineImage
        The spacing is halved until the estimated error is within the tolerance, or to 1/64 m at
        the smallest.

    Raises
    ------
    ValueError
        If a parameter is out of range.

    See Also
    --------
    ncti.render.line_image : Lines of a given spacing.
    RangeExtent.error_after : The error estimate.

    Notes
    -----
    Existing lines are kept when the spacing is halved; only those between them are added.

    Examples
    --------
    An error of 10 %, 1 % and 0.3 % in the profile of a destroyer takes lines 1 m, 0.5 m and
    0.25 m apart:

    >>> import ncti
    >>> from ncti.ladar import lines_within
    >>> ship = ncti.ships.load("duncan")
    >>> for tolerance in (0.1, 0.01, 0.003):
    ...     lines = lines_within(
    ...         ship, aspect=37, depression=3.84, tolerance=tolerance, pulse_width=30e-9
    ...     )
    ...     print(tolerance, lines.spacing)
    0.1 1.0
    0.01 0.5
    0.003 0.25
    """
    require("tolerance", tolerance, positive=True)
    require("pulse_width", pulse_width, positive=True)
    lines = line_image(
        mesh,
        aspect=aspect,
        depression=depression,
        spacing=spacing,
        roll=roll,
        slant_range=slant_range,
    )
    while lines.spacing > FINEST and not _within(lines, tolerance, pulse_width, bin_width):
        lines = refined(mesh, lines)
    return lines


def _within(lines: LineImage, tolerance: float, pulse_width: float, bin_width: float) -> bool:
    """Return True if the estimated error of the lines is within the tolerance."""
    if not len(lines.line) or np.ptp(lines.line) < FEWEST:
        return False
    # One IFOV that holds the whole ship: the error does not depend on the tiling.
    bins = math.ceil(float(np.abs(lines.down_range).max()) / bin_width)
    ((even, odd),) = lines.bin(
        side=1e9,
        shift=(0.5, 0.5),
        near=-bins * bin_width,
        bin_width=bin_width,
        bin_count=2 * bins,
    ).area
    error = estimated_error(even - odd, even + odd, pulse_width, bin_width=bin_width)
    return error <= SPARE * tolerance

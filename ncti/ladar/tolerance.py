"""As many lines as a tolerance takes, and no more."""

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
"""Distance between lines [m] that are not refined further: the error of ships is some 0.003 %."""

FEWEST = 32
"""Lines across a ship below which odd and even ones may agree by chance."""

SPARE = 0.98
"""Part of the tolerance that is used: at the range of the sensor, not known in the far field, the
wavefront moves some of the extent into the next bin, and the estimate with it."""


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
    """The fewest lines whose range extent is within a tolerance.

    Parameters
    ----------
    mesh, aspect, depression, roll, slant_range
        As of `ncti.render.line_image`.
    tolerance : float
        Largest error of the ship's range extent after the pulse, sum |p - q| / sum q.
    pulse_width : float
        Full width of pulse and matched filter at 1/e^2 of the intensity [s].
    bin_width : float
        Range bins of the extent [m].
    spacing : float
        Distance between the first lines [m].

    Returns
    -------
    LineImage
        The first of ever finer lines, each half as far apart, whose estimated error is within the
        tolerance, down to 1/64 m; the last of them if none is.

    Raises
    ------
    ValueError
        If a parameter is out of its range.

    Notes
    -----
    Lines that are there are kept; those between them are added. See `RangeExtent.error_after`
    for how the error is estimated.
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
    """Whether lines are known to err by no more than the tolerance."""
    if not len(lines.line) or np.ptp(lines.line) < FEWEST:
        return False
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

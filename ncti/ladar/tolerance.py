"""As many lines as a tolerance takes, and no more."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ncti.checks import require
from ncti.ladar.extent import estimated_error
from ncti.ladar.pulse import SPEED_OF_LIGHT, target_kernel
from ncti.render.lines import LineImage, line_image, refined
from ncti.render.view import ROLL

if TYPE_CHECKING:
    import trimesh

COARSEST = 1.0
"""Distance between the first lines [m]: their error is estimated well from there on."""

FINEST = 1 / 64
"""Distance between the last lines [m], whose error is some 0.003 %."""

SPARE = 0.98
"""Part of the tolerance that is used: the wavefront, at a range that is not known here, bends the
extent into other bins by a hair."""


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

    Returns
    -------
    LineImage
        The first of ever finer lines, 1, 1/2, 1/4 ... 1/64 m apart, whose estimated error is
        within the tolerance; the last of them if none is.

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
        spacing=COARSEST,
        roll=roll,
        slant_range=slant_range,
    )
    ends = np.abs(lines.down_range)
    if not ends.size:  # a ship so small that these lines miss it
        ends = np.linalg.norm(mesh.bounds, axis=1)
    reach = float(ends.max()) + SPEED_OF_LIGHT * pulse_width
    count = 2 * math.ceil(reach / bin_width)
    kernel = target_kernel(pulse_width=pulse_width, bin_width=bin_width, bin_count=count) ** 2
    while lines.spacing > FINEST:
        area = lines.bin(
            side=1e9,
            shift=(0.5, 0.5),
            near=-count / 2 * bin_width,
            bin_width=bin_width,
            bin_count=count,
        ).area.sum(axis=0)  # of one cell, or of none where all lines miss the ship
        if estimated_error(area[0] - area[1], area.sum(axis=0), kernel) <= SPARE * tolerance:
            break
        lines = refined(mesh, lines)
    return lines

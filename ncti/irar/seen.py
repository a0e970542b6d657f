"""What looks see of a scene's cells, and how that changes with where it lies: a compiled loop."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncti.compiled import compiled

Floats = NDArray[np.float64]


@compiled
def add_looks(
    image: Floats,
    slopes: Floats,
    cells: Floats,
    upward: Floats,
    rightward: Floats,
    near: NDArray[np.bool_],
    middle: Floats,
    factor: int,
    place: Floats,
    pixel: NDArray[np.intp],
    row: Floats,
    column: Floats,
    count: NDArray[np.intp],
) -> None:
    """Add what looks see to the pixels that average them.

    Parameters
    ----------
    image : (channel, pixel) float64 ndarray
        Means over the looks of a pixel; added to.
    slopes : (channel, pixel, 6) float64 ndarray
        How they change with `place`; added to.
    cells, upward, rightward : (channel, row, column) float64 ndarray
        Brightness of the cells, 0 at the border, and its change by a cell, up and to the right.
    near : (row, column) bool ndarray
        Cells that are or adjoin the ship: of others nothing is seen.
    middle : (2,) float64 ndarray
        Row and column of the scene's middle [cell].
    factor : int
        Cells to a pixel, either way.
    place : (6,) float64 ndarray
        Where the scene lies: up, right, mast, waterline, height, width, as of `tilt.tilts`.
    pixel : (look,) intp ndarray
        Pixel that averages a look.
    row, column : (look,) float64 ndarray
        Where a look falls, from the middle of the image [pixel].
    count : (pixel,) intp ndarray
        Looks of each pixel.
    """
    last_row, last_column = cells.shape[1] - 2.0, cells.shape[2] - 2.0
    up, right, mast, waterline, height, width = place
    for i in range(len(pixel)):
        y, x = row[i], column[i]
        at_row = factor * (up + height * y + waterline * x) + middle[0]
        at_column = factor * (right + mast * y + width * x) + middle[1]
        at_row = min(max(at_row, 0.0), last_row)
        at_column = min(max(at_column, 0.0), last_column)
        r, c = int(at_row), int(at_column)
        if not near[r, c]:
            continue
        beyond_row, beyond_column = at_row - r, at_column - c
        nearest_row, nearest_column = int(np.rint(at_row)), int(np.rint(at_column))
        p = pixel[i]
        share = 1.0 / count[p]
        for k in range(len(cells)):
            low = cells[k, r, c] + beyond_column * (cells[k, r, c + 1] - cells[k, r, c])
            high = cells[k, r + 1, c] + beyond_column * (
                cells[k, r + 1, c + 1] - cells[k, r + 1, c]
            )
            image[k, p] += (low + beyond_row * (high - low)) * share
            d_up = upward[k, nearest_row, nearest_column] * factor * share
            d_right = rightward[k, nearest_row, nearest_column] * factor * share
            slopes[k, p, 0] += d_up
            slopes[k, p, 1] += d_right
            slopes[k, p, 2] += d_right * y
            slopes[k, p, 3] += d_up * x
            slopes[k, p, 4] += d_up * y
            slopes[k, p, 5] += d_right * x

"""Counts and draws by pixel, as compiled loops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ncti.compiled import compiled

Floats = NDArray[np.float64]
Box = tuple[int, int, int, int]  # first row, one past the last, first column, one past the last


@compiled
def count_points(
    horizontal: Floats,
    vertical: Floats,
    scale: float,
    phase: tuple[float, float],
    cells: float,
    first: tuple[int, int],
    counts: Floats,
) -> None:
    """Add 1 to the cell of each point; rounding may put one a hair outside, which stays inside.

    Parameters
    ----------
    horizontal, vertical : (point,) float64 ndarray
        Cross-range [m].
    scale : float
        Pixels a metre.
    phase : (float, float)
        Where in a pixel the origin lies, right and up [pixel].
    cells : float
        Cells along each side of a pixel.
    first : (int, int)
        Column and row of cell [0, 0], counted from the origin's pixel.
    counts : (row, col) float64 ndarray
        Added to.
    """
    rows, columns = counts.shape
    column, row = np.empty(horizontal.size, np.int32), np.empty(horizontal.size, np.int32)
    # Cells of all points at once, then the counts, by runs of points in one cell.
    left, bottom = float(first[0]), float(first[1])
    for i in range(horizontal.size):
        column[i] = np.int32(np.floor((horizontal[i] * scale + phase[0]) * cells) - left)
    for i in range(vertical.size):
        row[i] = np.int32(np.floor((vertical[i] * scale + phase[1]) * cells) - bottom)
    begin = 0
    for i in range(1, horizontal.size + 1):
        if i == horizontal.size or column[i] != column[begin] or row[i] != row[begin]:
            up = min(max(row[begin], 0), rows - 1)
            along = min(max(column[begin], 0), columns - 1)
            counts[up, along] += i - begin
            begin = i


@compiled
def places_of_bits(
    bits: NDArray[np.uint8],
    columns: int,
    pixel: float,
    corner: tuple[float, float],
    turn: tuple[float, float],
) -> tuple[Floats, Floats]:
    """Return where the set bits of an image lie, (point,) across and up, row by row.

    Parameters
    ----------
    bits : (byte,) uint8 ndarray
        Pixels in the order of rows, the first in the highest bit.
    columns : int
        Pixels a row.
    pixel, corner : float, (float, float)
        As `ncti.render.image.Lattice` has pixel and origin [m].
    turn : (float, float)
        Cosine and sine of its roll.
    """
    many = 0
    for byte in bits:
        while byte:
            byte &= byte - 1
            many += 1
    horizontal, vertical = np.empty(many), np.empty(many)
    cos, sin = turn
    found, row, ended = 0, 0, columns
    for i in range(bits.size):
        if bits[i]:
            for k in range(8):
                if bits[i] & (128 >> k):
                    place = 8 * i + k
                    while place >= ended:
                        row, ended = row + 1, ended + columns
                    along = corner[0] + pixel * (place - ended + columns)
                    up = corner[1] + pixel * row
                    horizontal[found] = along * cos - up * sin
                    vertical[found] = along * sin + up * cos
                    found += 1
    return horizontal, vertical


@compiled
def bounding_box(target: NDArray[np.bool_]) -> Box:
    """Return the rows and columns that hold what is true; (0, 0, 0, 0) where nothing is."""
    rows, columns = target.shape
    top, bottom, left, right = rows, 0, columns, 0
    for row in range(rows):
        for column in range(columns):
            if target[row, column]:
                top, bottom = min(top, row), max(bottom, row + 1)
                left, right = min(left, column), max(right, column + 1)
    return (top, bottom, left, right) if bottom else (0, 0, 0, 0)


@compiled
def lay_out(
    box: Floats, corner: tuple[int, int], window: Floats, rim: Floats, width: int, out: Floats
) -> None:
    """Lay normals drawn for the ship, its window and the window's rim where they belong.

    Parameters
    ----------
    box : (draw, row, col) float64 ndarray
        Those about the ship.
    corner : (int, int)
        Row and column of its first in `out`; parts of it may lie outside.
    window, rim : (draw, place) float64 ndarray
        Those of the window, and of the rim, outside the box, row by row.
    width : int
        Pixels of rim.
    out : (draw, row, col) float64 ndarray
        Filled.
    """
    draws, rows, columns = out.shape
    for draw in range(draws):
        of_window, of_rim = 0, 0
        for row in range(rows):
            up = row - corner[0]
            for column in range(columns):
                along = column - corner[1]
                if 0 <= up < box.shape[1] and 0 <= along < box.shape[2]:
                    out[draw, row, column] = box[draw, up, along]
                elif width <= row < rows - width and width <= column < columns - width:
                    out[draw, row, column] = window[draw, of_window]
                    of_window += 1
                else:
                    out[draw, row, column] = rim[draw, of_rim]
                    of_rim += 1

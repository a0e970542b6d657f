"""Compiled loops over the pixels of infrared images."""

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
    """Add the number of points in each cell to `counts` (row, col).

    `horizontal` and `vertical` (point,) are cross-ranges [m]; `scale` is in pixels per metre;
    `phase` is the position of the origin in its pixel, right and up; `cells` is their number
    along each side of a pixel; `first` is column and row of cell [0, 0], counted from the origin's
    pixel. A point that rounding puts outside counts in the nearest cell.
    """
    rows, columns = counts.shape
    column, row = np.empty(horizontal.size, np.int32), np.empty(horizontal.size, np.int32)
    # Cells of all points first, in loops that can be vector instructions.
    left, bottom = float(first[0]), float(first[1])
    for i in range(horizontal.size):
        column[i] = np.int32(np.floor((horizontal[i] * scale + phase[0]) * cells) - left)
    for i in range(vertical.size):
        row[i] = np.int32(np.floor((vertical[i] * scale + phase[1]) * cells) - bottom)
    # Then the counts, by runs of points in one cell.
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
    """Return the positions (point,) across and up [m] of an image's set bits, row by row.

    `bits` (byte,) are pixels in the order of rows, the first in the highest bit; `pixel` [m] and
    `corner` are pixel and origin of `ncti.render.RangeImage`, `turn` cosine and sine of its
    roll.
    """
    # Count the set bits, to allocate the result.
    count = 0
    for byte in bits:
        while byte:
            byte &= byte - 1
            count += 1
    horizontal, vertical = np.empty(count), np.empty(count)
    cos, sin = turn
    # Place of each set bit: row and column, then the lattice's roll.
    number, row, ended = 0, 0, columns
    for place in range(8 * bits.size):
        if bits[place >> 3] & (128 >> (place & 7)):
            while place >= ended:
                row, ended = row + 1, ended + columns
            along = corner[0] + pixel * (place - ended + columns)
            up = corner[1] + pixel * row
            horizontal[number] = along * cos - up * sin
            vertical[number] = along * sin + up * cos
            number += 1
    return horizontal, vertical


@compiled
def bounding_box(target: NDArray[np.bool_]) -> Box:
    """Return the rows and columns that contain all true pixels; (0, 0, 0, 0) if there are none."""
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
    """Arrange normals of the ship's box, the window and its rim into images `out` (draw, row, col).

    `box` (draw, row, col) has its first pixel at row and column `corner` of `out`, and may reach
    beyond it; `window` and `rim` (draw, place) are for pixels outside the box, row by row; the rim
    is `width` pixels wide.
    """
    draws, rows, columns = out.shape
    # Each pixel takes the next normal of the region it is in: ship's box, window or rim.
    for draw in range(draws):
        window_number, rim_number = 0, 0
        for row in range(rows):
            up = row - corner[0]
            for column in range(columns):
                along = column - corner[1]
                if 0 <= up < box.shape[1] and 0 <= along < box.shape[2]:
                    out[draw, row, column] = box[draw, up, along]
                elif width <= row < rows - width and width <= column < columns - width:
                    out[draw, row, column] = window[draw, window_number]
                    window_number += 1
                else:
                    out[draw, row, column] = rim[draw, rim_number]
                    rim_number += 1

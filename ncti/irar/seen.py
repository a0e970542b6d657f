"""Images of a truth sampled by looks, and their derivatives by its place."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.compiled import compiled

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Looks:
    """Looks averaged by pixels: flat pixel, and place relative to the image's centre [pixel]."""

    pixel: NDArray[np.intp]
    row: Floats
    column: Floats
    count: NDArray[np.intp]
    shape: tuple[int, ...]

    @classmethod
    def of(cls, places: tuple[ArrayLike, ArrayLike], shape: tuple[int, ...]) -> Looks:
        """Return the looks at `places` within an image of `shape`."""
        row, column = (np.asarray(values, dtype=np.float64) for values in places)
        if row.shape != column.shape:
            raise ValueError(
                f"places has rows of shape {row.shape} and columns of shape {column.shape}, but "
                "must have as many of both"
            )
        rows, columns = shape
        inside = (row >= -0.5) & (row < rows - 0.5) & (column >= -0.5) & (column < columns - 0.5)
        row, column = row[inside], column[inside]
        pixel = np.floor(row + 0.5).astype(np.intp) * columns + np.floor(column + 0.5).astype(
            np.intp
        )
        return cls(
            pixel,
            row - (rows - 1) / 2,
            column - (columns - 1) / 2,
            np.bincount(pixel, minlength=rows * columns),
            shape,
        )

    def block(self, rows: slice, columns: slice) -> Looks:
        """Return the looks of a block of pixels, with places relative to the whole image."""
        number = np.full(self.shape, -1)
        shape = number[rows, columns].shape
        number[rows, columns] = np.arange(math.prod(shape)).reshape(shape)
        pixel = number.ravel()[self.pixel]
        inside = pixel >= 0
        count = self.count.reshape(self.shape)[rows, columns].ravel()
        return Looks(pixel[inside], self.row[inside], self.column[inside], count, shape)


class Truth:
    """Channels of a truth, and their images by looks."""

    def __init__(self, cells: Floats, factor: int) -> None:
        """Prepare cells (channel, row, column), `factor` per pixel along each axis."""
        self.factor = factor
        # Crop to the ship, with a border so wide that looks outside it see no slope.
        border = 5
        lit = [np.flatnonzero(cells.any(axis=(0, axis))) for axis in (2, 1)]
        first = np.array([line[0] for line in lit])
        self.middle = (np.array(cells.shape[1:]) - 1) / 2 - first + border
        ship = cells[:, *(slice(line[0], line[-1] + 1) for line in lit)]
        self.rows, self.columns = (cells / factor for cells in ship.shape[1:])
        bordered = np.pad(ship, ((0, 0), (border, border), (border, border)))
        self.cells = bordered
        self.upward, self.rightward = map(np.ascontiguousarray, np.gradient(bordered, axis=(1, 2)))
        from scipy.ndimage import binary_dilation

        self.near = binary_dilation((bordered != 0).any(axis=0), iterations=2)

    def image(self, place: Floats, looks: Looks) -> tuple[Floats, Floats]:
        """Return the image (channel, row, column) at a place, and its derivatives by the place.

        Derivatives have a last axis of 6, the parameters of the place in the order of
        `tilt_fit.START`.
        """
        image = np.zeros((len(self.cells), looks.count.size))
        slopes = np.zeros((*image.shape, 6))
        add_looks(
            (image, slopes),
            (self.cells, self.upward, self.rightward, self.near),
            (self.middle[0], self.middle[1], self.factor),
            place,
            (looks.pixel, looks.row, looks.column, looks.count),
        )
        shape = len(image), *looks.shape
        return image.reshape(shape), slopes.reshape(*shape, 6)


@compiled
def add_looks(
    means: tuple[Floats, Floats],
    truth: tuple[Floats, Floats, Floats, NDArray[np.bool_]],
    scale: tuple[float, float, int],
    place: Floats,
    looks: tuple[NDArray[np.intp], Floats, Floats, NDArray[np.intp]],
) -> None:
    """Add the brightness of looks to the pixels that average them.

    `means` are images (channel, pixel) and derivatives by `place` (channel, pixel, 6). `truth` are
    three (channel, row, column) arrays, brightness of the cells, 0 at the border, and its
    change per cell up and to the right, and a (row, column) mask of cells of or next to the ship.
    `scale` is row and column of the truth's centre [cell], and cells per pixel. `place` (6,) is up,
    right, mast, waterline, height, width, as in `tilt.tilts`. `looks` are (look,) pixel, row and
    column from the image's centre [pixel], and the (pixel,) number of looks.
    """
    (image, slopes), (cells, upward, rightward, near) = means, truth
    (middle_row, middle_column, factor), (pixel, row, column, count) = scale, looks
    last_row, last_column = cells.shape[1] - 2.0, cells.shape[2] - 2.0
    up, right, mast, waterline, height, width = place
    for i in range(len(pixel)):
        # Place of the look in the truth, within its border.
        y, x = row[i], column[i]
        truth_row = factor * (up + height * y + waterline * x) + middle_row
        truth_column = factor * (right + mast * y + width * x) + middle_column
        truth_row = min(max(truth_row, 0.0), last_row)
        truth_column = min(max(truth_column, 0.0), last_column)
        r, c = int(truth_row), int(truth_column)
        if not near[r, c]:
            continue
        # Brightness by bilinear interpolation, slopes from the nearest cell.
        row_fraction, column_fraction = truth_row - r, truth_column - c
        nearest_row, nearest_column = int(np.rint(truth_row)), int(np.rint(truth_column))
        p = pixel[i]
        share = 1.0 / count[p]
        for k in range(len(cells)):
            low = cells[k, r, c] + column_fraction * (cells[k, r, c + 1] - cells[k, r, c])
            high = cells[k, r + 1, c] + column_fraction * (
                cells[k, r + 1, c + 1] - cells[k, r + 1, c]
            )
            image[k, p] += (low + row_fraction * (high - low)) * share
            d_up = upward[k, nearest_row, nearest_column] * factor * share
            d_right = rightward[k, nearest_row, nearest_column] * factor * share
            slopes[k, p, 0] += d_up
            slopes[k, p, 1] += d_right
            slopes[k, p, 2] += d_right * y
            slopes[k, p, 3] += d_up * x
            slopes[k, p, 4] += d_up * y
            slopes[k, p, 5] += d_right * x

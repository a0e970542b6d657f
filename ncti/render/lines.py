"""Views of ships along parallel lines: the visible pieces, and their area by cell and bin."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ncti.render.view import View, cos_sin

if TYPE_CHECKING:
    from ncti.render.pieces import Parts

Floats = NDArray[np.float64]

STRANDS = 16
"""Strands of a view, each of every sixteenth line, from which its error is estimated."""


@dataclass(frozen=True, eq=False)
class LineImage:
    """View of a ship along parallel lines, exact along each line.

    Lines run along the columns' axis of the view, which is rolled about the line of sight. Each
    stands for a strip as wide as their spacing. A piece is a part of a line along which one flat
    surface is seen, and over which range is linear in the far field.

    Attributes
    ----------
    line : (piece,) int32 ndarray
        Number k of a piece's line, ascending: the line is at (k + phase) spacing.
    piece : (piece, 4) float64 ndarray
        Begin and end along the line, and q there [m]: the down-range coordinate r over
        1 + r / slant range, which is linear along the piece; r itself in the far field.
    surface : (piece,) int32 ndarray
        Flat surface of the ship that is seen.
    normal : (surface, 3) float64 ndarray
        Outward unit normals in the ship frame; zero where there is no area.
    spacing : float
        Distance between lines, at the range of the ship origin [m].
    phase : float
        Place of the line number 0 above the line of sight through the ship origin [spacing].
    aspect, depression, roll : float
        View angles [deg].
    slant_range : float or None
        Distance from the sensor to the ship origin [m]; None in the far field.

    See Also
    --------
    line_image : Draws one.
    refined : Draws the lines between.
    RangeImage : The same by pixels.
    ncti.ladar.range_extent, ncti.infrared.silhouette : What sensors resolve of it.

    Examples
    --------
    >>> import trimesh
    >>> from ncti.render import line_image
    >>> box = trimesh.creation.box((40.0, 8.0, 6.0))
    >>> lines = line_image(box, aspect=0, depression=0, roll=0)
    >>> lines.spacing, float(lines.down_range.min())
    (0.25, -20.0)
    """

    line: NDArray[np.int32]
    piece: Floats
    surface: NDArray[np.int32]
    normal: Floats
    spacing: float
    phase: float
    aspect: float
    depression: float
    roll: float
    slant_range: float | None = None

    @property
    def resolution(self) -> float:
        """Spacing [m], the least width of an IFOV."""
        return self.spacing

    @property
    def count(self) -> int:
        """Number of lines from the first to the last that sees the ship."""
        return int(self.line[-1]) - int(self.line[0]) + 1 if self.line.size else 0

    @property
    def area(self) -> Floats:
        """(piece,) float64 ndarray: area that each piece stands for [m^2]."""
        return self.spacing * (self.piece[:, 1] - self.piece[:, 0])

    @property
    def curvature(self) -> float:
        """Curvature of the wavefront at the ship, 1 / slant range [1/m], 0 in the far field."""
        return 0.0 if self.slant_range is None else 1.0 / self.slant_range

    @property
    def down_range(self) -> Floats:
        """(piece, 2) float64 ndarray: down-range where pieces begin and end [m], as of an image."""
        q, k = self.piece[:, 2:], self.curvature
        w = 1.0 / (1.0 - k * q)
        square = self.piece[:, :2] ** 2 + (self._line_position**2)[:, None]
        return q * w + k * w * square / (1.0 + np.sqrt(1.0 + k**2 * square))

    @property
    def cosine(self) -> Floats:
        """(piece,) float64 ndarray: cosine of incidence in the middle of each piece."""
        n = self.normal[self.surface] @ View(self.aspect, self.depression, self.roll).axes.T
        x, y, k = self.piece[:, :2].mean(axis=1), self._line_position, self.curvature
        sight = np.sqrt(1.0 + k**2 * (x**2 + y**2))
        return np.maximum(-(n[:, 2] + k * (n[:, 0] * x + n[:, 1] * y)) / sight, 0.0)

    @property
    def _line_position(self) -> Floats:
        """(piece,) float64 ndarray: place of the piece's line along the rows' axis [m]."""
        return np.asarray(self.line + self.phase, dtype=np.float64) * self.spacing

    def cross_range(self) -> tuple[Floats, Floats]:
        """Return horizontal and vertical coordinates [m] of the ends of pieces, (piece, 2)."""
        y = self._line_position[:, None]
        cos, sin = cos_sin(self.roll)
        return self.piece[:, :2] * cos - y * sin, self.piece[:, :2] * sin + y * cos

    @cached_property
    def bounds(self) -> tuple[Floats, Floats]:
        """Least and greatest horizontal, and vertical, coordinate of pieces [m]; empty for none."""
        if not self.line.size:
            return np.zeros(0), np.zeros(0)
        from ncti.render.pieces import bounds_of

        left, right, bottom, top = bounds_of(
            self.line, self.piece, self.spacing, self.phase, cos_sin(self.roll), (0.0, 0.0)
        )
        return np.array([left, right]), np.array([bottom, top])

    def bin(
        self,
        *,
        side: float,
        shift: tuple[float, float] = (0.0, 0.0),
        slant_range: float | None = None,
        near: float = 0.0,
        bin_width: float = np.inf,
        bin_count: int = 1,
        weight: Floats | None = None,
    ) -> Parts:
        """Return the area that the ship fills of each square cell and range bin.

        Parameters
        ----------
        side : float
            Side of a cell [m].
        shift : (float, float)
            Place of the ship origin in a cell, right and up from its corner [cell].
        slant_range : float, optional
            Range whose wavefront curves down-range [m]; that of the view when not given.
        near : float
            Down-range at which the first bin begins [m].
        bin_width : float
            Width of a bin [m].
        bin_count : int
            Number of bins.
        weight : (piece,) float64 ndarray, optional
            Factors of the areas of pieces.

        Returns
        -------
        Parts
            Area of the cells that see the ship.

        Notes
        -----
        Exact along lines: a piece is cut at the borders of cells, and where it passes from a bin
        to the next. Plane waves cut it evenly; spheres about the sensor, where a wavefront bends,
        at the roots of a quadratic equation.
        """
        from ncti.render.pieces import Depths, Grid, Parts, bin_pieces

        reach = slant_range or self.slant_range
        wavefront = 1.0 / reach if reach and np.isfinite(bin_width) else 0.0
        area = np.full(len(self.line), self.spacing)
        if weight is not None:
            area = area * weight
        grid = Grid(cos_sin(self.roll), float(side), (float(shift[0]), float(shift[1])))
        depths = Depths(self.curvature, wavefront, float(near), float(bin_width), int(bin_count))
        return Parts(
            *bin_pieces(self.line, self.piece, area, self.spacing, self.phase, grid, depths)
        )

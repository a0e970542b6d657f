"""Compact view of a ship across the line of sight, and the detector's pixels that it fills."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.infrared.silhouette import Extent, Silhouette, coverage_of, silhouette
from ncti.render.image import RangeImage
from ncti.render.lines import LineImage
from ncti.render.view import cos_sin

if TYPE_CHECKING:
    from ncti.render.mask import Mask

Floats = NDArray[np.float64]

MARGIN = 4
"""Pixels of sea around a ship."""


@dataclass(frozen=True, eq=False)
class Hits:
    """Part of a view that shows a ship, without its depth: pixels as bits, or pieces of lines.

    All attributes are arrays and numbers, so that `vars` of it can be stored in a file.

    Attributes
    ----------
    bits : (byte,) uint8 ndarray
        Pixels in the order of rows, the first in the highest bit; none of lines.
    columns : int
        Pixels of a row; 0 of lines.
    lattice : (4,) float64 ndarray
        For pixels: pixel, origin across and up [m], and roll [deg]. For lines: spacing [m], 0,
        phase [spacing] and roll [deg].
    line : (piece,) int32 ndarray
        Index of each piece's line; empty for pixels.
    span : (piece, 2) float64 ndarray
        Begin and end along the line [m].

    See Also
    --------
    silhouette : Coverage of a detector's pixels by a view.

    Examples
    --------
    >>> import trimesh
    >>> from ncti.infrared import Hits
    >>> from ncti.render import line_image
    >>> box = trimesh.creation.box((40.0, 8.0, 6.0))
    >>> hits = Hits.of(line_image(box, aspect=90, depression=0))
    >>> print(hits.patches().covering(15.0, (0.5, 0.5)).coverage.sum().round(3))
    1.067
    """

    bits: NDArray[np.uint8]
    columns: int
    lattice: Floats
    line: NDArray[np.int32]
    span: Floats

    @classmethod
    def of(cls, image: RangeImage | LineImage | Mask) -> Hits:
        """Return the hits of a range image, of lines or of a mask."""
        if isinstance(image, LineImage):
            lattice = np.array([image.spacing, 0.0, image.phase, image.roll])
            return cls(np.zeros(0, np.uint8), 0, lattice, image.line, image.piece[:, :2])
        lattice = np.array([image.pixel, *image.origin, image.roll])
        bits, columns = np.packbits(image.hit), image.hit.shape[1]
        return cls(bits, columns, lattice, np.zeros(0, np.int32), np.zeros((0, 2)))

    def patches(self, *, mirrored: bool = False) -> Patches:
        """Return the patches of the ship, optionally with left and right swapped."""
        pixel, left, bottom, roll = self.lattice.tolist()
        if not self.columns:
            line, span = self.line, self.span
            if mirrored:
                span, roll = -span[:, ::-1], -roll
                order = np.lexsort((span[:, 0], line))  # pieces of a line are in order
                line, span = line[order], span[order]
            # Only the place across the line of sight counts.
            flat = np.concatenate([span, np.zeros_like(span)], axis=1), np.zeros_like(line)
            lines = LineImage(line, *flat, np.zeros((1, 3)), pixel, bottom, 0.0, 0.0, roll)
            return Patches(*lines.bounds, pixel**2, lines)
        from ncti.infrared.cells import places_of_bits

        lattice = pixel, (left, bottom), cos_sin(roll)
        horizontal, vertical = places_of_bits(self.bits, self.columns, *lattice)
        return Patches(-horizontal if mirrored else horizontal, vertical, pixel**2)


@dataclass(frozen=True, eq=False)
class Patches:
    """Patches of a ship: (point,) cross-ranges [m], and the area of one [m^2].

    For `lines`, points are the corners of their bounding box.
    """

    horizontal: Floats
    vertical: Floats
    area: float
    lines: LineImage | None = None

    @cached_property
    def extent(self) -> Extent:
        """The bounding box, for windows of one shape at all places on the detector."""
        (left, right), (bottom, top) = (
            (float(line.min()), float(line.max())) for line in (self.horizontal, self.vertical)
        )
        return left, right, bottom, top

    def covering(
        self, footprint: float, place: tuple[float, float], *, subdivision: int = 1
    ) -> Silhouette:
        """Return the coverage of detector pixels with a footprint [m], or of their subdivisions.

        `place` is the ship origin's position in its pixel, right and up from the corner [pixel].
        """
        window: dict[str, Any] = {"footprint": footprint, "phase": place, "margin": MARGIN}
        window |= {"extent": self.extent, "subdivision": subdivision}
        if self.lines is not None:
            return silhouette(self.lines, **window)
        return coverage_of(self.horizontal, self.vertical, area=self.area, **window)

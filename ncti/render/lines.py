"""Views of ships that are exact along parallel lines, without pixels, rays or OpenGL."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require
from ncti.render.surfaces import Surfaces
from ncti.render.threads import swept
from ncti.render.view import ROLL, View

if TYPE_CHECKING:
    import trimesh
    import xarray as xr

    from ncti.render.pieces import Parts

Floats = NDArray[np.float64]

PHASE = 21845 / 2**16
"""Place of the lines from the line of sight through the ship origin [spacing]: a third, since hulls
seen from the bow are mirrored about that line and lines should not be; of sixteen binary digits, so
that lines refined by halving lie where finer lines do, to the bit."""

MAX_LINES = 2**20
"""Most lines of a view: more would be a spacing given in other units."""


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
    refined : Halves the spacing.
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
        square = self.piece[:, :2] ** 2 + (self._height**2)[:, None]
        down_range: Floats = q * w + k * w * square / (1.0 + np.sqrt(1.0 + k**2 * square))
        return down_range

    @property
    def cosine(self) -> Floats:
        """(piece,) float64 ndarray: cosine of incidence in the middle of each piece."""
        n = self.normal[self.surface] @ View(self.aspect, self.depression, self.roll).axes.T
        x, y, k = self.piece[:, :2].mean(axis=1), self._height, self.curvature
        sight = np.sqrt(1.0 + k**2 * (x**2 + y**2))
        cosine: Floats = np.maximum(-(n[:, 2] + k * (n[:, 0] * x + n[:, 1] * y)) / sight, 0.0)
        return cosine

    @property
    def _height(self) -> Floats:
        """(piece,): place of the piece's line along the rows' axis [m]."""
        return np.asarray(self.line + self.phase, dtype=np.float64) * self.spacing

    def cross_range(self) -> tuple[Floats, Floats]:
        """Return horizontal and vertical coordinates [m] of the ends of pieces, (piece, 2)."""
        y = self._height[:, None]
        cos, sin = np.cos(np.radians(self.roll)), np.sin(np.radians(self.roll))
        return self.piece[:, :2] * cos - y * sin, self.piece[:, :2] * sin + y * cos

    @cached_property
    def bounds(self) -> tuple[Floats, Floats]:
        """Least and greatest horizontal, and vertical, coordinate of pieces [m]; empty of none."""
        if not self.line.size:
            return np.zeros(0), np.zeros(0)
        horizontal, vertical = (np.array([ends.min(), ends.max()]) for ends in self.cross_range())
        return horizontal, vertical

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
        Exact along lines: a piece is cut at the borders of cells, and covers the ranges between
        its ends evenly. Where wavefront or perspective bend it, chords stay within 1/50 of a bin.
        """
        from ncti.render.pieces import Parts, bin_pieces  # numba takes long to import

        reach = slant_range or self.slant_range
        curved = bool(reach) and np.isfinite(bin_width)
        area = np.full(len(self.line), self.spacing)
        return Parts(
            *bin_pieces(
                self.line,
                self.piece,
                area if weight is None else area * weight,
                self.spacing,
                self.phase,
                (np.cos(np.radians(self.roll)), np.sin(np.radians(self.roll))),
                float(side),
                (float(shift[0]), float(shift[1])),
                self.curvature,
                1.0 / reach if reach and curved else 0.0,
                np.sqrt(50 / (8 * reach * bin_width)) if reach and curved else 0.0,
                float(near),
                float(bin_width),
                int(bin_count),
            )
        )

    def to_xarray(self) -> xr.Dataset:
        """Return the pieces as an xarray data set with units."""
        import xarray as xr

        horizontal, vertical = self.cross_range()
        ends, metre = ("piece", "end"), {"units": "m"}
        return xr.Dataset(
            {
                "down_range": (ends, self.down_range, metre | {"long_name": "down-range"}),
                "area": ("piece", self.area, {"units": "m2", "long_name": "area it stands for"}),
            },
            coords={
                "line": ("piece", self.line, {"units": "1", "long_name": "number of the line"}),
                "surface": ("piece", self.surface, {"units": "1", "long_name": "surface seen"}),
                "horizontal": (ends, horizontal, metre | {"long_name": "horizontal cross-range"}),
                "vertical": (ends, vertical, metre | {"long_name": "vertical cross-range"}),
            },
            attrs={
                "aspect_deg": self.aspect,
                "depression_deg": self.depression,
                "roll_deg": self.roll,
                "spacing_m": self.spacing,
                "slant_range_m": np.inf if self.slant_range is None else self.slant_range,
            },
        )


def line_image(
    mesh: trimesh.Trimesh,
    *,
    aspect: float,
    depression: float,
    spacing: float = 0.25,
    roll: float = ROLL,
    slant_range: float | None = None,
    phase: float = PHASE,
) -> LineImage:
    """Return the view of a ship along parallel lines, exact along each line.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        Closed mesh with outward facets, in the ship frame [m]. Solids may run through one another,
        vertices may be unmerged, and facets may be missing or without area.
    aspect : float
        Bearing of the sensor from the ship [deg], 0 at the bow, growing to port.
    depression : float
        Angle of the line of sight below the horizontal [deg], 0 to 90.
    spacing : float
        Distance between lines, at the range of the ship origin [m].
    roll : float
        Rotation of the lines about the line of sight [deg].
    slant_range : float, optional
        Distance from the sensor to the ship origin [m]; the far field when not given. Perspective
        and the curvature of the wavefront are exact.
    phase : float
        Place of the lines, from the line of sight through the ship origin [spacing], -2 to 2.

    Returns
    -------
    LineImage
        Its area is the ship's visible projected area, up to the distance of the lines.

    Raises
    ------
    ValueError
        If a parameter is out of its range, or the mesh is empty or not finite.

    See Also
    --------
    refined : The same view by lines half as far apart.
    range_image : The same view by pixels.
    ncti.ladar.lines_within : Lines as fine as an accuracy needs.
    ncti.ladar.range_extent : The share of each range bin, and its error.

    Notes
    -----
    Lines sample a view exactly in one direction [1]_, [2]_, [3]_. The remaining error is that of
    the integral across the lines, by the rectangle rule. It falls with the spacing to the power
    1.6. Ship edges that are parallel to a line would make it larger, so lines are rolled (see
    `ncti.render.view.ROLL`).

    Coplanar facets count as one surface (`ncti.render.surfaces.Surfaces`), so a line crosses few
    edges. Threads share the lines, as many as OMP_NUM_THREADS says or the process has processors;
    the result does not depend on their number.

    References
    ----------
    .. [1] N. Max, "Antialiasing scan-line data", IEEE Computer Graphics and Applications 10(1),
       1990.
    .. [2] T. R. Jones and R. N. Perry, "Antialiasing with line samples", Rendering Techniques,
       2000, doi:10.1007/978-3-7091-6303-0_18.
    .. [3] T. Auzinger, M. Wimmer and S. Jeschke, "Non-sampled anti-aliasing", Vision, Modeling and
       Visualization, 2013.

    Examples
    --------
    The side of a box 40 m long and 6 m high:

    >>> import trimesh
    >>> from ncti.render import line_image
    >>> box = trimesh.creation.box((40.0, 8.0, 6.0))
    >>> lines = line_image(box, aspect=90, depression=0, spacing=0.25)
    >>> round(float(lines.area.sum()), 1)
    240.0
    """
    from ncti.render.line_sweep import cross, face, project

    require("spacing", spacing, positive=True)
    require("phase", phase, minimum=-2.0, maximum=2.0)
    view = View.checked(aspect=aspect, depression=depression, roll=roll, slant_range=slant_range)
    surfaces = Surfaces.of(mesh)
    axes = view.axes
    point, bounds = project(surfaces.vertices, axes, axes @ surfaces.centre, view.curvature)
    _check(bounds, view, spacing, surfaces)
    seen = face(surfaces.area, surfaces.moment, -axes[2], view.curvature)
    first, *crossings = cross(point, bounds, surfaces.edge, seen, float(spacing), float(phase))
    line, piece, surface = swept(crossings, surfaces=len(surfaces.area))
    return LineImage(
        line + first,
        piece,
        surface,
        surfaces.normals,
        spacing=float(spacing),
        phase=float(phase),
        aspect=view.aspect,
        depression=view.depression,
        roll=view.roll,
        slant_range=view.slant_range,
    )


def refined(mesh: trimesh.Trimesh, lines: LineImage) -> LineImage:
    """Return a view by lines half as far apart: the given lines, and new ones between them.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        Ship of the view.
    lines : LineImage
        View of it.

    Returns
    -------
    LineImage
        As `line_image` of half the spacing with twice the phase, at half the cost.

    See Also
    --------
    line_image : The first lines.
    ncti.ladar.lines_within : Refines until an accuracy is reached.

    Examples
    --------
    >>> import trimesh
    >>> from ncti.render import line_image, refined
    >>> box = trimesh.creation.box((40.0, 8.0, 6.0))
    >>> lines = line_image(box, aspect=30, depression=4, spacing=0.5)
    >>> refined(box, lines).spacing
    0.25
    """
    between = line_image(
        mesh,
        aspect=lines.aspect,
        depression=lines.depression,
        spacing=lines.spacing,
        roll=lines.roll,
        slant_range=lines.slant_range,
        phase=lines.phase + 0.5,
    )
    carry, phase = divmod(2 * lines.phase, 1.0)
    line = np.concatenate([2 * lines.line, 2 * between.line + 1]) + np.int32(carry)
    order = np.argsort(line, kind="stable")
    return replace(
        lines,
        line=line[order],
        piece=np.concatenate([lines.piece, between.piece])[order],
        surface=np.concatenate([lines.surface, between.surface])[order],
        spacing=lines.spacing / 2,
        phase=phase,
    )


def _check(bounds: Floats, view: View, spacing: float, surfaces: Surfaces) -> None:
    """Refuse a sensor within the ship, and more lines than are allowed."""
    if view.slant_range is not None:  # behind the sensor, w is negative, and bounds are of no use
        away = (surfaces.vertices + surfaces.centre) @ view.axes[2]
        view.check_clear(float(away.min()))
    lines = (bounds[1, 1] - bounds[1, 0]) / spacing
    if lines > MAX_LINES:
        raise ValueError(
            f"spacing is {spacing:g} m, which makes {lines:.0f} lines, but at most "
            f"{MAX_LINES} are allowed."
        )

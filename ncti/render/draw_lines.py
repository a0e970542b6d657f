"""Drawing of views that are exact along parallel lines, without pixels, rays or OpenGL."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require
from ncti.render.lines import LineImage
from ncti.render.surfaces import Surfaces
from ncti.render.threads import sweep_lines
from ncti.render.view import ROLL, View
from ncti.ships.shape import Mesh

Floats = NDArray[np.float64]

PHASE = 21845 / 2**16
"""Place of the lines from the line of sight through the ship origin [spacing]: a third, since hulls
seen from the bow are symmetric about that line and lines should not be; rounded to sixteen binary
digits, so that lines refined by halving coincide with finer lines bit for bit."""

MAX_LINES = 2**20
"""Most lines of a view; more suggest a spacing in another unit."""


def line_image(
    mesh: Mesh,
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
    refined : The same view by lines closer together.
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
    edges. Lines are divided among OMP_NUM_THREADS threads, by default one per processor; the result
    does not depend on their number.

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
    require("spacing", spacing, positive=True)
    require("phase", phase, minimum=-2.0, maximum=2.0)
    view = View.checked(aspect=aspect, depression=depression, roll=roll, slant_range=slant_range)
    return _draw_pieces(Surfaces.of(mesh), view, float(spacing), float(phase))


def refined(mesh: Mesh, lines: LineImage, factor: int = 2) -> LineImage:
    """Return a view by lines closer together: the given lines, and new ones between them.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        Ship of the view.
    lines : LineImage
        View of it.
    factor : int
        The spacing is divided by it.

    Returns
    -------
    LineImage
        As `line_image` of the spacing divided by the factor, with the phase multiplied by it.

    Raises
    ------
    ValueError
        If the factor is no whole number, or below 2.

    See Also
    --------
    line_image : The first lines.
    ncti.ladar.lines_within : Refines until an accuracy is reached.

    Examples
    --------
    >>> import trimesh
    >>> from ncti.render import line_image, refined
    >>> box = trimesh.creation.box((40.0, 8.0, 6.0))
    >>> lines = line_image(box, aspect=30, depression=4, spacing=0.75)
    >>> refined(box, lines, 3).spacing
    0.25
    """
    if not (isinstance(factor, int | np.integer) and factor >= 2):
        raise ValueError(f"factor is {factor!r}, but must be a whole number from 2 on")
    from ncti.render.line_sweep import merge_lines

    kept_line, phase = divmod(factor * lines.phase, 1.0)
    view = View(lines.aspect, lines.depression, lines.roll, slant_range=lines.slant_range)
    spacing = lines.spacing / factor
    new = _draw_pieces(Surfaces.of(mesh), view, spacing, phase, int(factor), int(kept_line))
    line, piece, surface = merge_lines(
        lines.line,
        lines.piece,
        lines.surface,
        (new.line, new.piece, new.surface),
        np.int32(factor),
        np.int32(kept_line),
    )
    return replace(new, line=line, piece=piece, surface=surface)


def _draw_pieces(
    surfaces: Surfaces, view: View, spacing: float, phase: float, every: int = 0, kept_line: int = 0
) -> LineImage:
    """Return the pieces of lines, except every `every`-th one, which a coarser view has."""
    from ncti.render.line_sweep import facing_numbers, find_crossings, project

    axes = view.axes
    point, bounds = project(surfaces.vertices, axes, axes @ surfaces.centre, view.curvature)
    _check_lines(bounds, view, spacing, surfaces)
    facing = facing_numbers(surfaces.area, surfaces.moment, -axes[2], view.curvature)
    crossings = find_crossings(
        point, bounds, surfaces.edge, facing, spacing, phase, np.int64(every), np.int64(kept_line)
    )
    line, piece, surface = sweep_lines(
        crossings, surfaces=len(surfaces.area), every=every, kept_line=kept_line
    )
    return LineImage(
        line, piece, surface, surfaces.normals, spacing=spacing, phase=phase, **asdict(view)
    )


def _check_lines(bounds: Floats, view: View, spacing: float, surfaces: Surfaces) -> None:
    """Refuse a sensor within the ship, and more lines than are allowed."""
    # Behind the sensor, w is negative and bounds are meaningless.
    if view.slant_range is not None and view.slant_range <= surfaces.reach:
        away = (surfaces.vertices + surfaces.centre) @ view.axes[2]
        view.check_clear(float(away.min()))
    lines = (bounds[1, 1] - bounds[1, 0]) / spacing
    if lines > MAX_LINES:
        raise ValueError(
            f"spacing is {spacing:g} m, which makes {lines:.0f} lines, but at most "
            f"{MAX_LINES} are allowed."
        )

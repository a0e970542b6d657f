"""Range images of meshes."""

from __future__ import annotations

from dataclasses import asdict

from ncti.checks import require
from ncti.render.choice import start_engine
from ncti.render.image import RangeImage
from ncti.render.solid import Solid, surface
from ncti.render.view import ROLL, Lattice, View
from ncti.ships.shape import Mesh


def range_image(
    mesh: Mesh,
    *,
    aspect: float,
    depression: float,
    pixel: float = 0.25,
    engine: str = "osmesa",
    roll: float = ROLL,
    slant_range: float | None = None,
) -> RangeImage:
    """Return the range image of a ship: range and slope of every pixel.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        Closed mesh with outward facets, in the ship frame [m]. All of it is drawn, parts below
        the waterline included.
    aspect : float
        Bearing of the sensor from the ship [deg], 0 at the bow, growing to port.
    depression : float
        Angle of the line of sight below the horizontal [deg], 0 to 90.
    pixel : float
        Pixel side at the range of the ship origin [m].
    engine : {"osmesa", "egl", "embree", "auto"}
        Rendering engine; "auto" is the first of these that can run here.
    roll : float
        Rotation of the pixel lattice about the line of sight [deg].
    slant_range : float, optional
        Distance from the sensor to the ship origin [m]; the far field when not given.

    Returns
    -------
    RangeImage
        The smallest image that covers the ship.

    Raises
    ------
    ValueError
        If a parameter is out of its range, or the mesh is empty or not finite.
    EngineError
        If the engine cannot run here.

    See Also
    --------
    line_image : The same view along lines, without pixels.
    available_engines : Names of engines that can run here.
    ncti.ladar.range_extent : The share of each range bin in a range image.

    Notes
    -----
    A pixel is a sample at its centre. The engine finds the facet behind it; range and slope are
    those of the facet's plane there, in float64, perspective and wavefront curvature included.

    Examples
    --------
    A box 40 m long and 8 m wide, seen from the bow, 3 m above its middle:

    >>> import trimesh
    >>> from ncti.render import range_image
    >>> box = trimesh.creation.box((40.0, 8.0, 6.0))
    >>> image = range_image(box, aspect=0, depression=0, roll=0, engine="embree")
    >>> image.down_range.shape, float(image.down_range.min())
    ((24, 32), -20.0)
    """
    require("pixel", pixel, positive=True)
    view = View.checked(aspect=aspect, depression=depression, roll=roll, slant_range=slant_range)
    solid = Solid.of(mesh)
    points = solid.view_coordinates(view)
    lattice = Lattice.around(points, view, float(pixel))

    drawing = start_engine(engine)
    facet = drawing.visible(solid, view, lattice, points)
    down_range, gradient = surface(solid, view, lattice, points, facet)
    return RangeImage(
        down_range, gradient, pixel=lattice.pixel, origin=lattice.origin, **asdict(view)
    )

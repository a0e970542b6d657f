"""Thermal images of a ship, averaged over frames."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from ncti.checks import require
from ncti.infrared.imager import Imager, image
from ncti.infrared.radiometry import IFOV
from ncti.infrared.silhouette import silhouette
from ncti.labels import labelled_array
from ncti.render import drawn_range, line_image
from ncti.render.far_field import reach_of
from ncti.render.flight import DEPRESSION
from ncti.simulate.subject import (
    SPACING,
    Ship,
    attributes_of,
    check_frames,
    check_known,
    check_sight,
    coordinates,
    generator,
    read_ship,
    roll_at,
)

if TYPE_CHECKING:
    import xarray as xr

LINES_PER_PIXEL = 8
"""Least lines across a pixel of the image."""

SCENE = frozenset(field.name for field in fields(Imager))
"""Other parameters of an image."""


def infrared_image(
    ship: Ship,
    *,
    aspect: float,
    slant_range: float = 50e3,
    frames: int = 16,
    super_resolution: str = "none",
    depression: float = DEPRESSION,
    ifov: float = IFOV,
    phase: tuple[float, float] = (0.0, 0.0),
    rng: int | np.random.Generator = 0,
    **scene: Any,
) -> xr.DataArray:
    """Simulate the passive-infrared image of a ship, averaged over frames.

    Parameters
    ----------
    ship : str, Path or trimesh.Trimesh
        A name of `ncti.ships.names()`, the path of a sheet or mesh, or a closed mesh in the ship
        frame [m].
    aspect : float
        Bearing of the sensor from the ship [deg], 0 at the bow, growing to port.
    slant_range : float
        Sensor to ship origin [m].
    frames : int
        Frames averaged; at each of four positions with super-resolution `shifted`.
    super_resolution : {"none", "perfect", "shifted"}
        Pixels of the detector, or half of them, as of `ncti.infrared.image`.
    depression : float
        Angle of the line of sight below the horizontal [deg].
    ifov : float
        Side of a detector pixel [rad].
    phase : (float, float)
        Place of the ship origin in a pixel of the image, right and up from its corner [pixel].
    rng : int or numpy.random.Generator
        Seed, or source of randomness.
    **scene
        Parameters of `ncti.infrared.Imager`: coverage_rule, contrast_at_zero, extinction, nedt,
        target_spread, sea_spread.

    Returns
    -------
    (vertical, horizontal) xarray.DataArray
        Temperature above the mean sea [K], over places on the target [m]. The attribute
        `contrast_K` is the ship's mean temperature at this range.

    Raises
    ------
    ValueError
        If the ship cannot be loaded, or a parameter is unknown or out of its range.

    See Also
    --------
    range_profile : The ship as the laser radar sees it.
    ncti.infrared.image : The image of a range image, as an array.
    ncti.features.segment : The silhouette in such an image.

    Notes
    -----
    A template of the ship on the detector's pixels, filled from two Gaussians [1]_.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, MIT Lincoln Laboratory, Appendix 2.

    Examples
    --------
    >>> import ncti
    >>> image = ncti.simulate.infrared_image("duncan", aspect=37, slant_range=50e3)
    >>> image.dims, image.attrs["units"]
    (('vertical', 'horizontal'), 'K')

    ``image.plot()`` draws it. Columns are as far apart as a pixel is wide at 50 km [m]:

    >>> float(image.horizontal.diff("horizontal").mean())
    7.5
    """
    check_known(scene, SCENE, "an image")
    imager = Imager(**scene)
    require("aspect", aspect, minimum=-360.0, maximum=360.0)
    check_sight(slant_range, ifov)
    frames = check_frames(frames)
    stream = generator(rng, aspect=aspect)
    mesh = read_ship(ship)
    footprint = ifov * slant_range * (1.0 if super_resolution == "none" else 0.5)
    lines = line_image(
        mesh,
        aspect=aspect,
        depression=depression,
        roll=roll_at(aspect),
        spacing=min(SPACING, footprint / LINES_PER_PIXEL),
        slant_range=drawn_range(reach_of(mesh.vertices), slant_range),
    )
    temperature = image(
        lines,
        slant_range=slant_range,
        frame_count=frames,
        rng=stream,
        ifov=ifov,
        phase=phase,
        super_resolution=super_resolution,
        imager=imager,
    )
    left, bottom = silhouette(lines, footprint=footprint, phase=phase).origin
    sight: Any = {"slant_range": slant_range, "depression": depression, "ifov": ifov}
    attrs = {
        "units": "K",
        "long_name": "temperature above the sea",
        **attributes_of(rng, frames=frames, **sight),
        "super_resolution": super_resolution,
        "contrast_K": imager.contrast(float(slant_range)),
    }
    import xarray as xr

    rows, columns = temperature.shape
    places = {
        "vertical": bottom + footprint * np.arange(rows),
        "horizontal": left + footprint * np.arange(columns),
    }
    coords = coordinates(mesh, aspect=aspect, range=slant_range, frame_count=frames)
    for name, place in places.items():
        coords[name] = labelled_array(name, place, "m", f"{name} cross-range")
    return xr.DataArray(temperature, coords, dims=tuple(places), name="image", attrs=attrs)

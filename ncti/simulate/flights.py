"""Scans of a ship by the infrared airborne radar, raw and corrected."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from ncti.checks import require
from ncti.irar.chain import Correction, correct, segmented
from ncti.irar.flight import Flight, ship_heading
from ncti.irar.scan import Scan, fly
from ncti.irar.snapshot import Snapshot, ship_window
from ncti.irar.time_delay import time_delay_integrate
from ncti.labels import labelled_array
from ncti.ladar.budget import MAX_DECIBELS, power_ratio
from ncti.simulate.subject import Ship, check_known, coordinates, generator, read_trimesh, seed_of

if TYPE_CHECKING:
    import xarray as xr

DERIVED_FIELDS = {"slant_range", "ship_heading", "cnr"}  # that have other arguments
PARAMETERS = (frozenset(field.name for field in fields(Flight)) - DERIVED_FIELDS) | {"cnr_db"}
AZIMUTHS = ("aircraft_heading", "offset")  # their sum is the azimuth of the line of sight


def flight(
    ship: Ship,
    *,
    aspect: float,
    slant_range: float = 3900.0,
    correction: Correction | None = None,
    rng: int | np.random.Generator = 0,
    **parameters: Any,
) -> xr.Dataset:
    """Simulate a flight past a ship, and correct its scan for motion and mirror.

    Parameters
    ----------
    ship : str, Path or trimesh.Trimesh
        A name of `ncti.ships.names()`, the path of a sheet or mesh, or a closed mesh in the ship
        frame [m].
    aspect : float
        Bearing of the aircraft from the ship in the snapshot [deg], 0 at the bow, growing to port.
    slant_range : float
        Aircraft to ship origin in the snapshot [m].
    correction : ncti.irar.Correction, optional
        Methods of correction; the exact ones when not given.
    rng : int or numpy.random.Generator
        Seed, or source of randomness.
    **parameters
        Other parameters of `ncti.irar.Flight`, such as depression, aircraft_speed and jitter, with
        `cnr_db` [dB] instead of `cnr`, a power ratio. The ship's heading follows from the aspect.

    Returns
    -------
    xarray.Dataset
        `intensity`, `range` and `infrared` (line, sample), as recorded, and the same after
        correction, with the sea removed from the first two, (vertical, horizontal) on the target:
        `corrected_intensity` in noise powers, `corrected_range` from the ship origin [m],
        `corrected_infrared` above the sea [K]. Every parameter of the flight is an attribute, its
        `cnr` as a power ratio.

    Raises
    ------
    ValueError
        If the ship cannot be loaded, a parameter is unknown or out of its range, or the flight
        cannot see the whole ship.

    See Also
    --------
    range_profile : The ship as the laser radar sees it.
    ncti.irar.fly : The pass, of which any number of scans can be drawn.
    ncti.irar.correct : The corrections.

    Notes
    -----
    Scan and corrections follow 'Data Processing' of [1]_.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, MIT Lincoln Laboratory, 'The Infrared Airborne Radar (IRAR) System'.

    Examples
    --------
    >>> import ncti
    >>> coarse = {"ifov": 500e-6, "samples": 60, "line_rate": 60.0}
    >>> scan = ncti.simulate.flight("roberts", aspect=175, slant_range=3000, **coarse)
    >>> scan.corrected_range.dims, scan.corrected_range.attrs["units"]
    (('vertical', 'horizontal'), 'm')

    ``scan.intensity.plot()`` draws the raw scan, ``scan.corrected_intensity.plot()`` the ship, and
    ``scan.corrected_range.plot(robust=True)`` its range image without the few false ranges.
    """
    check_known(parameters, PARAMETERS, "a flight")
    if not isinstance(correction, Correction | None):
        raise ValueError(
            f"correction is {correction!r:.60}, but must be an ncti.irar.Correction or None"
        )
    azimuths = [parameters.get(name, getattr(Flight, name)) for name in AZIMUTHS]
    for name, azimuth in zip(AZIMUTHS, azimuths, strict=True):
        require(name, azimuth, minimum=-360.0, maximum=360.0)
    sight = sum(azimuths)
    heading = ship_heading(aspect=aspect, sight=sight)
    if "cnr_db" in parameters:
        level = parameters.pop("cnr_db")
        require("cnr_db", level, minimum=-MAX_DECIBELS, maximum=90.0)
        parameters["cnr"] = power_ratio(level)
    passed = Flight(slant_range=slant_range, ship_heading=heading, **parameters)
    stream = generator(rng, aspect=aspect)
    mesh = read_trimesh(ship)
    scan = fly(mesh, passed, rng=stream).record(stream)
    window = ship_window(mesh, scan.flight)
    snapshot = segmented(correct(scan, correction, window=window), scan.flight)
    images = _raw_images(scan).merge(_corrected_images(snapshot, scan.flight))
    return images.assign_coords(coordinates(mesh, aspect=aspect)).assign_attrs(seed_of(rng))


def _raw_images(scan: Scan) -> xr.Dataset:
    """Return the raw images, the passive detectors integrated into one image."""
    images = scan.to_xarray()
    infrared = ("line", "sample"), time_delay_integrate(scan.infrared), images.infrared.attrs
    return images.drop_dims("detector").assign(infrared=infrared)


def _corrected_images(snapshot: Snapshot, flight: Flight) -> xr.Dataset:
    """Return the corrected images over places on the target."""
    import xarray as xr

    places = {"vertical": snapshot.row, "horizontal": snapshot.column}
    down_range = snapshot.range - flight.slant_range
    images = {
        "corrected_intensity": (snapshot.intensity, "1", "intensity over noise power"),
        "corrected_range": (down_range, "m", "down-range"),
        "corrected_infrared": (snapshot.infrared, "K", "temperature above the sea"),
    }
    return xr.Dataset(
        {name: labelled_array(tuple(places), *image) for name, image in images.items()},
        coords={
            name: labelled_array(name, place * flight.pixel, "m", f"{name} cross-range")
            for name, place in places.items()
        },
    )

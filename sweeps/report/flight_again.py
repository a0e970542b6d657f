"""Flights of a store flown once more: raw images, and what they become.

This is the one place where the report meets the code that flies.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh
import xarray as xr

import ncti.ships
from ncti.irar import Correction, Scan
from sweeps.report.axes import nominal, shown, which
from sweeps.report.flight_stages import Way, draw_stages
from sweeps.report.flights import TITLED, flown_past
from sweeps.report.stored import setting
from sweeps.stages.irar import FLOWN, RATES, RECORDED, scan_again, surface
from sweeps.stages.views import hull, read_mesh, ship_name

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Place:
    """A flight of a store: its ship's label, aspect [deg] and range [km]; nominal on other axes."""

    ship: str
    aspect: float
    range: float

    @property
    def title(self) -> str:
        """For people."""
        return f"{shown(self.ship).capitalize()} at {self.range:g} km, aspect {self.aspect:g}°"


def flights_of(flights: xr.Dataset) -> list[Place]:
    """Every ship of the group `validation` flown past at every range and aspect, ships slowest."""
    places = (np.atleast_1d(flights[name].values).tolist() for name in ("range", "aspect"))
    ranges, aspects = places
    return [
        Place(ship, aspect, kilometres)
        for ship in flown_past(flights)
        for kilometres in ranges
        for aspect in aspects
    ]


def one_flight(flights: xr.Dataset, place: Place) -> xr.Dataset:
    """The flight at a place: the first draw of the nominal one on all other axes."""
    return nominal(flights.sel(ship=place.ship, aspect=place.aspect, range=place.range))


def scan_of(
    attributes: Mapping[str, Any], flight: xr.Dataset, mesh: trimesh.Trimesh
) -> tuple[Scan, Way]:
    """Raw images of a flight of a store, noise and all, and how the store has them corrected.

    The flight has its value on every axis as a scalar coordinate; attributes are the store's.
    """
    given = attributes["configuration"]
    seed, reflectance = (
        setting(flight, given, "seed"),
        setting(flight, given["ladar"], "reflectance"),
    )
    values = {one.name: setting(flight, {}, one.name) for one in (*FLOWN, *RECORDED)}
    place = {"ship": flight.ship.item(), "aspect": flight.aspect.item(), "seed": seed}
    methods = {name: flight[name].item() for name in ("azimuth", "mirror", "range_filter")}
    return scan_again(values, mesh, **place, reflectance=reflectance), Way(
        rate=RATES.get(flight.chain.item()),
        correction=Correction(**methods),
        autofocus=flight.autofocus.item(),
        threshold=setting(flight, given["irar"], "segmentation_threshold"),
        surface=surface(mesh, values, reflectance),
    )


def draw_flight(
    attributes: Mapping[str, Any],
    flights: xr.Dataset,
    place: Place,
    mesh: trimesh.Trimesh | None = None,
) -> Figure:
    """Stages of a flight of a store, of which attributes and the group `validation` are given.

    Raises ValueError if no mesh is given, and the known ship is not the one of the store.
    """
    if mesh is None:
        mesh = known_ship(attributes, place.ship)
    flight = one_flight(flights, place)
    scan, way = scan_of(attributes, flight, mesh)
    draws = flights.sizes.get("replicate", 1)
    title = place.title + which(flight, flights.looks, but=TITLED)
    title += f", first of {draws} draws" if draws > 1 else ""
    return draw_stages(mesh, scan, way, title=title)


def known_ship(attributes: Mapping[str, Any], label: str) -> trimesh.Trimesh:
    """Return the known ship of a name.

    Raises
    ------
    ValueError
        If it is not what the store was made of.
    """
    if label not in ncti.ships.names():
        raise ValueError(
            f"{label} was read from a file that the store does not name, but ships drawn must be "
            f"among {', '.join(ncti.ships.names())}"
        )
    known = hull.function(ship_name(label))
    if known.digest != attributes["mesh_digests"][label]:
        raise ValueError(f"{label} has changed since the store was made of it")
    return read_mesh(known)

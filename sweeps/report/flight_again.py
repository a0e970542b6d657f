"""Flights of a store flown once more, from its configuration: raw images, and what they become."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import trimesh

import ncti.ships
from ncti.irar import Correction, Scan
from sweeps.flight_course import fly_past, recorded, surface
from sweeps.flight_grid import CORRECTED, FLOWN, RECORDED, FlightErrors
from sweeps.flight_schema import FlightConfig
from sweeps.grid import number_axis, ship_axis, ship_label
from sweeps.report.flight_stages import Way, draw_stages
from sweeps.report.flight_words import told

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Place:
    """A flight of a store: the first on every axis but these.

    Attributes
    ----------
    ship : str
        Its label.
    aspect, range : float
        [deg, km].
    """

    ship: str
    aspect: float
    range: float

    @property
    def title(self) -> str:
        """For people."""
        return f"{self.ship.capitalize()} at {self.range:g} km, aspect {self.aspect:g}°"


def flights_of(attributes: Mapping[str, Any]) -> list[Place]:
    """Every ship flown past at every range and aspect, the ships slowest.

    Parameters
    ----------
    attributes : mapping
        Of the store.
    """
    given, config = attributes["configuration"], _config(attributes)
    ships = tuple(ship_label(name) for name in ship_axis("grid.ship", given["grid"]["ship"]))
    aspects = number_axis("grid.aspect", given["grid"]["aspect"], minimum=0, below=360)
    return [
        Place(ship, aspect, kilometres)
        for ship, kilometres, aspect in product(config.flies(ships), config.expand().range, aspects)
    ]


def scan_of(attributes: Mapping[str, Any], place: Place, mesh: trimesh.Trimesh) -> tuple[Scan, Way]:
    """A flight of a store once more, noise and all, and how the store has it corrected.

    Parameters
    ----------
    attributes : mapping
        Of the store: its configuration and seed.
    place : Place
        Which.
    mesh : trimesh.Trimesh
        The ship.

    Returns
    -------
    scan : ncti.irar.Scan
        Its raw images, those that the sweep made.
    way : Way
        Its corrections.
    """
    given, config = attributes["configuration"], _config(attributes)
    grid = config.expand()
    values, receivers, choices = (
        {name: getattr(grid, name)[0] for name in on} for on in (FLOWN, RECORDED, CORRECTED)
    )
    values["range"] = place.range
    name = {"ship": place.ship, "aspect": place.aspect, **values}
    flown = fly_past(
        mesh,
        config.flight(place.aspect, **values),
        name=name,
        replicate=receivers["replicate"],
        seed=given["seed"],
        reflectance=given["ladar"]["reflectance"],
    )
    scan = recorded(flown, name=name, values=receivers, seed=given["seed"])
    return scan, Way(
        chain=choices["chain"],
        correction=Correction(
            **{name: choices[name] for name in ("azimuth", "mirror", "range_filter")}
        ),
        autofocus=choices["autofocus"],
        threshold=config.segmentation_threshold,
        surface=surface(mesh, values, given["ladar"]["reflectance"]),
    )


def draw_flight(
    attributes: Mapping[str, Any], place: Place, mesh: trimesh.Trimesh | None = None
) -> Figure:
    """Stages of a flight of a store.

    Parameters
    ----------
    attributes : mapping
        Of the store.
    place : Place
        Which flight.
    mesh : trimesh.Trimesh, optional
        The ship; the known one of that name when not given.

    Raises
    ------
    ValueError
        If the ship is not the one that the store was made of.
    """
    if mesh is None:
        mesh = known_ship(attributes, place.ship)
    scan, way = scan_of(attributes, place, mesh)
    grid = _config(attributes).expand()
    first = {name: getattr(grid, name) for name in (*FLOWN[1:], *RECORDED[1:], *CORRECTED)}
    which = [told(name, values[0]) for name, values in first.items() if len(values) > 1]
    draws = attributes["configuration"]["grid"]["replicate"]
    if len(draws) > 1:
        which.append(f"first of {len(draws)} draws")
    return draw_stages(mesh, scan, way, title=", ".join((place.title, *which)))


def known_ship(attributes: Mapping[str, Any], label: str) -> trimesh.Trimesh:
    """The ship of a name, if it is still what a store was made of.

    Raises
    ------
    ValueError
        If it is not.
    """
    if label not in ncti.ships.names():
        raise ValueError(
            f"{label} was read from a file that the store does not name, but ships drawn must be "
            f"among {', '.join(ncti.ships.names())}"
        )
    if ncti.ships.digest(label) != attributes["mesh_digests"][label]:
        raise ValueError(f"{label} has changed since the store was made of it")
    return ncti.ships.load(label)


def _config(attributes: Mapping[str, Any]) -> FlightConfig:
    irar = dict(attributes["configuration"]["irar"])
    return FlightConfig(**(irar | {"errors": FlightErrors(**irar["errors"])}))

"""A flight past a ship, from values of settings: how it is flown, believed, recorded and framed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.irar import (
    Flight,
    Pass,
    Scan,
    Snapshot,
    Window,
    fly,
    reflectivity,
    ship_heading,
    ship_window,
)
from ncti.irar.mirror import MIRROR_FORMS, mirror_rotation
from sweeps.engine.seeds import cell_rng
from sweeps.stages.irar import EXACT, FLOWN, NO_ERROR, RECORDED, Error

if TYPE_CHECKING:
    import trimesh

Values = Mapping[str, Any]

CELLS = 8
"""Of the truth along a pixel; 4 or 10 move tilts of noiseless ships by 0.1 deg."""

IN_SI = {  # settings of a flight that the library has by another name or in another unit
    "range": ("slant_range", 1e3),
    "ifov": ("ifov", 1e-6),
    "jitter": ("jitter", 1e-6),
    "flown_pulse_width": ("pulse_width", 1e-9),
}
OF_NO_FLIGHT = ("transom_gain", "mast_gain", "replicate")  # of the ship, and of the noise


def parameters(values: Values) -> dict[str, Any]:
    """Return parameters of a `Flight` from values of `FLOWN` and `RECORDED`, by dimension."""
    found = {}
    for name, value in values.items():
        if name == "cnr":
            found[name] = 10 ** (value / 10)
        elif name in IN_SI:
            own, unit = IN_SI[name]
            found[own] = value * unit
        elif name not in OF_NO_FLIGHT:
            found[name] = value
    return found


def flight_of(aspect: float, values: Values) -> Flight:
    """Return the pass by a ship at an aspect [deg], of values of `FLOWN`, and perhaps `RECORDED`.

    Raises
    ------
    ValueError
        If it cannot be flown.
    """
    sight = values["aircraft_heading"] + values["offset"]
    return Flight(ship_heading=ship_heading(aspect=aspect, sight=sight), **parameters(values))


def believed(flight: Flight, error: Error) -> Flight:
    """Return a flight as navigation has it, with one error.

    Parameters
    ----------
    flight : Flight
        As it was, with its pointing settled where that is wrong.
    error : (str, float)
        The parameter, and by how much it is wrong: of the aircraft's speed in percent.

    Raises
    ------
    ValueError
        If no such flight can be.
    """
    parameter, value = error
    if parameter == NO_ERROR[0]:
        return flight
    if parameter == "aircraft_speed":
        return replace(flight, aircraft_speed=flight.aircraft_speed * (1 + value / 100))
    if parameter == "pointing" and flight.pointing is None:
        return replace(flight, pointing=flight.offset + value)
    return replace(flight, **{parameter: getattr(flight, parameter) + value})


def window_of_cell(
    mesh: trimesh.Trimesh, flight: Flight, error: Error, chain: str, azimuth: str, mirror: str
) -> Window:
    """Return the pixels of a corrected image: about the ship, wider where it may lean or stretch.

    With an error of the pointing they are where the ship then seems to be: who looks at the
    image sees it there.
    """
    window = ship_window(mesh, flight)
    if error != NO_ERROR or chain != EXACT or azimuth != "pixel" or mirror not in MIRROR_FORMS:
        # Uncorrected lines rise by the mirror's angle, and rows follow one another with the drift.
        lean = abs(
            math.radians(mirror_rotation(flight.depression, mirror_angle=flight.mirror_angle))
        )
        drift, steep = abs(flight.drift / flight.climb), math.tan(lean)
        # As printed, rows that such lines climb more slowly, or faster, keep their distance.
        tall = 1.0 if chain == EXACT else 1.0 / max(1.0 - drift * steep, 0.1)
        above = math.ceil(
            max(window.rows, window.columns) * max(1 / 8, 1.1 * steep)
            + window.rows * 0.6 * (tall - 1.0)
        )
        aside = math.ceil(window.rows * max(1.0, drift + steep) * tall)
        window = Window(
            window.bottom - above,
            window.left - aside,
            window.rows + 2 * above,
            window.columns + 2 * aside,
        )
    if error[0] == "pointing":
        moved = math.radians(error[1]) * math.cos(math.radians(flight.depression)) / flight.ifov
        window = replace(window, left=window.left + round(moved))
    return window


def widened(truth: Snapshot, values: NDArray[np.float64], window: Window) -> NDArray[np.float64]:
    """Return values of a truth on its own window, on a larger one whose middle pixels they are."""
    rows, columns = (
        ((larger - own) // 2 * CELLS,) * 2
        for own, larger in (
            (truth.window.rows, window.rows),
            (truth.window.columns, window.columns),
        )
    )
    return np.pad(values, (rows, columns))


def surface(mesh: trimesh.Trimesh, values: Values, reflectance: str) -> dict[str, Any]:
    """Return how a ship reflects, with the gains put in: keywords of `fly` and `true_snapshot`."""
    gains = {name: values[name] for name in ("transom_gain", "mast_gain")}
    return {"reflectivity": reflectivity(mesh, **gains), "lambertian": reflectance == "lambertian"}


def fly_past(
    mesh: trimesh.Trimesh,
    course: Values,
    *,
    ship: str,
    aspect: float,
    replicate: int,
    seed: int,
    reflectance: str,
) -> Pass:
    """Return a pass by a ship, of carrier-to-noise ratio 1, on a course of values of `FLOWN`."""
    rng = cell_rng(
        seed, stage="flight_attitude", ship=ship, aspect=aspect, **course, replicate=replicate
    )
    flight = flight_of(aspect, {**course, "cnr": 0.0})
    return fly(mesh, flight, rng=rng, **surface(mesh, course, reflectance))


def received(flown: Pass, receivers: Values) -> Pass:
    """Return the same pass, met by receivers of values of `RECORDED`."""
    flight = replace(flown.plan.flight, **parameters(receivers))
    return Pass(replace(flown.plan, flight=flight), flown.returns)


def recorded(
    flown: Pass, course: Values, receivers: Values, *, ship: str, aspect: float, seed: int
) -> Scan:
    """Return the raw images of a pass, by receivers of values of `RECORDED`."""
    rng = cell_rng(seed, stage="flight", ship=ship, aspect=aspect, **course, **receivers)
    return received(flown, receivers).record(rng)


def draw_number(replicate: int, jitter: float) -> int:
    """Return which draw of the attitude a replicate has: all the same one without jitter."""
    return replicate if jitter else 0


def scan_again(
    values: Values, mesh: trimesh.Trimesh, *, ship: str, aspect: float, seed: int, reflectance: str
) -> Scan:
    """Return the raw images that a sweep made of a flight.

    Parameters
    ----------
    values : mapping
        By dimension, of all of `FLOWN` and `RECORDED`, None where null was given; others are left
        alone.
    mesh : trimesh.Trimesh
        The ship.
    ship : str
        Its label.
    aspect : float
        [deg].
    seed : int
        Of the sweep.
    reflectance : str
        As of `ladar.reflectance`.
    """
    course, receivers = ({one.name: values[one.name] for one in on} for on in (FLOWN, RECORDED))
    draw = draw_number(receivers["replicate"], course["jitter"])
    name: dict[str, Any] = {"ship": ship, "aspect": aspect, "seed": seed}
    flown = fly_past(mesh, course, **name, replicate=draw, reflectance=reflectance)
    return recorded(flown, course, receivers, **name)

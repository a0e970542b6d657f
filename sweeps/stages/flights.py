"""Flights past a ship: pass, raw images, recorded parameters, and checks."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from inspect import Parameter, Signature
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti import irar as library
from ncti.irar import Flight, Pass, Scan, Snapshot
from ncti.irar.scene import plan_scan
from ncti.ladar import range_extent
from ncti.render import range_image
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.kinds import Value
from sweeps.engine.settings import Choices, Run, Setting
from sweeps.engine.stage import Stage, in_memory, plain
from sweeps.stages import irar
from sweeps.stages.irar import (
    CELLS,
    EXACT,
    FLOWN,
    NO_ERROR,
    RECORDED,
    Error,
    Irar,
    Pairs,
    flight_of,
)
from sweeps.stages.ladar import Ladar, profile_bins
from sweeps.stages.ships import ShipName
from sweeps.stages.views import IRAR, LINES, Grid, check_beam, looks

if TYPE_CHECKING:
    import trimesh

SLOWEST, FASTEST = 0.25, 1.9  # believed closing speeds, of the true one
ALONE = (Irar.azimuth, Irar.mirror, Irar.range_filter)  # not beside the source's chain


def _taking(*names: str) -> Callable[[Any], Any]:
    """Declare the arguments of a function that takes any."""

    def declare(function: Any) -> Any:
        function.__signature__ = Signature(
            [Parameter(one, Parameter.KEYWORD_ONLY) for one in names]
        )
        return function

    return declare


@plain(
    uses=(Irar, Grid),
    reads={"flown_pulse_width": Irar.pulse_width, "depression": Irar.depression},
)
@_taking("ship", "flown", *(one.name for one in FLOWN))
def course(ship: ShipName, flown: tuple[str, ...] | None, **values: Any) -> Pairs | None:
    """Return the values that a pass depends on; None for a ship that is not flown past."""
    return None if flown is not None and ship not in flown else tuple(values.items())


@plain(uses=(Irar,))
@_taking(*(one.name for one in RECORDED if one is not Grid.replicate))
def receivers(**values: Any) -> Pairs:
    """Return the receivers of a flight."""
    return tuple(values.items())


flight_draw = plain(uses=(Grid, Irar), name="flight_draw")(irar.draw_number)


@in_memory(uses=(Grid, Ladar, Run), reads={"replicate": "flight_draw"})
def flown_pass(
    mesh: trimesh.Trimesh,
    course: Pairs | None,
    ship: ShipName,
    aspect: float,
    replicate: int,
    reflectance: str,
    seed: int,
) -> Pass | None:
    """Return the simulated pass; None for a ship that is not flown past, as in all that follows."""
    if course is None:
        return None
    name: dict[str, Any] = {"ship": ship, "aspect": aspect, "replicate": replicate, "seed": seed}
    return irar.fly_past(mesh, dict(course), **name, reflectance=reflectance)


@in_memory(uses=(Grid, Ladar))
def truth(
    mesh: trimesh.Trimesh, course: Pairs | None, aspect: float, reflectance: str
) -> Snapshot | None:
    """Return the view from the snapshot's place, on the ship's own window."""
    if course is None:
        return None
    flight = flight_of(aspect, dict(course))
    window = library.ship_window(mesh, flight)
    surface = irar.surface(mesh, dict(course), reflectance)
    return library.true_snapshot(mesh, flight, window, cells=CELLS, **surface)


@in_memory(uses=(Grid, Ladar))
def models(
    mesh: trimesh.Trimesh,
    truth: Snapshot | None,
    course: Pairs | None,
    aspect: float,
    drawing_engine: str,
    reflectance: str,
    bin_width: float,
    window: float,
) -> NDArray[np.float64] | None:
    """Return the (noiseless, synthetic, point; bin) profiles, for a carrier-to-noise ratio of 1.

    The last two are of the whole view's range image at the sensor's pixel, of even reflectivity:
    each pixel's area spread over its range extent, or sampled at its middle. Rows of pixels that
    are level see a deck at distances far apart, so that only the whole extent closes the gaps
    between them.
    """
    if course is None or truth is None:
        return None
    flight = flight_of(aspect, dict(course))
    sight: dict[str, Any] = {"slant_range": flight.slant_range}
    view: dict[str, Any] = {"aspect": aspect, "depression": flight.depression, "roll": 0.0, **sight}
    engine = "auto" if drawing_engine == LINES else drawing_engine  # it needs pixels
    image = range_image(mesh, pixel=flight.pixel, engine=engine, **view)
    # at least the pixel, in spite of rounding
    sight |= {"ifov": flight.ifov * (1 + 1e-9), "bin_width": bin_width, "window": window}
    drawn = [
        range_extent(image, **sight, spread=spread, reflectance=reflectance).fraction.sum(axis=0)
        for spread in (1.0, 0.0)
    ]
    bins = profile_bins(window, bin_width).size
    return np.stack([library.profile(truth, flight, bins=bins, bin_width=bin_width), *drawn])


@in_memory(uses=(Grid, Run))
def scan(
    flown_pass: Pass | None,
    course: Pairs | None,
    receivers: Pairs,
    ship: ShipName,
    aspect: float,
    replicate: int,
    seed: int,
) -> Scan | None:
    """Return the raw images."""
    if flown_pass is None or course is None:
        return None
    met = {"replicate": replicate, **dict(receivers)}
    return irar.recorded(flown_pass, dict(course), met, ship=ship, aspect=aspect, seed=seed)


@in_memory()
def clean(flown_pass: Pass | None, receivers: Pairs) -> Scan | None:
    """Return the raw images without noise."""
    return None if flown_pass is None else irar.received(flown_pass, dict(receivers)).noiseless()


@in_memory(uses=(Irar,), reads={"error": Irar.errors, "focused": Irar.autofocus})
def belief(scan: Scan | None, error: Error, focused: bool) -> Flight | None:
    """Return what the corrections take for the flight."""
    if scan is None:
        return None
    found = believed(scan.flight, error)
    if focused:
        with suppress(ValueError):  # no ship in the image: navigation is all there is
            found = library.autofocus(scan, found)
    return found


def believed(flight: Flight, error: Error) -> Flight:
    """Return a flight as navigation has it, of which it has one parameter wrong.

    Its pointing is to be settled where that is wrong; errors of the aircraft's speed are in
    percent. ValueError if no such flight can be.
    """
    parameter, value = error
    if parameter == NO_ERROR[0]:
        return flight
    if parameter == "aircraft_speed":
        return replace(flight, aircraft_speed=flight.aircraft_speed * (1 + value / 100))
    if parameter == "pointing" and flight.pointing is None:
        return replace(flight, pointing=flight.offset + value)
    return replace(flight, **{parameter: getattr(flight, parameter) + value})


def check(choices: Choices) -> Choices:
    """Refuse (`ConfigurationError`) flights, and errors of them, that are impossible."""
    for ship in choices.one(Irar.flown) or ():
        if ship not in choices[Grid.ship]:
            raise ConfigurationError(
                f"irar.flown has {str(ship)!r}, but every value must be one of "
                f"{', '.join(choices[Grid.ship])}, the values of grid.ship"
            )
    printed = next((name for name in choices[Irar.chain] if name != EXACT), None)
    for one in ALONE if printed else ():
        if choices[one] != (one.default,):
            raise ConfigurationError(
                f"{one.key} is {', '.join(choices[one])}, but must be {one.default} where "
                f"irar.chain has {printed}, which has a way of its own"
            )
    if not looks(IRAR)(choices):
        return choices
    for values in combinations(choices, (Irar.band_start, Irar.band_stop)):
        if not values["band_start"] < values["band_stop"]:
            raise ConfigurationError(
                f"irar.band_start has {values['band_start']:g}, but must be below "
                f"{values['band_stop']:g}, irar.band_stop"
            )
    for values in combinations(choices, (Grid.aspect, *FLOWN)):
        try:
            flight = flight_of(values.pop("aspect"), values)
        except ValueError as why:
            raise ConfigurationError(_of_key(why, values["range"])) from why
        for error in choices[Irar.errors]:
            _check_belief(flight, error)
    nearest, narrowest = min(choices[Irar.profile_range]), min(choices[Ladar.ifov])
    check_beam(choices, Irar.profile_range.key, nearest, narrowest=narrowest, beam="ladar.ifov")
    return choices


def check_meshes(choices: Choices, load: Callable[[Any], trimesh.Trimesh]) -> None:
    """Refuse (`ConfigurationError`) flights that do not see a whole ship of those that are loaded.

    The loader makes a mesh of a value of `grid.ship`.
    """
    if not looks(IRAR)(choices):
        return
    hulls = {ship: load(ship).convex_hull for ship in flown(choices)}
    for values in combinations(choices, (Grid.ship, Grid.aspect, *FLOWN)):
        ship, aspect = values.pop("ship"), values.pop("aspect")
        if ship not in hulls:
            continue
        try:
            plan = plan_scan(hulls[ship], flight_of(aspect, values))
        except ValueError as error:
            raise ConfigurationError(
                f"{_of_key(error, values['range'])} ({ship} at {aspect:g} deg)"
            ) from error
        if not plan.meets(hulls[ship]):
            raise ConfigurationError(
                f"irar.pointing has {values['pointing']:g}, but must be nearer "
                f"{values['offset']:g}, irar.offset: no sample meets {ship} at {aspect:g} deg"
            )


def flown(choices: Choices) -> tuple[Value, ...]:
    """Return the ships that are flown past."""
    past = choices.one(Irar.flown)
    return tuple(ship for ship in choices[Grid.ship] if past is None or ship in past)


def combinations(choices: Choices, settings: tuple[Setting, ...]) -> Iterator[dict[str, Value]]:
    """Yield values of some settings, by dimension, for all places of a sweep's axes."""
    names = {one.key: one.name for one in settings}
    axes = [(joint.keys, joint.points) for joint in choices.joint]
    together = {key for keys, _ in axes for key in keys}
    for key in names:
        if key not in together:
            axes.append(((key,), tuple((value,) for value in choices.values[key])))
    for points in product(*(points for _, points in axes)):
        whole = [
            pair
            for (keys, _), point in zip(axes, points, strict=True)
            for pair in zip(keys, point, strict=True)
        ]
        yield {names[key]: value for key, value in whole if key in names}


def _check_belief(flight: Flight, error: Error) -> None:
    """Refuse an error that changes the closing speed too much."""
    parameter, value = error
    wrong = f"irar.errors.{parameter} has {value:g}, with which"
    try:
        speed = believed(flight, error).closing_speed
    except ValueError as why:
        raise ConfigurationError(f"{wrong} {why}") from why
    least, most = (share * flight.closing_speed for share in (SLOWEST, FASTEST))
    if not least <= speed <= most:
        raise ConfigurationError(
            f"{wrong} the ship comes closer at {speed:.3g} m/s, but must be such that it does at "
            f"{least:.3g} to {most:.3g}"
        )


def _of_key(error: ValueError, slant_range: float) -> str:
    """Return the library's message about a flight, with the configuration's keys and units."""
    said = re.fullmatch(r"slant_range is .*? must be at least ([\d.e+]+), (.*)", str(error))
    if said:
        least = float(said[1]) / 1e3
        return f"irar.range has {slant_range:g}, but must be at least {least:g}, {said[2]}"
    return f"irar.{error}"


STAGES: tuple[Stage, ...] = (
    *(course, receivers, flight_draw, flown_pass, truth, models, scan, clean, belief),
)

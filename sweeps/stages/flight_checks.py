"""What a configuration of flights may not say, which several settings, or the ships, decide."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from itertools import product
from typing import TYPE_CHECKING, Any

from ncti.irar import Flight, plan_scan
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.kinds import Value
from sweeps.engine.settings import Choices, Setting
from sweeps.stages.flight_geometry import believed, flight_of
from sweeps.stages.irar import EXACT, FLOWN, Irar
from sweeps.stages.ladar import Ladar
from sweeps.stages.views import IRAR, Grid, Render, looks

if TYPE_CHECKING:
    import trimesh

SLOWEST, FASTEST = 0.25, 1.9  # believed closing speeds, of the true one
ALONE = (Irar.azimuth, Irar.mirror, Irar.range_filter)


def check(choices: Choices) -> Choices:
    """Refuse what cannot be flown, or be believed of a flight, at some aspect.

    Raises
    ------
    ConfigurationError
        Naming the key.
    """
    _check_flown(choices)
    _check_chain(choices)
    if looks(IRAR)(choices):
        for values in combinations(choices, (Grid.aspect, *FLOWN)):
            try:
                flight = flight_of(values.pop("aspect"), values)
            except ValueError as why:
                raise ConfigurationError(_of_key(why, values["range"])) from why
            for error in choices[Irar.errors]:
                _check_belief(flight, error)
        _check_beam(choices)
    return choices


def check_meshes(choices: Choices, load: Callable[[Any], trimesh.Trimesh]) -> None:
    """Refuse flights that do not see a whole ship.

    Parameters
    ----------
    choices : Choices
        Checked.
    load : callable
        Value of `grid.ship` -> its mesh.

    Raises
    ------
    ConfigurationError
        Naming the key, the ship and the aspect.
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
    lines: list[list[dict[str, Value]]] = []
    for joint in choices.joint:
        points = [dict(zip(joint.keys, point, strict=True)) for point in joint.points]
        lines.append([{names[k]: v for k, v in one.items() if k in names} for one in points])
    together = {key for joint in choices.joint for key in joint.keys}
    for one in settings:
        if one.key not in together:
            lines.append([{one.name: value} for value in choices[one]])
    for parts in product(*lines):
        yield {name: value for part in parts for name, value in part.items()}


def _check_flown(choices: Choices) -> None:
    for ship in choices.one(Irar.flown) or ():
        if ship not in choices[Grid.ship]:
            raise ConfigurationError(
                f"irar.flown has {str(ship)!r}, but every value must be one of "
                f"{', '.join(choices[Grid.ship])}, the values of grid.ship"
            )


def _check_chain(choices: Choices) -> None:
    """Refuse, beside the source's chain, other ways with columns, the mirror and ranges."""
    printed = next((name for name in choices[Irar.chain] if name != EXACT), None)
    for one in ALONE if printed else ():
        if choices[one] != (one.default,):
            raise ConfigurationError(
                f"{one.key} is {', '.join(choices[one])}, but must be {one.default} where "
                f"irar.chain has {printed}, which has a way of its own"
            )


def _check_belief(flight: Flight, error: tuple[str, float]) -> None:
    parameter, value = error
    try:
        speed = believed(flight, error).closing_speed
    except ValueError as why:
        raise ConfigurationError(
            f"irar.errors.{parameter} has {value:g}, with which {why}"
        ) from why
    least, most = (share * flight.closing_speed for share in (SLOWEST, FASTEST))
    if not least <= speed <= most:
        raise ConfigurationError(
            f"irar.errors.{parameter} has {value:g}, with which the ship comes closer at "
            f"{speed:.3g} m/s, but must be such that it does at {least:.3g} to {most:.3g}"
        )


def _check_beam(choices: Choices) -> None:
    """Refuse a proposed sensor whose beam is narrower than a drawn pixel."""
    nearest, narrowest = min(choices[Irar.profile_range]), min(choices[Ladar.ifov])
    width, pixel = narrowest * 1e-6 * nearest * 1e3, max(choices[Render.pixel])
    if width < pixel:
        raise ConfigurationError(
            f"irar.profile_range has {nearest:g}, where ladar.ifov of {narrowest:g} urad is "
            f"{width:.2g} m wide, but must be at least render.pixel, {pixel:g} m"
        )


def _of_key(error: ValueError, slant_range: float) -> str:
    """Return what the library says of a flight, by the configuration's key and in its unit."""
    said = re.fullmatch(r"slant_range is .*? must be at least ([\d.e+]+), (.*)", str(error))
    if said:
        least = float(said[1]) / 1e3
        return f"irar.range has {slant_range:g}, but must be at least {least:g}, {said[2]}"
    return f"irar.{error}"

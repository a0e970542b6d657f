"""Checking everything that can be checked before any work starts."""

from __future__ import annotations

import math
from dataclasses import dataclass, is_dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from omegaconf import DictConfig, OmegaConf
from platformdirs import user_cache_path

import ncti.ships
from ncti.features.profile import EDGE
from ncti.irar import Window
from ncti.ladar.pulse import SPEED_OF_LIGHT
from ncti.render import EngineError, choose_engine
from sweeps.errors import ConfigurationError
from sweeps.flight_course import shared_window
from sweeps.grid import ship_label
from sweeps.schema import INFRARED, IRAR, RANGE, SweepConfig, keys_of, unknown_key
from sweeps.stages import Ship, depression_at, load_ship
from sweeps.store import check_target, check_writable, provenance


@dataclass(frozen=True)
class Prepared:
    """A sweep that is known to make sense.

    Attributes
    ----------
    config : SweepConfig
        Checked configuration.
    ships : tuple of Ship
        Its ships, the user's meshes among them checked.
    engine : str
        The engine that will draw.
    cache : Path
        Where finished stages are kept.
    window : ncti.irar.Window or None
        Pixels of the images of flights, if there are any.
    """

    config: SweepConfig
    ships: tuple[Ship, ...]
    engine: str
    cache: Path
    window: Window | None = None


def prepare(composed: DictConfig) -> Prepared:
    """Turn a composed configuration into a sweep, or refuse it.

    Parameters
    ----------
    composed : DictConfig
        What Hydra composed from `conf/` and the command line.

    Returns
    -------
    Prepared
        The sweep.

    Raises
    ------
    ConfigurationError
        Naming the first key that is wrong, its value and what is allowed. Nothing is written
        but ships, into the cache, once all else is known to be right.
    """
    missing = sorted(OmegaConf.missing_keys(composed))
    if missing:
        raise ConfigurationError(f"{missing[0]} is not given, but must be")
    _known(composed, "")
    config = OmegaConf.to_object(composed)
    assert isinstance(config, SweepConfig)
    grid = config.grid.expand()
    infrared = config.infrared.expand(grid)
    if RANGE in config.sensors:
        for slant_range in grid.range:
            _seen_from("grid.range", slant_range, config)
            _resolved("grid.range", slant_range, "ladar.ifov", config.ladar.ifov, config)
    if IRAR in config.sensors:
        slant_range = config.irar.profile_range
        _resolved("irar.profile_range", slant_range, "ladar.ifov", config.ladar.ifov, config)
    if INFRARED in config.sensors:
        key = "grid.range" if config.infrared.range is None else "infrared.range"
        for key, slant_range in (
            *((key, slant_range) for slant_range in infrared.range),
            ("infrared.training_range", config.infrared.training_range),
        ):
            _seen_from(key, slant_range, config)
            _resolved(key, slant_range, "half infrared.ifov", config.infrared.ifov / 2, config)
    try:
        engine = choose_engine(config.render.engine)
    except EngineError as error:
        raise ConfigurationError(f"render.engine is {config.render.engine!r}: {error}") from error
    cache = Path(config.cache) if config.cache else user_cache_path("ncti-sweep")
    check_writable("cache", cache)
    ships = _ships(grid.ship, config, cache)
    window = _flown_past(ships, config, cache) if IRAR in config.sensors else None
    if config.store:
        check_target(Path(config.store), provenance(config, ships, engine))
    return Prepared(config, ships, engine, cache, window)


def _seen_from(key: str, slant_range: float, config: SweepConfig) -> None:
    """Refuse a slant range [km] that the scene does not allow."""
    try:
        depression_at(slant_range, config.scene)
    except ValueError as error:
        raise ConfigurationError(f"{key} has {slant_range:g}: {error}") from error


def _resolved(key: str, slant_range: float, name: str, ifov: float, config: SweepConfig) -> None:
    """Refuse a slant range [km] at which an IFOV [urad] is narrower than a drawn pixel."""
    beam = ifov * 1e-6 * slant_range * 1e3
    if beam < config.render.pixel:
        raise ConfigurationError(
            f"{key} has {slant_range:g}, where {name} of {ifov:g} urad is "
            f"{beam:.2g} m wide, but must be at least render.pixel, {config.render.pixel:g} m"
        )


def _known(node: DictConfig, parent: str) -> None:
    """Refuse keys that the schema lacks; Hydra itself lets `+key=value` through."""
    keys = keys_of(parent)
    if not isinstance(node, DictConfig):
        raise ConfigurationError(f"{parent} is {node!r}, but must hold {', '.join(keys)}")
    for name in map(str, node):
        key = f"{parent}.{name}".lstrip(".")
        if name not in keys:
            raise ConfigurationError(unknown_key(key))
        if is_dataclass(keys[name]):
            _known(node[name], key)


def _ships(names: tuple[str, ...], config: SweepConfig, cache: Path) -> tuple[Ship, ...]:
    """Ships of a grid, built or read, and known to fit into the range window."""
    ships: dict[str, Ship] = {}
    longest = max(config.grid.expand().pulse_width) * 1e-9 * SPEED_OF_LIGHT
    for name in names:
        known = name in ncti.ships.names()
        label = ship_label(name)
        source = name if known else str(Path(name).absolute())
        if label in ships:
            raise ConfigurationError(
                f"grid.ship has {name!r}, but {label!r} is the name of another ship of the grid"
            )
        try:
            ship = Ship(label, source, ncti.ships.digest(source))
            vertices = load_ship(ship.source, ship.digest, cache).vertices
        except ValueError as error:
            raise ConfigurationError(f"grid.ship has {name!r}: {error}") from error
        if INFRARED in config.sensors:
            _fits_window(label, vertices, config)
        reach = float(np.linalg.norm(vertices, axis=1).max())
        # The returned pulse reaches beyond the ship, and both ends of the window must stay free
        # of it for the noise floor to be read there.
        needed = (2 * reach + longest / math.sqrt(2)) / (1 - 2 * EDGE)
        seen = config.sensor != INFRARED and config.ladar.receiver == "full_profile"
        if seen and needed > config.ladar.window:
            raise ConfigurationError(
                f"ladar.window is {config.ladar.window:g} m, but must be at least {needed:.0f} m "
                f"to hold {label} and leave {EDGE:.0%} free at each end"
            )
        ships[label] = ship
    return tuple(ships.values())


def _flown_past(ships: tuple[Ship, ...], config: SweepConfig, cache: Path) -> Window:
    """Refuse flights that do not see a whole ship; the window that holds all that do."""
    aspects = config.grid.expand().aspect
    flown = config.irar.flies(tuple(ship.label for ship in ships))
    hulls = {
        # As far as anything of the ship reaches.
        ship.label: load_ship(ship.source, ship.digest, cache).convex_hull
        for ship in ships
        if ship.label in flown
    }
    for label, hull in hulls.items():
        config.irar.check_ship(label, hull, aspects)
    return shared_window(config.irar, list(hulls.values()), aspects)


def _fits_window(label: str, vertices: NDArray[np.float64], config: SweepConfig) -> None:
    """Refuse a ship that images do not hold."""
    for key, needed, allowed in (
        (
            "window_length",
            2 * float(np.hypot(vertices[:, 0], vertices[:, 1]).max()),
            config.infrared.window_length,
        ),
        ("window_height", float(vertices[:, 2].max()), config.infrared.window_height),
    ):
        if needed > allowed:
            raise ConfigurationError(
                f"infrared.{key} is {allowed:g} m, but must be at least {math.ceil(needed)} m to "
                f"hold {label}"
            )

"""Checking everything that can be checked before any work starts."""

from __future__ import annotations

import math
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from typing import get_type_hints

import numpy as np
from omegaconf import DictConfig, OmegaConf
from platformdirs import user_cache_path

import ncti.ships
from ncti.features.profile import EDGE
from ncti.ladar.pulse import SPEED_OF_LIGHT
from ncti.render import EngineError, choose_engine
from sweeps.errors import ConfigurationError
from sweeps.schema import SweepConfig
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
    """

    config: SweepConfig
    ships: tuple[Ship, ...]
    engine: str
    cache: Path


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
    _known(composed, SweepConfig, "")
    config = OmegaConf.to_object(composed)
    assert isinstance(config, SweepConfig)
    grid = config.grid.expand()
    for slant_range in grid.range:
        _seen_from(slant_range, config)
    try:
        engine = choose_engine(config.render.engine)
    except EngineError as error:
        raise ConfigurationError(f"render.engine is {config.render.engine!r}: {error}") from error
    cache = Path(config.cache) if config.cache else user_cache_path("ncti-sweep")
    check_writable("cache", cache)
    ships = _ships(grid.ship, config, cache)
    if config.store:
        check_target(Path(config.store), provenance(config, ships, engine))
    return Prepared(config, ships, engine, cache)


def _seen_from(slant_range: float, config: SweepConfig) -> None:
    """Refuse a slant range [km] that the scene or the beam does not allow."""
    try:
        depression_at(slant_range, config.scene)
    except ValueError as error:
        raise ConfigurationError(f"grid.range has {slant_range:g}: {error}") from error
    beam = config.ladar.ifov * 1e-6 * slant_range * 1e3
    if beam < config.render.pixel:
        raise ConfigurationError(
            f"grid.range has {slant_range:g}, where ladar.ifov of {config.ladar.ifov:g} urad is "
            f"{beam:.2g} m wide, but must be at least render.pixel, {config.render.pixel:g} m"
        )


def _known(node: DictConfig, schema: type, parent: str) -> None:
    """Refuse keys that the schema lacks; Hydra itself lets `+key=value` through."""
    if not isinstance(node, DictConfig):
        raise ConfigurationError(
            f"{parent.rstrip('.')} is {node!r}, but must hold {', '.join(get_type_hints(schema))}"
        )
    fields = get_type_hints(schema)
    for name in map(str, node):
        if name not in fields:
            owner = parent.rstrip(".") or "the configuration"
            raise ConfigurationError(
                f"{parent}{name} is no key of the configuration; {owner} has {', '.join(fields)}"
            )
        if is_dataclass(fields[name]):
            _known(node[name], fields[name], f"{parent}{name}.")


def _ships(names: tuple[str, ...], config: SweepConfig, cache: Path) -> tuple[Ship, ...]:
    """Ships of a grid, built or read, and known to fit into the range window."""
    ships: dict[str, Ship] = {}
    longest = max(config.grid.expand().pulse_width) * 1e-9 * SPEED_OF_LIGHT
    for name in names:
        known = name in ncti.ships.names()
        label = name if known else Path(name).stem
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
        reach = float(np.linalg.norm(vertices, axis=1).max())
        # The returned pulse reaches beyond the ship, and both ends of the window must stay free
        # of it for the noise floor to be read there.
        needed = (2 * reach + longest / math.sqrt(2)) / (1 - 2 * EDGE)
        if config.ladar.receiver == "full_profile" and needed > config.ladar.window:
            raise ConfigurationError(
                f"ladar.window is {config.ladar.window:g} m, but must be at least {needed:.0f} m "
                f"to hold {label} and leave {EDGE:.0%} free at each end"
            )
        ships[label] = ship
    return tuple(ships.values())

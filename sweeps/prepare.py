"""Checking everything that can be checked before any work starts."""

from __future__ import annotations

from dataclasses import dataclass, is_dataclass
from pathlib import Path
from typing import get_type_hints

from omegaconf import DictConfig, OmegaConf
from platformdirs import user_cache_path

import ncti.ships
from ncti.render import EngineError, choose_engine
from sweeps.errors import ConfigurationError
from sweeps.schema import SweepConfig
from sweeps.stages import Ship, depression_at
from sweeps.store import check_target


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
        Naming the first key that is wrong, its value and what is allowed. Nothing is written.
    """
    missing = sorted(OmegaConf.missing_keys(composed))
    if missing:
        raise ConfigurationError(f"{missing[0]} is not given, but must be")
    _known(composed, SweepConfig, "")
    config = OmegaConf.to_object(composed)
    assert isinstance(config, SweepConfig)
    cache = Path(config.cache) if config.cache else user_cache_path("ncti-sweep")
    check_folder("cache", cache)
    if config.store:
        check_target(Path(config.store))
    for slant_range in config.grid.expand().range:
        try:
            depression_at(slant_range, config.scene)
        except ValueError as error:
            raise ConfigurationError(f"grid.range has {slant_range:g}: {error}") from error
    try:
        engine = choose_engine(config.render.engine)
    except EngineError as error:
        raise ConfigurationError(f"render.engine is {config.render.engine!r}: {error}") from error
    return Prepared(config, _ships(config.grid.expand().ship, cache), engine, cache)


def _known(node: DictConfig, schema: type, parent: str) -> None:
    """Refuse keys that the schema lacks; Hydra itself lets `+key=value` through."""
    fields = get_type_hints(schema)
    for name in map(str, node):
        if name not in fields:
            owner = parent.rstrip(".") or "the configuration"
            raise ConfigurationError(
                f"{parent}{name} is no key of the configuration; {owner} has {', '.join(fields)}"
            )
        if is_dataclass(fields[name]):
            _known(node[name], fields[name], f"{parent}{name}.")


def check_folder(key: str, path: Path) -> None:
    """Raise ConfigurationError unless `path` is a folder or could become one."""
    nearest = next(folder for folder in (path, *path.absolute().parents) if folder.exists())
    if not nearest.is_dir():
        raise ConfigurationError(f"{key} is {str(path)!r}, but {str(nearest)!r} is no folder")


def _ships(names: tuple[str, ...], cache: Path) -> tuple[Ship, ...]:
    ships: dict[str, Ship] = {}
    for name in names:
        known = name in ncti.ships.names()
        label = name if known else Path(name).stem
        try:
            digest = ncti.ships.digest(name)
            if not known:
                # The user's own: read and check it whole, now rather than on a worker.
                ncti.ships.load(name, cache=cache / "meshes")
        except ncti.ships.ShipError as error:
            raise ConfigurationError(f"grid.ship has {name!r}: {error}") from error
        if label in ships:
            raise ConfigurationError(
                f"grid.ship has {name!r}, but {label!r} is the name of another ship of the grid"
            )
        ships[label] = Ship(label, name if known else str(Path(name).absolute()), digest)
    return tuple(ships.values())

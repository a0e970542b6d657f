"""Meshes of the ships of a configuration: their sources and digests, read and described once."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from platformdirs import user_cache_path

import ncti.ships
from ncti.render.far_field import reach_of
from ncti.ships import Transform
from ncti.ships.loading import is_built
from ncti.ships.parallel import build_in_parallel
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.settings import CACHE_VARIABLE
from sweeps.stages.ships import ShipName

if TYPE_CHECKING:
    import trimesh

NO_TRANSFORM = Transform()  # of a mesh that is in the ship frame
FEW_SHIPS = 4  # up to this many are built while workers import; more are built first, in parallel
LINE_INTERVAL = 10.0  # s between lines

LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class MeshSource:
    """A ship's mesh: its name or path, its transform, and the hash of both and the builder."""

    name: str
    digest: str
    transform: Transform = NO_TRANSFORM

    @property
    def identity(self) -> str:
        """Hash that results depend on, without the location of the file."""
        return self.digest


def mesh_source(ship: ShipName) -> MeshSource:
    """Return the source of a ship's mesh; `ConfigurationError` if there is no such ship."""
    try:
        digest = ncti.ships.digest(ship.source, **asdict(ship.transform))
        return MeshSource(ship.source, digest, ship.transform)
    except ncti.ships.ShipError as error:
        raise ConfigurationError(f"grid.ship has {ship.source!r}: {error}") from error


@lru_cache(maxsize=16)
def read_mesh(source: MeshSource) -> trimesh.Trimesh:
    """Return a ship's mesh, cached in this process; ValueError if it changed or is unfit."""
    mesh = ncti.ships.load(source.name, cache=_built_folder(), **asdict(source.transform))
    if mesh.metadata["digest"] != source.digest:
        raise ValueError(f"{source.name} was changed while the sweep ran")
    return mesh


@lru_cache(maxsize=16)
def description(source: MeshSource) -> ncti.ships.Description:
    """Return measures and vertices of a ship, faster than `read_mesh`; ValueError if unfit."""
    return ncti.ships.describe(source.name, cache=_built_folder(), **asdict(source.transform))


@lru_cache(maxsize=16)
def is_symmetric(source: MeshSource) -> bool:
    """Return whether a ship is symmetric about its centre plane."""
    return ncti.ships.is_symmetric(read_mesh(source))


@lru_cache(maxsize=4096)
def reach(source: MeshSource) -> float:
    """Return the largest distance of a ship's vertices from its origin [m]."""
    return reach_of(description(source).vertices)


def vertices(ship: ShipName) -> NDArray[np.float64]:
    """Return a ship's vertices [m], (n, 3)."""
    return description(mesh_source(ship)).vertices


def fault_hint(ship: ShipName) -> str:
    """Return the end of a message: a ship's fault and its remedy; empty without a fault."""
    described = description(mesh_source(ship))
    suggested = described.suggested_transform
    if suggested is None:
        return ""
    text = f"{{{suggested}}}" if str(suggested) else "no transform"
    return f"; {ship} {described.findings[0]}: if so, use {text}"


def check(ships: Sequence[ShipName]) -> None:
    """Refuse (`ConfigurationError`) ships that do not exist or are unfit."""
    sources = [mesh_source(ship) for ship in ships]
    folder = _built_folder()
    missing = [source.name for source in sources if not is_built(source.name, cache=folder)]
    if len(missing) > FEW_SHIPS:
        LOG.warning("building %d ships (once)", len(missing))
        build_in_parallel(missing, cache=folder, progress=_make_progress_logger(len(missing)))
    for source in sources:
        try:
            description(source)
        except ValueError as error:
            raise ConfigurationError(f"grid.ship has {source.name!r}: {error}") from error


def _make_progress_logger(count: int) -> Callable[[int], None]:
    """Return a function that says every few seconds how many ships are built."""
    latest = time.monotonic()

    def say(built: int) -> None:
        nonlocal latest
        if time.monotonic() - latest >= LINE_INTERVAL:
            latest = time.monotonic()
            LOG.warning("%d of %d ships are built", built, count)

    return say


def cache_folder() -> Path:
    """Return the cache folder: the one named by `CACHE_VARIABLE`, or the user's default."""
    folder = os.environ.get(CACHE_VARIABLE)
    return Path(folder) if folder else user_cache_path("ncti-sweep")


def _built_folder() -> Path:
    """Return the folder of built ships."""
    return cache_folder() / "meshes"

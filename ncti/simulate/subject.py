"""The ship that is simulated, its coordinates in results, and the source of randomness."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ncti.checks import require
from ncti.labels import labelled_array
from ncti.render.view import ROLL
from ncti.ships import digest
from ncti.ships.loading import ship_mesh
from ncti.ships.shape import Mesh, ShipMesh

if TYPE_CHECKING:
    import trimesh

Ship = Any
"""A name of `ncti.ships.names()`, the path of a sheet or mesh, or a mesh in the ship frame."""

CACHED_SHIPS = 8
"""Number of cached ships: the packaged ones and two of the user's, as in `ncti.render`."""

SPACING = 0.25
"""Largest distance between lines of a view [m], equal to the pixel of sweeps."""


MIN_SLANT_RANGE, MAX_SLANT_RANGE = 1e3, 1e9
"""Slant ranges [m]; 25 for 25 km would cut a ship into pixels of millimetres."""

MIN_FOOTPRINT = 0.1
"""Smallest beam at the ship [m]."""


def check_sight(slant_range: float, ifov: float) -> None:
    """Raise `ValueError` unless slant range [m] and width of a beam [rad] are within bounds."""
    require("slant_range", slant_range, minimum=MIN_SLANT_RANGE, maximum=MAX_SLANT_RANGE)
    require("ifov", ifov, positive=True, maximum=1.0)
    if ifov * slant_range < MIN_FOOTPRINT * (1 - 1e-9):  # a margin for rounding
        raise ValueError(
            f"ifov is {ifov!r} rad, but must be at least {MIN_FOOTPRINT / slant_range:.3g} rad, "
            f"{MIN_FOOTPRINT:g} m at a slant range of {slant_range:g} m"
        )


def check_known(given: Iterable[str], known: Iterable[str], kind: str) -> None:
    """Raise `ValueError` for the first unknown name."""
    if unknown := sorted(set(given) - set(known)):
        raise ValueError(
            f"{unknown[0]} is no parameter of {kind}, but must be one of {', '.join(sorted(known))}"
        )


def read_ship(ship: Ship) -> Mesh:
    """Return the mesh of a ship, which is a name, a path, or the mesh itself.

    Meshes of names and paths are cached by the content of their files. Never
    return them to users, who might modify them.
    """
    if isinstance(ship, str | Path):
        return _load_mesh(ship, digest(ship))
    import trimesh

    from ncti.ships.meshes import check_closed

    if isinstance(ship, trimesh.Trimesh):
        if not np.isfinite(np.asarray(ship.vertices)).all():
            raise ValueError("ship has vertices that are NaN or infinite, but all must be finite")
        check_closed(ship, "ship")
        return ship
    raise ValueError(
        f"ship is of type {type(ship).__name__}, but must be a name, a path or a trimesh.Trimesh"
    )


def read_trimesh(ship: Ship) -> trimesh.Trimesh:
    """Return the mesh of `read_ship` as a trimesh, for flights, which read more of it."""
    mesh = read_ship(ship)
    return mesh.to_trimesh() if isinstance(mesh, ShipMesh) else mesh


@lru_cache(maxsize=CACHED_SHIPS)
def _load_mesh(ship: str | Path, digest: str) -> ShipMesh:
    """Return the mesh of a name or path; the digest of its content keys the cache."""
    return ship_mesh(ship)


SINGLE_VALUES = {
    "range": (1e-3, "km", "slant range"),
    "frame_count": (1, "1", "frames averaged"),
    "pulse_width": (1e9, "ns", "pulse width, full width at 1/e^2"),
}
"""Factor from SI, unit and label of coordinates that have one value, by their names in stores."""


def coordinates(mesh: Mesh, *, aspect: Any, **single: float) -> dict[str, Any]:
    """Return coordinates of a result: ship, aspect [deg], and some of `SINGLE_VALUES` in SI.

    xarray makes the title of a plot from those that are single values, in at most 50 characters.
    """
    dims = ("aspect",) if np.ndim(aspect) else ()
    coords = {
        "ship": ((), mesh.metadata.get("name", "mesh"), {"long_name": "ship"}),
        "aspect": labelled_array(dims, np.asarray(aspect, dtype=np.float64), "degree", "aspect"),
    }
    for name, value in single.items():
        factor, unit, label = SINGLE_VALUES[name]
        coords[name] = labelled_array((), round(value * factor, 9), unit, label)
    return coords


def roll_at(aspect: float) -> float:
    """Return the roll of the lines [deg], mirrored for views of the starboard side.

    A symmetric ship then has equal views from both sides.
    """
    return ROLL if aspect % 360 <= 180 else -ROLL


def check_frames(frames: int) -> int:
    """Return the number of frames; ValueError unless it is a whole number above 0."""
    require("frames", frames, whole=True, minimum=1, maximum=2**53)
    return int(frames)


def generator(rng: int | np.random.Generator, *, aspect: float) -> np.random.Generator:
    """Return the random generator of one view.

    A seed gives each aspect its own stream, so that a result does not depend on the other aspects
    simulated; a generator is used as it is.
    """
    if isinstance(rng, np.random.Generator):
        return rng
    if isinstance(rng, bool) or not isinstance(rng, int | np.integer) or rng < 0:
        raise ValueError(
            f"rng is {rng!r:.60}, but must be a seed, a whole number from 0 on, or a "
            "numpy.random.Generator"
        )
    words = np.array([aspect + 0.0]).view(np.uint32)  # -0.0 as 0.0
    return np.random.default_rng(np.random.SeedSequence(int(rng), spawn_key=words.tolist()))


def seed_of(rng: int | np.random.Generator) -> dict[str, int]:
    """Return the seed as an attribute, or nothing for a generator."""
    return {} if isinstance(rng, np.random.Generator) else {"seed": int(rng)}


def attributes_of(
    rng: int | np.random.Generator,
    *,
    slant_range: float,
    depression: float,
    frames: int,
    ifov: float,
) -> dict[str, Any]:
    """Return the attributes that all simulated images and profiles have: view, and seed if any."""
    return {
        "slant_range_km": slant_range / 1e3,
        "depression_deg": float(depression),
        "frame_count": frames,
        "ifov_urad": round(ifov * 1e6, 9),
        **seed_of(rng),
    }

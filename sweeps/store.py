"""The zarr store of a sweep: making it, writing to it, reading it back.

Tasks write whole chunks of their own, so they need no locks and may be done twice. The root
attributes hold all that the numbers depend on and nothing else: no times, hosts, paths or
counts of workers, so that equal sweeps make equal stores.
"""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import zarr
from numpy.typing import NDArray
from zarr.errors import ZarrUserWarning

from sweeps.errors import ConfigurationError
from sweeps.layout import ACN, DONE, FAILED, PROFILES, STATUS, TABLES, Axes
from sweeps.schema import SweepConfig
from sweeps.stages import Ship, ViewProfiles, stage_code

PACKAGES = [
    "ncti-sweep",
    "dask",
    "embreex",
    "manifold3d",
    "numpy",
    "pyrender",
    "scikit-learn",
    "scipy",
    "trimesh",
    "xarray",
    "zarr",
]


def check_target(path: Path) -> None:
    """Raise ConfigurationError when no store of this sweep could be at `path`."""
    if path.exists() and not (path / "zarr.json").is_file():
        raise ConfigurationError(
            f"store is {str(path)!r}, which exists and is no zarr store; it must be a new path"
        )
    nearest = next(parent for parent in path.absolute().parents if parent.exists())
    if not nearest.is_dir():
        raise ConfigurationError(
            f"store is {str(path)!r}, but must not lie below the file {str(nearest)!r}"
        )


def create(path: Path, config: SweepConfig, ships: tuple[Ship, ...], engine: str) -> None:
    """Lay out an empty store, or find there the store that the same sweep began.

    Parameters
    ----------
    path : Path
        Where the store goes.
    config : SweepConfig
        Checked configuration.
    ships : tuple of Ship
        Ships of the grid.
    engine : str
        Render engine that will draw.

    Raises
    ------
    ConfigurationError
        If something else is at `path`; it is not touched.
    """
    attributes = provenance(config, ships, engine)
    if path.exists():
        if _attributes(path).get("fingerprint") != attributes["fingerprint"]:
            raise ConfigurationError(
                f"store is {str(path)!r}, which exists and holds something else; it must be a "
                "new path, or a store begun with the same configuration and versions"
            )
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    for group, template in Axes.of(config, ships).templates().items():
        template.to_zarr(path, group=group, mode="a", compute=False, consolidated=False)
    # Last, so that a store whose making was cut short is never taken for a begun sweep.
    zarr.open_group(path, mode="r+").attrs.update(attributes)
    _consolidate(path)


def provenance(config: SweepConfig, ships: tuple[Ship, ...], engine: str) -> dict[str, Any]:
    """Root attributes: everything the numbers depend on, and its hash."""
    resolved = asdict(config)
    for key in ("cluster", "store", "cache"):
        del resolved[key]
    resolved["grid"] = {key: list(value) for key, value in asdict(config.grid.expand()).items()}
    resolved["grid"]["ship"] = [ship.label for ship in ships]
    resolved["render"]["engine"] = engine
    attributes = {
        "title": "Identification of ships by laser-radar range profiles: parameter sweep",
        "Conventions": "CF-1.11",
        "configuration": resolved,
        "seed": config.seed,
        "mesh_digests": {ship.label: ship.digest for ship in ships},
        "versions": {name: version(name) for name in PACKAGES},
        "code": stage_code(),
    }
    text = json.dumps(attributes, sort_keys=True)
    return attributes | {"fingerprint": hashlib.sha256(text.encode()).hexdigest()}


def write_view(path: Path, ship: int, aspect: int, profiles: ViewProfiles) -> None:
    """Write the profiles of one view, then mark it done."""
    for name in ("expected", "averaged"):
        array = _array(path, PROFILES, name, mode="r+")
        array[ship, aspect] = getattr(profiles, name).reshape(array.shape[2:])
    mark_view(path, ship, aspect, DONE)


def mark_view(path: Path, ship: int, aspect: int, state: int) -> None:
    """Set the status of one view."""
    _array(path, STATUS, "view", mode="r+")[ship, aspect] = state


def views_done(path: Path) -> NDArray[np.bool_]:
    """(ship, aspect) bool ndarray: the views that need no more work."""
    return np.asarray(_array(path, STATUS, "view")[:]) == DONE


def read_profiles(
    path: Path, cell: tuple[int, ...]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Profiles of one cell, over all views.

    Parameters
    ----------
    path : Path
        The store.
    cell : tuple of int
        Index of pulse width, range, and, where it is an axis, number of target-free IFOVs.

    Returns
    -------
    expected : (ship, aspect, bin) float32 ndarray
    averaged : (frame_count, ship, aspect, bin) float32 ndarray
        NaN where a view is not done.
    """
    every = slice(None)
    pulse_width, *rest = cell
    expected = _array(path, PROFILES, "expected")[(every, every, pulse_width, *rest)]
    averaged = _array(path, PROFILES, "averaged")[(every, every, pulse_width, every, *rest)]
    return np.asarray(expected), np.moveaxis(np.asarray(averaged), 2, 0)


def write_cell(path: Path, cell: tuple[int, ...], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write the answers of the classifier in one cell, then mark what has one done."""
    for name, values in arrays.items():
        _array(path, ACN, name, mode="r+")[cell] = values
    state = np.where(arrays["correct"] >= 0, DONE, FAILED)
    _array(path, STATUS, "cell", mode="r+")[cell] = state


def mark_cell(path: Path, cell: tuple[int, ...], state: int) -> None:
    """Set the status of every training and test of one cell."""
    _array(path, STATUS, "cell", mode="r+")[cell] = state


def write_tables(path: Path, tables: xr.Dataset) -> None:
    """Write the tables, in place of any that are there."""
    tables.to_zarr(path, group=TABLES, mode="w", consolidated=False)
    _consolidate(path)


def read_group(path: Path, group: str) -> xr.Dataset:
    """A group of a store, as its users open it."""
    return xr.open_zarr(path, group=group)


def _consolidate(path: Path) -> None:
    """Gather the metadata, so that `xr.open_zarr` finds it in one file, in any group."""
    groups = [PROFILES, ACN, STATUS, TABLES]
    with warnings.catch_warnings():
        # Consolidated metadata is an extension of the zarr 3 format, as xarray writes it too.
        warnings.simplefilter("ignore", ZarrUserWarning)
        for group in (name for name in groups if (path / name).is_dir()):
            zarr.consolidate_metadata(path, path=group)
        zarr.consolidate_metadata(path)


def _attributes(path: Path) -> dict[str, Any]:
    try:
        return dict(zarr.open_group(path, mode="r").attrs)
    except (OSError, ValueError, KeyError):
        return {}


def _array(path: Path, group: str, name: str, mode: str = "r") -> Any:
    return zarr.open_array(path / group / name, mode=mode)

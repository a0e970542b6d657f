"""The zarr store of a sweep: making it, writing to it, reading it back.

Tasks write whole chunks of their own, so they need no locks and may be done twice. The root
attributes hold all that the numbers depend on and nothing else: no times, hosts, paths or
counts of workers, so that equal sweeps make equal stores.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
import shutil
import tempfile
import uuid
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import zarr
import zarr.api.asynchronous
from numpy.typing import NDArray
from zarr import AsyncArray
from zarr.abc.buffer import Buffer
from zarr.core.sync import sync
from zarr.errors import ZarrUserWarning
from zarr.storage import MemoryStore, StoreLike

from ncti.irar import Window
from sweeps.errors import ConfigurationError
from sweeps.flight_variables import VALIDATION
from sweeps.flights import flight_code
from sweeps.infrared import STEPS, infrared_code
from sweeps.layout import Axes
from sweeps.schema import INFRARED, IRAR, RANGE, SweepConfig
from sweeps.stages import RENDERING, Ship, profile_code, rendering_code
from sweeps.variables import DONE, FAILED, GROUPS, IMAGES, MISSING, PROFILES, STATES, STATUS

CODE = {
    RENDERING: rendering_code,
    RANGE: profile_code,
    INFRARED: infrared_code,
    IRAR: flight_code,
}

PARTIAL = ".partial"  # zarr names files so, too, until they are whole

PACKAGES = [
    "ncti-sweep",
    "dask",
    "embreex",
    "manifold3d",
    "numpy",
    "pyrender",
    "scikit-image",
    "scikit-learn",
    "scipy",
    "trimesh",
    "xarray",
    "zarr",
]


def check_target(path: Path, attributes: Mapping[str, Any]) -> None:
    """Refuse a path where a sweep could not put its store, or must not.

    Parameters
    ----------
    path : Path
        Where the store is to go.
    attributes : mapping
        The sweep's `provenance`.

    Raises
    ------
    ConfigurationError
        If something else is there, or nothing can be written there.
    """
    if path.exists() and read_attributes(path).get("fingerprint") != attributes["fingerprint"]:
        raise ConfigurationError(
            f"store is {str(path)!r}, which exists and holds something else; it must be a new "
            "path, or a store begun with the same configuration, code and versions"
        )
    check_writable("store", path.parent)
    tables = tables_folder(path)
    if tables.exists() and not tables.is_dir():
        raise ConfigurationError(
            f"store is {str(path)!r}, but {str(tables)!r}, where its tables go, is no folder"
        )


def check_writable(key: str, folder: Path) -> None:
    """Raise ConfigurationError unless files can be made in a folder, or the folder itself."""
    nearest = next(parent for parent in (folder, *folder.absolute().parents) if parent.exists())
    try:
        with tempfile.TemporaryFile(dir=nearest):
            pass
    except OSError as error:
        raise ConfigurationError(
            f"{key} is to be in {str(folder)!r}, but nothing can be written in {str(nearest)!r}: "
            f"{error.strerror}"
        ) from error


def tables_folder(path: Path) -> Path:
    """Folder beside a store that its tables are written to as CSV."""
    return path.with_name(f"{path.name.removesuffix('.zarr')}-tables")


def create(
    path: Path,
    config: SweepConfig,
    ships: tuple[Ship, ...],
    engine: str,
    window: Window | None = None,
) -> None:
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
    window : ncti.irar.Window, optional
        Pixels of the images of flights, if there are any.

    Raises
    ------
    ConfigurationError
        If something else is at `path`; it is not touched.

    Notes
    -----
    The layout is made beside its place and moved there whole: a store that can be seen is
    complete in all but its chunks, whenever its maker is killed.
    """
    attributes = provenance(config, ships, engine)
    check_target(path, attributes)
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        made = path.with_name(f".{path.name}.{uuid.uuid4().hex}{PARTIAL}")
        try:
            _lay_out(made, Axes.of(config, ships, window), attributes)
            made.rename(path)
        except OSError:
            if not path.exists():  # else the same sweep, started twice, was quicker
                raise
        finally:
            shutil.rmtree(made, ignore_errors=True)
    check_target(path, attributes)
    for orphan in path.rglob(f"*{PARTIAL}"):  # of a writer that was killed
        orphan.unlink(missing_ok=True)


def _lay_out(path: Path, axes: Axes, attributes: Mapping[str, Any]) -> None:
    made: dict[str, Buffer] = {}
    memory = MemoryStore(made)
    templates = axes.templates()
    for group, template in templates.items():
        template.to_zarr(memory, group=group, mode="a", compute=False, consolidated=False)
    zarr.open_group(memory, mode="r+").attrs.update(attributes)
    _consolidate(memory, templates)
    _keep(made, path)


def _keep(made: Mapping[str, Buffer], path: Path) -> None:
    """Write what was made in memory, where the many small files of a group cost much less."""
    for key, content in made.items():
        file = path / key
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content.to_bytes())


def provenance(config: SweepConfig, ships: tuple[Ship, ...], engine: str) -> dict[str, Any]:
    """Root attributes: everything the numbers depend on, and its hash."""
    resolved = asdict(config)
    for key in ("cluster", "store", "cache"):
        del resolved[key]
    del resolved["irar"]["pictures"]  # drawn of the numbers
    resolved["grid"] = {key: list(value) for key, value in asdict(config.grid.expand()).items()}
    resolved["grid"]["ship"] = [ship.label for ship in ships]
    resolved["render"]["engine"] = engine
    attributes = {
        "title": "Identification of ships by laser radar and passive infrared: parameter sweep",
        "Conventions": "CF-1.11",
        "configuration": resolved,
        "seed": config.seed,
        "mesh_digests": {ship.label: ship.digest for ship in ships},
        "versions": {name: version(name) for name in PACKAGES},
        "code": code_digests(config),
    }
    text = json.dumps(attributes, sort_keys=True)
    return attributes | {"fingerprint": hashlib.sha256(text.encode()).hexdigest()}


def code_digests(config: SweepConfig) -> dict[str, str]:
    """Hashes of the code of every stage of a sweep, by sensor, and of the rendering."""
    return {stage: CODE[stage]() for stage in (RENDERING, *config.sensors)}


def write_view(
    path: Path, ship: int, aspect: int, measured: Mapping[str, Mapping[str, NDArray[Any]]]
) -> None:
    """Write what the sensors measured of one view, by group and variable, then mark it done."""
    _write_chunks(
        {
            path / group / name: values
            for group, arrays in measured.items()
            for name, values in arrays.items()
        },
        (ship, aspect),
    )
    mark_view(path, ship, aspect, DONE)


def mark_view(path: Path, ship: int, aspect: int, state: int) -> None:
    """Set the status of one view."""
    _write_chunks({path / STATUS / "view": np.array(state)}, (ship, aspect))


def views_done(path: Path) -> NDArray[np.bool_]:
    """(ship, aspect) bool ndarray: the views that need no more work."""
    return np.asarray(_array(path, STATUS, "view")[:]) == DONE


def read_profiles(
    path: Path, cell: Mapping[str, int]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Profiles of one cell, over all views.

    Parameters
    ----------
    path : Path
        The store.
    cell : mapping of str to int
        Place on the axes of the cell, whether they are dimensions or not.

    Returns
    -------
    expected : (ship, aspect, bin) float32 ndarray
    averaged : (replicate, frame_count, ship, aspect, bin) float32 ndarray
        NaN where a view is not done.
    """
    expected = _read(path, PROFILES, "expected", cell)
    averaged = _read(path, PROFILES, "averaged", cell)
    if averaged.ndim == 4:  # no replicates
        averaged = averaged[:, :, None]
    return expected, np.moveaxis(averaged, (2, 3), (0, 1))


def read_covariance(path: Path, cell: Mapping[str, int]) -> NDArray[np.float32]:
    """(ship, aspect, lag, bin) float32 ndarray: covariances of one frame; see `read_profiles`."""
    return _read(path, PROFILES, "covariance", cell)


def read_silhouettes(
    path: Path, cell: Mapping[str, int]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Log-polar maps of one cell, over all views.

    Parameters
    ----------
    path : Path
        The store.
    cell : mapping of str to int
        Place on the axes of the cell, whether they are dimensions or not.

    Returns
    -------
    template : (ship, aspect, angle, radius) float32 ndarray
    silhouette : (ship, aspect, range, super_resolution, frame_count, angle, radius) float32 ndarray
        Zero where a view is not done.
    """
    step = np.float32(1 / STEPS)
    template, silhouette = (
        _read(path, IMAGES, name, cell) * step for name in ("template_log_polar", "log_polar")
    )
    return template, silhouette


def read_signatures(path: Path, cell: Mapping[str, int]) -> NDArray[np.float32]:
    """(ship, aspect, flight, kind, bin): signatures of one cell, all flights in one axis."""
    found = _read(path, VALIDATION, "signature", cell)
    return found.reshape(*found.shape[:2], -1, *found.shape[-2:])


def _read(path: Path, group: str, name: str, cell: Mapping[str, int]) -> NDArray[Any]:
    """An array at one place of some of its axes, whole on the others."""
    array = _array(path, group, name)
    index = tuple(cell.get(dim, slice(None)) for dim in array.metadata.dimension_names)
    return np.asarray(array[index])


def write_cell(
    path: Path,
    group: str,
    cell: tuple[int, ...],
    arrays: Mapping[str, NDArray[Any]],
    *,
    asked: NDArray[np.bool_] | None = None,
) -> None:
    """Write the answers of the classifier in one cell, then mark what has one done.

    Where no answer is asked for, as of ships that are not flown past, it stays missing.
    """
    _write_chunks({path / group / name: values for name, values in arrays.items()}, cell)
    state = np.where(arrays["correct"] >= 0, DONE, FAILED)
    if asked is not None:
        state = np.where(asked, state, MISSING)
    _write_chunks({path / STATES[group] / "cell": state}, cell)


def _write_chunks(arrays: Mapping[Path, NDArray[Any]], place: tuple[int, ...]) -> None:
    """Write at one place of several arrays, all at once: most of the time of each is waiting."""

    opened = {path: _opened(path, (path / "zarr.json").stat().st_mtime_ns) for path in arrays}

    async def write() -> None:
        await asyncio.gather(
            *(
                array.setitem(place, arrays[path].reshape(array.shape[len(place) :]))
                for path, array in opened.items()
            )
        )

    sync(write())


@lru_cache(maxsize=128)
def _opened(path: Path, changed: int) -> AsyncArray[Any]:
    """An array to write to, kept open as long as its metadata do not change."""
    return sync(zarr.api.asynchronous.open_array(store=path, mode="r+"))


def mark_cell(path: Path, group: str, cell: tuple[int, ...], state: int) -> None:
    """Set the status of every training and test of one cell."""
    _array(path, STATES[group], "cell", mode="r+")[cell] = state


def write_tables(path: Path, tables: Mapping[str, xr.Dataset]) -> None:
    """Write tables by group, in place of any that are there."""
    for group, table in tables.items():
        made: dict[str, Buffer] = {}
        table.to_zarr(MemoryStore(made), group=group, mode="w", consolidated=False)
        shutil.rmtree(path / group, ignore_errors=True)
        _keep({key: made[key] for key in made if key.startswith("tables/")}, path)
    _consolidate(path, [name for name in GROUPS if (path / name).is_dir()])


def read_group(path: Path, group: str) -> xr.Dataset:
    """A group of a store, as its users open it."""
    return xr.open_zarr(path, group=group)


def has_group(path: Path, group: str) -> bool:
    """Whether a store has a group."""
    return (path / group / "zarr.json").is_file()


def _consolidate(there: StoreLike, groups: Iterable[str]) -> None:
    """Gather the metadata, so that `xr.open_zarr` finds it in one file, in any group."""
    with warnings.catch_warnings():
        # Consolidated metadata is an extension of the zarr 3 format, as xarray writes it too.
        warnings.simplefilter("ignore", ZarrUserWarning)
        for group in groups:
            zarr.consolidate_metadata(there, path=group)
        zarr.consolidate_metadata(there)


def read_attributes(path: Path) -> dict[str, Any]:
    """Root attributes of a store; none where there is no store."""
    try:
        return dict(zarr.open_group(path, mode="r").attrs)
    except (OSError, ValueError, KeyError):
        return {}


def _array(path: Path, group: str, name: str, mode: str = "r") -> Any:
    return zarr.open_array(path / group / name, mode=mode)

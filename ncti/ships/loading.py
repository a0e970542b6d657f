"""Loading of ships, by name or path, as checked meshes."""

from __future__ import annotations

import hashlib
import os
import stat
from dataclasses import dataclass
from functools import cache as memoised
from importlib import metadata, resources
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ncti.ships import cache as store
from ncti.ships import meshes, sheets
from ncti.ships.build import Ship, build
from ncti.ships.errors import ShipError, shown

if TYPE_CHECKING:
    import trimesh
    from numpy.typing import NDArray

SHEET_SUFFIXES = (".yaml", ".yml")
MESH_SUFFIXES = (".stl", ".obj", ".glb")
MOST_MEGABYTES = dict.fromkeys(SHEET_SUFFIXES, 1) | dict.fromkeys(MESH_SUFFIXES, 256)
LONGEST_LABEL = 100  # characters


@dataclass(frozen=True)
class _Source:
    """Content of a sheet or mesh file."""

    name: str
    suffix: str
    content: bytes

    @property
    def is_sheet(self) -> bool:
        return self.suffix in SHEET_SUFFIXES

    @property
    def digest(self) -> str:
        parts = [_builder(), self.suffix.encode(), self.content]
        if self.is_sheet:
            parts.append(_templates())
        return hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()


def names() -> tuple[str, ...]:
    """Return the names of the ships that come with the library.

    See Also
    --------
    load : Takes these names, and paths.

    Examples
    --------
    >>> import ncti
    >>> "duncan" in ncti.ships.names()
    True
    """
    sheets_folder = resources.files("ncti.ships") / "sheets"
    files = (Path(entry.name) for entry in sheets_folder.iterdir())
    return tuple(sorted(f.stem for f in files if f.suffix == ".yaml" and f.stem != "templates"))


def digest(name_or_path: str | Path) -> str:
    """Return the content hash of a ship, without building it.

    Parameters
    ----------
    name_or_path : str or Path
        As for `load`.

    Returns
    -------
    str
        SHA-256 of all that shapes the mesh: the sheet and the equipment templates, or the mesh
        file; and the source of this package with the version of its solid modeller. On one
        machine and installation, equal digests mean equal meshes, bit for bit.

    Raises
    ------
    ShipError
        If there is no such ship or file, or the file's name cannot label a ship.

    See Also
    --------
    load : Keeps the hash of a mesh as ``metadata["digest"]``.

    Examples
    --------
    >>> import ncti
    >>> len(ncti.ships.digest("duncan"))
    64
    """
    return _find(name_or_path).digest


def load(name_or_path: str | Path, *, cache: str | Path | None = None) -> trimesh.Trimesh:
    """Return the mesh of a ship, watertight and with outward facets.

    Parameters
    ----------
    name_or_path : str or Path
        One of `names()`, or the path of a sheet (.yaml, .yml) or of a mesh in ship axes and
        metres (.stl, .obj, .glb). The name of a file, without its suffix, labels the ship.
    cache : str or Path, optional
        Folder of built ships; by default in the user's cache folder.

    Returns
    -------
    trimesh.Trimesh
        Vertices in ship axes [m]: x to the bow, y to port, z up, origin amidships on the
        waterline. Parts below the waterline are cut off. `metadata` has `name`, `digest`, and
        `loa` and `beam` [m], which for a sheet are those of the hull without overhanging parts.

    Raises
    ------
    ShipError
        If there is no such ship or file, or the sheet or mesh is invalid.

    See Also
    --------
    names : Names of the packaged ships.
    ncti.render.range_image, ncti.render.line_image : Views of a mesh.

    Examples
    --------
    >>> import ncti
    >>> ship = ncti.ships.load("duncan")
    >>> ship.is_watertight, ship.metadata["loa"]
    (True, 135.6)
    """
    # Imported where it is used: trimesh takes half a second.
    import trimesh

    source = _find(name_or_path)
    ship = _solid(source, cache)
    mesh = trimesh.Trimesh(ship.vertices, ship.faces, process=False)
    mesh.metadata.update(name=source.name, digest=source.digest, loa=ship.loa, beam=ship.beam)
    return mesh


def vertices(name_or_path: str | Path, *, cache: str | Path | None = None) -> NDArray[np.float64]:
    """Return the vertices of a ship, (vertex, 3) [m], faster than `load`, with the same errors."""
    return _solid(_find(name_or_path), cache).vertices


def _solid(source: _Source, cache: str | Path | None) -> Ship:
    if not source.is_sheet:
        corners, faces = meshes.read(source.content, source.suffix, where=f"mesh {source.name}")
        loa, beam, _ = (float(extent) for extent in np.ptp(corners, axis=0))
        return Ship(corners, faces, loa, beam)
    folder = store.default_folder() if cache is None else Path(cache)
    path = folder / f"{source.digest}.npz"
    ship = store.read(path)
    if ship is None:
        text, templates = _text(source), _templates().decode()
        ship = build(sheets.parse(text, templates, where=source.name))
        store.write(path, ship)
    return ship


def _find(name_or_path: str | Path) -> _Source:
    known = ", ".join(names())
    kinds = ", ".join(SHEET_SUFFIXES + MESH_SUFFIXES)
    if not isinstance(name_or_path, str | Path):
        raise ShipError(f"ship {shown(name_or_path)} must be one of {known}, or a path ({kinds}).")
    if name_or_path in names():
        sheet = resources.files("ncti.ships") / "sheets" / f"{name_or_path}.yaml"
        return _Source(str(name_or_path), ".yaml", sheet.read_bytes())
    path = Path(name_or_path)
    suffix = path.suffix.lower()
    if suffix not in SHEET_SUFFIXES + MESH_SUFFIXES:
        raise ShipError(
            f"unknown ship '{path}', known are {known}, or the path of a file ({kinds})."
        )
    _check_label(path)
    try:
        return _Source(path.stem, suffix, _content(path, MOST_MEGABYTES[suffix]))
    except ShipError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise ShipError(f"ship file '{path}' cannot be read: {reason}.") from None


def _check_label(path: Path) -> None:
    """Refuse a file whose name cannot label its ship in tables and messages."""
    label = path.stem
    if not label.strip() or len(label) > LONGEST_LABEL or not label.isprintable():
        raise ShipError(
            f"ship file {shown(path.name)} cannot label its ship: its name must have 1 to "
            f"{LONGEST_LABEL} printable characters before '{path.suffix}'."
        )


def _content(path: Path, megabytes: int) -> bytes:
    """Return the content of a regular file; reading a pipe or device might never end."""
    if not stat.S_ISREG(path.stat().st_mode):
        raise ShipError(f"ship file '{path}' is no regular file, but must be one.")
    most = megabytes * 10**6
    with open(path, "rb", opener=_open_without_waiting) as file:
        size = os.fstat(file.fileno()).st_size
        content = file.read(most + 1) if size <= most else b""
    if max(size, len(content)) > most:
        raise ShipError(
            f"ship file '{path}' has {max(size, len(content))} bytes, "
            f"but may have at most {megabytes} million."
        )
    return content


def _open_without_waiting(path: str, flags: int) -> int:
    # In case a pipe has replaced the file since it was checked.
    return os.open(path, flags | os.O_NONBLOCK)


def _text(source: _Source) -> str:
    try:
        return source.content.decode()
    except UnicodeDecodeError:
        raise ShipError(f"{source.name}: the sheet must be UTF-8 text.") from None


@memoised
def _templates() -> bytes:
    return (resources.files("ncti.ships") / "sheets" / "templates.yaml").read_bytes()


@memoised
def _builder() -> bytes:
    """Return what a mesh depends on besides its sheet: this package's code, the solid modeller."""
    modules = sorted(
        (entry.name, entry.read_bytes())
        for entry in resources.files("ncti.ships").iterdir()
        if entry.name.endswith(".py")
    )
    modeller = metadata.version("manifold3d").encode()
    return modeller + b"".join(hashlib.sha256(source).digest() for _, source in modules)

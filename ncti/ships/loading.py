"""Loading of ships, by name or path, as checked meshes."""

from __future__ import annotations

import hashlib
import stat
from dataclasses import dataclass, field, replace
from functools import cache as memoised
from functools import lru_cache
from importlib import metadata, resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from platformdirs import user_cache_path

from ncti.checks import require
from ncti.ships import cache as store
from ncti.ships import meshes, sheets
from ncti.ships.build import Ship, build
from ncti.ships.drawing import figure, measures
from ncti.ships.errors import ShipError, short_repr
from ncti.ships.orientation import Diagnosis
from ncti.ships.perturbation import (
    MAX_SIGMA_SCALE,
    MIN_SIGMA_SCALE,
    SupportTree,
    Variant,
    build_variant,
    support_tree,
    variant_error,
)
from ncti.ships.shape import ShipMesh
from ncti.ships.transform import Transform

if TYPE_CHECKING:
    from collections.abc import Sequence

    import trimesh
    from numpy.typing import NDArray

SHEET_SUFFIXES = (".yaml", ".yml")
MESH_SUFFIXES = (".stl", ".obj", ".glb")
MAX_MEGABYTES = dict.fromkeys(SHEET_SUFFIXES, 1) | dict.fromkeys(MESH_SUFFIXES, 256)
MAX_LABEL = 100  # characters


@dataclass(frozen=True)
class _Source:
    """Content of a sheet or mesh file, and the variant of the sheet if it is one."""

    name: str
    suffix: str
    content: bytes
    variant: Variant | None = None

    @property
    def is_sheet(self) -> bool:
        return self.suffix in SHEET_SUFFIXES

    @property
    def digest(self) -> str:
        parts = [_builder_hashes(), self.suffix.encode(), self.content]
        if self.is_sheet:
            parts.append(_templates())
        if self.variant is not None:
            parts.append(str(self.variant).encode())
        return hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()


def names() -> tuple[str, ...]:
    """Return the names of the ships that come with the library.

    See Also
    --------
    load : Loads a ship by name or path.

    Examples
    --------
    >>> import ncti
    >>> "duncan" in ncti.ships.names()
    True
    """
    sheets_folder = resources.files("ncti.ships") / "sheets"
    files = (Path(entry.name) for entry in sheets_folder.iterdir())
    return tuple(sorted(f.stem for f in files if f.suffix == ".yaml" and f.stem != "templates"))


def digest(name_or_path: str | Path, **transform: Any) -> str:
    """Return the content hash of a ship, without building it.

    Parameters
    ----------
    name_or_path : str or Path
        As for `load`.
    **transform
        `up`, `forward`, `scale`, `offset` and `repair`, as for `load`.

    Returns
    -------
    str
        SHA-256 of all that shapes the mesh: the sheet and the equipment templates, or the mesh
        file; the transform; and the source of this package with the version of its solid modeller.
        On one machine and installation, equal digests mean equal meshes, bit for bit.

    Raises
    ------
    ShipError
        If there is no such ship or file, the file's name cannot label a ship, or a value of the
        transform is not allowed.

    See Also
    --------
    load : Keeps the hash of a mesh as ``metadata["digest"]``.

    Examples
    --------
    >>> import ncti
    >>> len(ncti.ships.digest("duncan"))
    64
    """
    return Transform(**transform).digest(_find_source(name_or_path).digest)


def load(
    name_or_path: str | Path,
    *,
    up: str = "z",
    forward: str | None = None,
    scale: float = 1.0,
    offset: Sequence[float] = (0.0, 0.0, 0.0),
    repair: bool = False,
    cache: str | Path | None = None,
) -> trimesh.Trimesh:
    """Return the mesh of a ship, watertight and with outward facets.

    Parameters
    ----------
    name_or_path : str or Path
        One of `names()`, a variant of it such as ``duncan@0.7`` (see `variants`), or the path of a
        sheet (.yaml, .yml) or of a mesh (.stl, .obj, .glb). The name of a file, without its suffix,
        labels the ship.
    up, forward : {"x", "y", "z", "-x", "-y", "-z"}
        Axes of the file that point up and to the bow; see `Transform`. `forward` is x where it is
        not given and `up` is not along x.
    scale : float
        Metres in a unit of the file: 0.001 for millimetres.
    offset : (3,) sequence of float
        Added after turning and scaling [m]: forward, to port, up.
    repair : bool
        Whether openings of a mesh of a file are closed: those of at most 5 % of its surface
        together, and any below the waterline.
    cache : str or Path, optional
        Folder of built ships; by default in the user's cache folder.

    Returns
    -------
    trimesh.Trimesh
        Vertices in ship axes [m]: x to the bow, y to port, z up, origin amidships on the
        waterline. Parts below the waterline are cut off. `metadata` has `name`; `digest`; `loa` and
        `beam` [m], which for a sheet exclude parts that overhang the hull; `findings`,
        `suggested_transform` and `faults`, as in `describe`; and `variant_of`, the ship that a
        variant is derived from, or None. Notebooks show the silhouette with these data.

    Raises
    ------
    ShipError
        If there is no such ship or file, the sheet or mesh is invalid, or a value of the transform
        is not allowed.

    See Also
    --------
    describe : Size of a ship, and signs that its mesh has other axes.
    names : Names of the packaged ships.
    ncti.render.range_image, ncti.render.line_image : Views of a mesh.

    Examples
    --------
    >>> import ncti
    >>> ship = ncti.ships.load("duncan")
    >>> ship.is_watertight, ship.metadata["loa"]
    (True, 135.6)
    >>> half = ncti.ships.load("duncan", scale=0.5)
    >>> print(f"{half.extents[0]:.1f} m")
    67.8 m
    """
    transform = Transform(up=up, forward=forward, scale=scale, offset=offset, repair=repair)
    return ship_mesh(name_or_path, transform, cache=cache).to_trimesh()


def ship_mesh(
    name_or_path: str | Path,
    transform: Transform | None = None,
    *,
    cache: str | Path | None = None,
) -> ShipMesh:
    """Return the mesh of `load` without importing trimesh; raises as `load` does."""
    source, transform = _find_source(name_or_path), transform or Transform()
    ship, diagnosis, faults = _load_solid(source, transform, cache)
    attributes = {
        "name": source.name,
        "digest": transform.digest(source.digest),
        "loa": ship.loa,
        "beam": ship.beam,
        "variant_of": source.variant.base if source.variant else None,
        "findings": diagnosis.findings,
        "suggested_transform": diagnosis.suggested_transform,
        "faults": faults,
    }
    return ShipMesh(ship.vertices, ship.faces, attributes)


def variants(
    name: str,
    count: int,
    *,
    seed: int = 0,
    scale: float = 1.0,
    cache: str | Path | None = None,
) -> tuple[trimesh.Trimesh, ...]:
    """Return meshes of variants of a ship: its sheet perturbed within its uncertainty.

    Parameters
    ----------
    name : str
        One of `names()`.
    count : int
        Number of variants, 1 or more. A larger count begins with the variants of a smaller one.
    seed : int
        Seed of the draws, 0 or more.
    scale : float
        Factor of all uncertainties, 0.001 to 4, to six digits. The same draws are scaled, so that
        a variant of half the scale lies about half as far from the ship.
    cache : str or Path, optional
        As for `load`.

    Returns
    -------
    tuple of trimesh.Trimesh
        Watertight meshes, as from `load`. The `name` in their metadata, such as ``duncan@0.7`` for
        the seventh variant of seed 0 or ``duncan@0.7x0.5`` at half the scale, is accepted wherever
        the name of a ship is; `variant_of` is the ship. The suffix ``s0.8``, as in
        ``duncan@0.7s0.8`` or ``duncan@0.7x4s0.8``, multiplies all dimensions of the variant by 0.8;
        factors are 0.5 to 2.

    Raises
    ------
    ShipError
        If there is no such ship, or count, seed or scale is not allowed.

    See Also
    --------
    load : Loads a variant by its name.
    ncti.features.ship_distance : How different two ships are.

    Notes
    -----
    A line of a sheet, or its provenance tag, states the uncertainty of its place
    (`ncti/ships/sheets/README.md`). Length, beam and equipment are published, and stay. A smooth
    map of the ship's space, with the uncertainty of the most certain line, moves everything else,
    so that components in contact stay in contact. Each component, with all that it carries, then
    moves on its carrier by the rest of its uncertainty, but not off it; a carrier is as certain as
    the most certain component on it. Sizes of parts that carry nothing also vary. Normal deviates
    are clipped at two sigma. Port and starboard move symmetrically, and parts on the centreline
    stay there.

    A variant that does not build, because a part has lost contact, is drawn again: the random
    stream is keyed by the ship, the seed, the number and the try.

    Examples
    --------
    >>> import ncti
    >>> first, second = ncti.ships.variants("duncan", 2)
    >>> first.metadata["name"], first.metadata["variant_of"], first.is_watertight
    ('duncan@0.1', 'duncan', True)
    """
    if name not in names():
        raise ShipError(f"name {short_repr(name)} must be one of {', '.join(names())}.")
    try:
        require("count", count, whole=True, minimum=1)
        require("seed", seed, whole=True, minimum=0, below=1e18)
        require("scale", scale, minimum=MIN_SIGMA_SCALE, maximum=MAX_SIGMA_SCALE)
    except ValueError as error:
        raise ShipError(f"{error}.") from None
    labels = [str(Variant(name, int(seed), number, scale)) for number in range(1, int(count) + 1)]
    return tuple(load(label, cache=cache) for label in labels)


@dataclass(frozen=True, eq=False)
class Description:
    """Measures of a ship above the waterline, and signs that its mesh is not in the ship frame.

    Attributes
    ----------
    name : str
        Name of the ship, or of its file without the suffix.
    length, beam, height : float
        Extents along x, y and z [m].
    facets : int
        Number of facets.
    vertices : (vertex, 3) float64 ndarray
        Corners [m].
    faces : (facet, 3) integer ndarray
        Numbers of the corners of each facet.
    findings : tuple of str
        Signs of a wrong frame, such as "lies on its side"; empty if there are none.
    suggested_transform : Transform or None
        Transform of the file that would correct all findings, to use instead of the given one.
    faults : tuple of str
        Corrected faults of the surface, as "1 of 2 bodies inside out".

    See Also
    --------
    describe : Returns the description of a ship.

    Notes
    -----
    Notebooks show the silhouette seen from starboard.

    Examples
    --------
    >>> import ncti
    >>> ship = ncti.ships.describe("texas")
    >>> f"{ship.name}: {ship.length:.1f} m, {ship.findings}"
    'texas: 178.3 m, ()'
    """

    name: str
    length: float
    beam: float
    height: float
    facets: int
    vertices: NDArray[np.float64] = field(repr=False)
    faces: NDArray[np.integer] = field(repr=False)
    findings: tuple[str, ...] = ()
    suggested_transform: Transform | None = None
    faults: tuple[str, ...] = ()

    def _repr_html_(self) -> str:
        return figure(self.name, self.vertices, self.faces, (*self.findings, *self.faults))

    @property
    def measures(self) -> str:
        """Length x beam x height and facets, as text."""
        return measures(self.vertices, self.faces)


def describe(
    name_or_path: str | Path,
    *,
    up: str = "z",
    forward: str | None = None,
    scale: float = 1.0,
    offset: Sequence[float] = (0.0, 0.0, 0.0),
    repair: bool = False,
    cache: str | Path | None = None,
) -> Description:
    """Return the measures of a ship, and signs that axes or origin of its mesh are wrong.

    Parameters
    ----------
    name_or_path, up, forward, scale, offset, repair, cache
        As for `load`.

    Returns
    -------
    Description
        Without findings for a sheet that is not transformed: it is built in the ship frame.

    Raises
    ------
    ShipError
        As `load`.

    See Also
    --------
    load : the mesh itself.
    Transform : axes, unit and origin of a mesh file.

    Notes
    -----
    Loading a mesh file separates touching bodies where more than two facets meet at an edge, turns
    bodies that are inside out, and merges vertices along open edges that are closer than 1e-5 of
    the longest extent. It then unites all bodies.

    Findings are reported for a ship that floats above the water, lies on its side or stands on end,
    is upside down, has its length along y, its origin outside the middle half of its length or
    beam, or no hull below a waterline at the height of its keel. A correct mesh may have findings,
    so they never cause an error.

    Examples
    --------
    >>> import ncti.ships
    >>> print(ncti.ships.describe("duncan").measures)
    135.6 x 13.7 x 31.2 m, 43,672 facets
    >>> wrong = ncti.ships.describe("duncan", offset=[60, 0, 3])
    >>> wrong.findings
    ('has its origin 60.0 m from amidships', 'floats 3.0 m above the water')
    >>> wrong.suggested_transform.is_identity
    True
    """
    transform = Transform(up=up, forward=forward, scale=scale, offset=offset, repair=repair)
    ship = ship_mesh(name_or_path, transform, cache=cache)
    length, beam, height = (float(extent) for extent in np.ptp(ship.vertices, axis=0))
    return Description(
        ship.metadata["name"],
        length,
        beam,
        height,
        len(ship.faces),
        ship.vertices,
        ship.faces,
        ship.metadata["findings"],
        ship.metadata["suggested_transform"],
        ship.metadata["faults"],
    )


def is_built(name_or_path: str | Path, *, cache: str | Path | None = None) -> bool:
    """Return whether `load` needs no build: the cache has the ship, or the file is a mesh.

    Raises ShipError as `digest` does.
    """
    source = _find_source(name_or_path)
    return not source.is_sheet or _path_in_cache(source, cache).exists()


def _path_in_cache(source: _Source, cache: str | Path | None) -> Path:
    default = user_cache_path("ncti-sweep") / "meshes"
    return (default if cache is None else Path(cache)) / f"{source.digest}.npz"


def _load_solid(
    source: _Source, transform: Transform, cache: str | Path | None
) -> tuple[Ship, Diagnosis, tuple[str, ...]]:
    if not source.is_sheet:
        where = f"mesh {source.name}"
        placed = meshes.read(source.content, source.suffix, transform, where=where)
        loa, beam, _ = (float(extent) for extent in np.ptp(placed.vertices, axis=0))
        return Ship(placed.vertices, placed.faces, loa, beam), placed.diagnosis, placed.faults
    path = _path_in_cache(source, cache)
    ship = store.read(path)
    if ship is None:
        ship = _build_ship(source)
        store.write(path, ship)
    if transform.is_identity:
        return ship, Diagnosis(), ()
    placed = meshes.place(ship.vertices, ship.faces, transform, where=f"ship {source.name}")
    loa, beam = ship.loa * transform.scale, ship.beam * transform.scale
    return Ship(placed.vertices, placed.faces, loa, beam), placed.diagnosis, placed.faults


def _build_ship(source: _Source) -> Ship:
    if source.variant is None:
        return build(_parse_sheet(source))
    sheet, support_tree = _sheet_and_supports(
        replace(source, name=source.variant.base, variant=None)
    )
    return build_variant(sheet, support_tree, source.variant)


def _parse_sheet(source: _Source) -> sheets.Sheet:
    try:
        text = source.content.decode()
    except UnicodeDecodeError:
        raise ShipError(f"{source.name}: the sheet must be UTF-8 text.") from None
    return sheets.parse(text, _templates().decode(), where=source.name)


@lru_cache(maxsize=8)
def _sheet_and_supports(source: _Source) -> tuple[sheets.Sheet, SupportTree]:
    sheet = _parse_sheet(source)
    return sheet, support_tree(sheet)


def _packaged_sheet(name: str) -> bytes:
    return (resources.files("ncti.ships") / "sheets" / f"{name}.yaml").read_bytes()


def _find_source(name_or_path: str | Path) -> _Source:
    packaged = names()
    known = ", ".join(packaged)
    kinds = ", ".join(SHEET_SUFFIXES + MESH_SUFFIXES)
    if not isinstance(name_or_path, str | Path):
        raise ShipError(
            f"ship {short_repr(name_or_path)} must be one of {known}, or a path ({kinds})."
        )
    if name_or_path in packaged:
        return _Source(str(name_or_path), ".yaml", _packaged_sheet(str(name_or_path)))
    variant = Variant.parse(name_or_path) if isinstance(name_or_path, str) else None
    if variant is not None and variant.base in packaged:
        return _Source(str(variant), ".yaml", _packaged_sheet(variant.base), variant)
    path = Path(name_or_path)
    suffix = path.suffix.lower()
    if suffix not in SHEET_SUFFIXES + MESH_SUFFIXES:
        if path.name.partition("@")[0] in packaged:
            raise variant_error(str(path))
        raise ShipError(
            f"unknown ship '{path}', known are {known}, or the path of a file ({kinds})."
        )
    _check_label(path)
    try:
        return _Source(path.stem, suffix, _read_content(path, MAX_MEGABYTES[suffix]))
    except OSError as error:
        raise ShipError(f"ship file '{path}' cannot be read: {error.strerror}.") from None


def _check_label(path: Path) -> None:
    """Refuse a file whose name cannot label its ship in tables and messages."""
    label = path.stem
    if not label.strip() or len(label) > MAX_LABEL or not label.isprintable():
        raise ShipError(
            f"ship file {short_repr(path.name)} cannot label its ship: its name must have 1 to "
            f"{MAX_LABEL} printable characters before '{path.suffix}'."
        )


def _read_content(path: Path, megabytes: int) -> bytes:
    """Return the content of a regular file; reading a pipe or device might never end."""
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise ShipError(f"ship file '{path}' is no regular file, but must be one.")
    if status.st_size > megabytes * 10**6:
        raise ShipError(
            f"ship file '{path}' has {status.st_size} bytes, "
            f"but may have at most {megabytes} million."
        )
    return path.read_bytes()


def _templates() -> bytes:
    return _packaged_sheet("templates")


@memoised
def _builder_hashes() -> bytes:
    """Return hashes of the code that builds a mesh: this package and the solid modeller."""
    modules = sorted(
        (entry.name, entry.read_bytes())
        for entry in resources.files("ncti.ships").iterdir()
        if entry.name.endswith(".py")
    )
    modeller = metadata.version("manifold3d").encode()
    return modeller + b"".join(hashlib.sha256(source).digest() for _, source in modules)

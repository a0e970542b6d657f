"""Meshes of users: STL, OBJ or GLB in ship axes and metres, checked as they are read."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np
from manifold3d import Error, Manifold, Mesh64
from numpy.typing import NDArray

from ncti.ships.errors import ShipError
from ncti.ships.lofting import union

if TYPE_CHECKING:
    import trimesh

SMALLEST, LARGEST = 1.0, 1000.0  # extent of anything that may pass for a ship in metres [m]


def read(data: bytes, suffix: str, *, where: str) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return vertices [m] and facets of a mesh file: closed, wound outward, above the waterline.

    Several geometries, each closed, are united; geometries that are closed only together (a hull
    split by material) are joined. Parts below the waterline are cut off and the cut is closed.

    Parameters
    ----------
    data : bytes
        Content of the file.
    suffix : str
        Its kind: ".stl", ".obj" or ".glb".
    where : str
        Name of the mesh in messages.

    Raises
    ------
    ShipError
        If the file is corrupt, or its mesh is empty, not finite, not in metres, open, wound
        inconsistently or inside out, or lies under water.
    """
    # Imported where it is used: trimesh takes half a second.
    import trimesh

    parts = _parts(data, suffix, where)
    if not all(np.isfinite(part.vertices).all() for part in parts):
        raise ShipError(f"{where} has vertices that are NaN or infinite, but all must be finite.")
    whole = _merged(trimesh.util.concatenate(parts))
    if len(whole.faces) == 0:
        raise ShipError(f"{where} is empty, but must have facets.")
    extent = float(whole.extents.max())
    if not SMALLEST <= extent <= LARGEST:
        raise ShipError(
            f"{where} is {extent:g} across in its own unit, but must be in metres, "
            f"{SMALLEST:g} to {LARGEST:g} m."
        )
    if whole.vertices[:, 2].max() <= 0:
        raise ShipError(f"{where} lies wholly under water, but only z > 0 m counts.")
    parts = [_merged(part) for part in parts]
    unite = len(parts) > 1 and all(part.is_watertight for part in parts)
    for part in parts if unite else [whole]:
        _check_closed(part, where)
    if not unite and whole.vertices[:, 2].min() >= 0:
        return np.array(whole.vertices, dtype=np.float64), np.array(whole.faces, dtype=np.int32)
    solid = union([_solid(part, where) for part in (parts if unite else [whole])])
    if whole.vertices[:, 2].min() < 0:
        solid = solid.trim_by_plane((0, 0, 1), 0)
    mesh = solid.to_mesh64()
    return np.array(mesh.vert_properties[:, :3]), np.array(mesh.tri_verts, dtype=np.int32)


def _parts(data: bytes, suffix: str, where: str) -> list[trimesh.Trimesh]:
    import trimesh

    kind = suffix.removeprefix(".")
    try:
        scene = trimesh.load_scene(_stream(data, kind), file_type=kind, process=False)
        parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh)]
    except Exception as error:  # parsers raise anything on a corrupt file
        raise ShipError(f"{where} cannot be read as {kind.upper()}: {error!s:.80}.") from None
    if not parts:
        raise ShipError(f"{where} is empty, but must have facets.")
    return parts


def _stream(data: bytes, kind: str) -> io.BytesIO | io.StringIO:
    """Return the file as a stream for trimesh: text formats as text.

    Names and comments in other encodings than UTF-8 are read as Latin-1, in which any bytes are
    text; the geometry itself is ASCII in both.
    """
    if kind == "glb" or (kind == "stl" and _is_binary_stl(data)):
        return io.BytesIO(data)
    try:
        return io.StringIO(data.decode("utf-8-sig"))
    except UnicodeDecodeError:
        return io.StringIO(data.decode("latin-1"))


def _is_binary_stl(data: bytes) -> bool:
    """Return whether the length is that of a header of 80 bytes, a count and facets of 50 bytes."""
    return len(data) == 84 + 50 * int.from_bytes(data[80:84], "little")


def _merged(mesh: Any) -> trimesh.Trimesh:
    """Return a mesh with equal vertices merged and facets of fewer than three vertices dropped."""
    import trimesh

    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    mesh.merge_vertices()
    corners = np.sort(mesh.faces, axis=1)
    mesh.update_faces((np.diff(corners, axis=1) > 0).all(axis=1))
    return mesh


def _check_closed(mesh: trimesh.Trimesh, where: str) -> None:
    if not mesh.is_watertight:
        raise ShipError(f"{where} is open, but must be a closed surface.")
    if not mesh.is_winding_consistent:
        raise ShipError(f"{where} has facets wound both ways, but all must face outward.")
    if mesh.volume <= 0:
        raise ShipError(f"{where} is inside out, but its facets must face outward.")


def _solid(mesh: trimesh.Trimesh, where: str) -> Manifold:
    faces = np.array(mesh.faces, dtype=np.uint64)
    solid = Manifold(Mesh64(np.array(mesh.vertices, dtype=np.float64), faces))
    if solid.status() != Error.NoError:
        raise ShipError(f"{where} is not the surface of a solid, but must be one.")
    return solid

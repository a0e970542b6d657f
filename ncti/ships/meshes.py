"""Meshes of users: STL, OBJ or GLB, transformed to ship axes and checked as they are read."""

from __future__ import annotations

import io
from dataclasses import dataclass, replace
from functools import reduce
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.ships.bodies import Body, closed_bodies
from ncti.ships.errors import ShipError
from ncti.ships.lofting import union
from ncti.ships.orientation import Diagnosis, diagnose
from ncti.ships.transform import Transform

if TYPE_CHECKING:
    import trimesh

MIN_EXTENT, MAX_EXTENT = 1.0, 1000.0  # extent of anything that may pass for a ship in metres [m]
UNITS = {"millimetres": 0.001, "centimetres": 0.01, "inches": 0.0254, "feet": 0.3048}
MIN_SHIP_LENGTH, MAX_SHIP_LENGTH = 10.0, 460.0  # [m]; bounds for guessing the unit


@dataclass(frozen=True, eq=False)
class PlacedMesh:
    """A transformed mesh, and signs that it is not in the ship frame.

    `vertices` (vertex, 3) [m] lie above the waterline; `faces` (facet, 3) are counter-clockwise
    from outside; `diagnosis` also considers the parts below the waterline, and suggests a transform
    of the file; `faults` lists the corrected faults of the file.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    diagnosis: Diagnosis
    faults: tuple[str, ...] = ()


def read(data: bytes, suffix: str, transform: Transform, *, where: str) -> PlacedMesh:
    """Return the mesh of a file: closed, wound outward, above the waterline.

    It unites closed bodies, of one geometry or several, joins geometries that are closed only
    together (a hull split by material), and cuts off parts below the waterline, closing the cut.
    `suffix` is ".stl", ".obj" or ".glb"; `where` names the mesh in messages. Refuses (`ShipError`)
    a file that is corrupt, or a mesh that is empty, not finite, not in metres, open, one-sided,
    without inside, or under water.
    """
    parts = _parts(data, suffix, where)
    if not transform.is_identity:
        with np.errstate(all="ignore"):  # coordinates that are not finite are refused below
            for part in parts:
                part.vertices = transform.apply(part.vertices)
    if not all(np.isfinite(part.vertices).all() for part in parts):
        raise ShipError(f"{where} has vertices that are NaN or infinite, but all must be finite.")
    corners = [part.vertices[part.faces.ravel()] for part in parts if len(part.faces)]
    if not corners:
        raise ShipError(f"{where} is empty, but must have facets.")
    _check_size(np.concatenate(corners), transform.scale, where)
    bodies, faults = _bodies(parts, transform, where)
    return _clip_to_water(bodies, transform, where, faults)


def place(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], transform: Transform, *, where: str
) -> PlacedMesh:
    """Return a built ship, whose surface is closed, after a transform; raises as `read` does."""
    vertices = transform.apply(vertices)
    _check_size(vertices, transform.scale, where)
    return _clip_to_water([Body(vertices, faces.astype(np.int64))], transform, where, ())


def _bodies(
    parts: list[trimesh.Trimesh], transform: Transform, where: str
) -> tuple[list[Body], tuple[str, ...]]:
    """Return the closed bodies of geometries, and the faults corrected in them."""
    import trimesh

    merged = [_merge_vertices(part) for part in parts]
    if len(parts) > 1 and not all(part.is_watertight for part in merged):
        merged = [_merge_vertices(trimesh.util.concatenate(parts))]
    if not sum(len(part.faces) for part in merged):
        raise ShipError(f"{where} is empty, but must have facets.")
    starts = np.cumsum([0, *(len(part.vertices) for part in merged)])
    faces = [part.faces + start for part, start in zip(merged, starts[:-1], strict=True)]
    return closed_bodies(
        np.concatenate([part.vertices for part in merged]),
        np.concatenate(faces),
        where=where,
        locate=transform.undo,
        repair=transform.repair,
    )


def _clip_to_water(
    bodies: list[Body], transform: Transform, where: str, faults: tuple[str, ...]
) -> PlacedMesh:
    """Return the union of bodies above the waterline."""
    merged = reduce(Body.join, bodies)
    low, high = (float(height) for height in merged.bounds[:, 2])
    diagnosis = diagnose(merged.vertices, merged.faces)
    if suggested := diagnosis.suggested_transform:  # of the file, instead of its transform
        suggested = transform.compose(suggested)
        diagnosis = replace(diagnosis, suggested_transform=suggested)
    if high <= 0:
        findings = " and ".join(dict.fromkeys(("lies wholly under water", *diagnosis.findings)))
        advice = f" ({{{suggested}}} would correct that)" if suggested else ""
        raise ShipError(f"{where} {findings}, but only z > 0 m counts{advice}.")
    solid_bodies = [body for body in bodies if body.volume]
    if not solid_bodies:
        raise ShipError(f"{where} has no inside, but must be the surface of a solid.")
    if len(solid_bodies) > 1 or low < 0:
        solid = union([body.solid(where) for body in solid_bodies])
        if low < 0:
            solid = solid.trim_by_plane((0, 0, 1), 0)
        plates = [body for body in bodies if not body.volume and body.bounds[0, 2] >= 0]
        merged = reduce(Body.join, plates, Body.of(solid))
    return PlacedMesh(
        np.array(merged.vertices, dtype=np.float64),
        np.array(merged.faces, dtype=np.int32),
        diagnosis,
        faults,
    )


def _check_size(corners: NDArray[np.float64], scale: float, where: str) -> None:
    """Refuse a mesh too small or large for a ship in metres, and suggest fitting units."""
    extent = float(np.ptp(corners, axis=0).max())
    if MIN_EXTENT <= extent <= MAX_EXTENT:
        return
    guesses = ", ".join(
        f"scale: {scale * unit:g} makes it {extent * unit:.4g} m if it is in {name}"
        for name, unit in UNITS.items()
        if MIN_SHIP_LENGTH <= extent * unit <= MAX_SHIP_LENGTH and scale == 1.0
    )
    unit_note = "in its own unit" if scale == 1.0 else f"with scale {scale:g}"
    raise ShipError(
        f"{where} is {extent:g} across {unit_note}, but must be in metres, {MIN_EXTENT:g} to "
        f"{MAX_EXTENT:g} m{f' ({guesses})' if guesses else ''}."
    )


def _parts(data: bytes, suffix: str, where: str) -> list[trimesh.Trimesh]:
    import trimesh

    kind = suffix.removeprefix(".")
    # A binary STL has a header of 80 bytes, a count and facets of 50 bytes.
    is_binary_stl = len(data) == 84 + 50 * int.from_bytes(data[80:84], "little")
    if kind == "glb" or (kind == "stl" and is_binary_stl):
        stream: io.BytesIO | io.StringIO = io.BytesIO(data)
    else:  # names and comments may be in any encoding; the geometry is ASCII
        stream = io.StringIO(data.decode("utf-8-sig", errors="replace"))
    try:
        scene = trimesh.load_scene(stream, file_type=kind, process=False)
        return [part for part in scene.dump() if isinstance(part, trimesh.Trimesh)]
    except Exception as error:  # parsers raise anything on a corrupt file
        raise ShipError(f"{where} cannot be read as {kind.upper()}: {error!s:.80}.") from None


def _merge_vertices(mesh: Any) -> trimesh.Trimesh:
    """Return a mesh with equal vertices merged and facets of fewer than three vertices dropped."""
    import trimesh

    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    mesh.merge_vertices()
    corners = np.sort(mesh.faces, axis=1)
    mesh.update_faces((np.diff(corners, axis=1) > 0).all(axis=1))
    return mesh


def check_closed(mesh: trimesh.Trimesh, where: str) -> None:
    """Refuse (`ShipError`) a mesh whose bodies are not all closed surfaces with outward facets."""
    closed = mesh.is_watertight and mesh.is_winding_consistent
    if closed and mesh.body_count == 1 and mesh.volume > 0:
        return
    faults = closed_bodies(np.asarray(mesh.vertices), mesh.faces, where=where)[1]
    if faults:
        raise ShipError(f"{where} has {faults[0]}, but must be closed, with outward facets.")

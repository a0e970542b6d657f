"""Closed bodies of a mesh: separated where they touch, turned outward, small openings closed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from manifold3d import Error, Manifold, Mesh64
from numpy.typing import NDArray

from ncti.ships.errors import ShipError
from ncti.ships.surfaces import (
    Faces,
    Floats,
    Openings,
    Surface,
    components,
    neighbours,
    openings,
    surface_of,
    triangle_areas,
)
from ncti.ships.welding import WELD_DISTANCE, count_text, weld_surface

MAX_OPEN = 0.05  # greatest share of the surface in openings that `repair` closes
MIN_THICKNESS = 1e-7  # volume / (surface x longest extent) up to which a body is flat
MAX_EXCESS = 1e-6  # greatest share of a body's volume that rounding leaves outside its container


@dataclass(frozen=True, eq=False)
class Body:
    """A closed surface, with its cavities if it has any.

    `vertices` (vertex, 3) [m]; `faces` (facet, 3) are counter-clockwise from outside.
    """

    vertices: Floats
    faces: Faces

    @classmethod
    def of(cls, solid: Manifold) -> Body:
        """Return the surface of a solid."""
        mesh = solid.to_mesh64()
        return cls(np.array(mesh.vert_properties[:, :3]), np.array(mesh.tri_verts, np.int64))

    @cached_property
    def volume(self) -> float:
        """Volume [m3], negative if the facets face inward; 0 of a plate without thickness."""
        a, b, c = (self.vertices - self.vertices[:1])[self.faces].transpose(1, 0, 2)
        volume = float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6
        extent = float(np.ptp(self.vertices, axis=0).max())
        flat = MIN_THICKNESS * extent * float(triangle_areas(self.vertices[self.faces]).sum())
        return volume if abs(volume) > flat else 0.0

    @cached_property
    def bounds(self) -> Floats:
        """(2, 3) float64 ndarray: least and greatest coordinates [m]."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @property
    def reversed_body(self) -> Body:
        """The body with all facets reversed."""
        return Body(self.vertices, self.faces[:, ::-1])

    def solid(self, where: str = "") -> Manifold:
        """Return the body as a solid; raise `ShipError` if it is not one."""
        faces = np.array(self.faces, dtype=np.uint64)
        solid = Manifold(Mesh64(np.array(self.vertices), faces))
        if solid.status() != Error.NoError or not solid.num_tri():
            raise ShipError(f"{where} is not the surface of a solid, but must be one.")
        return solid

    def join(self, other: Body) -> Body:
        """Return the union of facets of both bodies."""
        return Body(
            np.concatenate([self.vertices, other.vertices]),
            np.concatenate([self.faces, other.faces + len(self.vertices)]),
        )

    def is_within(self, other: Body, where: str) -> bool:
        """Return whether this body lies inside another; both must face outward."""
        if self.volume >= (1 - MAX_EXCESS) * other.volume:
            return False  # the same
        return bool((self.solid(where) - other.solid(where)).volume() <= MAX_EXCESS * self.volume)


@dataclass
class RepairContext:
    """Name and units of a mesh for messages, and the faults corrected so far."""

    where: str  # name of the mesh in messages
    locate: Callable[[Floats], Floats] | None  # from [m] to the file's coordinates
    repair: bool
    faults: list[str] = field(default_factory=list)

    def place(self, points: Floats) -> str:
        """Return the middle of some points in the file's coordinates, as text."""
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        if self.locate is not None:
            middle = self.locate(middle[None])[0]
        # Four digits, without exponents in the coordinates of a map.
        words = ", ".join(f"{float(f'{coordinate:.4g}') + 0.0:.12g}" for coordinate in middle)
        return f"({words})" if self.locate is None else f"({words}) of the file"


def closed_bodies(
    vertices: Floats,
    faces: NDArray[np.integer],
    *,
    where: str,
    locate: Callable[[Floats], Floats] | None = None,
    repair: bool = False,
) -> tuple[list[Body], tuple[str, ...]]:
    """Return the closed bodies of a mesh, wound outward, and its corrected faults.

    Bodies with a volume come first. `vertices` (vertex, 3) [m] and `faces` (facet, 3) have no
    duplicates; z = 0 is the waterline. `where` names the mesh in messages, and `locate` turns
    points into the file's coordinates there. `repair` closes openings of at most `MAX_OPEN` of the
    surface, and any below the waterline. Faults are text, as "1 of 2 bodies inside out". Refuses
    (`ShipError`) a mesh that is open or has a side that is both inner and outer.
    """
    work = RepairContext(where, locate, repair)
    surface = surface_of(vertices, _align_winding(vertices, np.asarray(faces, np.int64), work))
    if surface.open_edges.size:
        surface = _weld(surface, work)
    if surface.open_edges.size:
        surface = _close_openings(surface.split(), work)
    labels = surface.labels()
    by_label = np.argsort(labels, kind="stable")
    members = np.split(by_label, np.flatnonzero(np.diff(labels[by_label])) + 1)
    members = _distinct_bodies(surface.faces, members, work)
    if surface.is_pinched or len(members) > 1:
        surface = surface.split()
    bodies = _orient_outward([_body(surface, facets) for facets in members], work)
    if surface.is_pinched:
        bodies = [_split_pinches(body, where) for body in bodies]
    return bodies, tuple(work.faults)


def _body(surface: Surface, facets: NDArray[np.int64]) -> Body:
    used, faces = np.unique(surface.faces[facets], return_inverse=True)
    return Body(surface.vertices[used], faces.reshape(-1, 3).astype(np.int64))


def _split_pinches(body: Body, where: str) -> Body:
    """Return a body in which exactly two facets meet at each edge, also where it touches itself."""
    if not surface_of(body.vertices, body.faces).is_pinched:
        return body
    if body.volume:
        return Body.of(body.solid(where))
    # A plate: make each triangle a separate plate, with a front and a back.
    corners = body.vertices[np.unique(np.sort(body.faces, axis=1), axis=0)]
    front = np.arange(3 * len(corners)).reshape(-1, 3)
    return Body(corners.reshape(-1, 3), np.concatenate([front, front[:, ::-1]]))


def _align_winding(vertices: Floats, faces: Faces, work: RepairContext) -> Faces:
    """Return facets wound consistently within each body, reversing the minority."""
    first, second, opposed = neighbours(len(vertices), faces)
    if opposed.all():
        return faces
    # Each facet has two nodes, as read and reversed; links join neighbours of equal winding.
    count = len(faces)
    turned = np.where(opposed, 0, count)
    labels = components(
        np.concatenate([first, first + count]),
        np.concatenate([second + turned, second + count - turned]),
        2 * count,
    ).reshape(2, count)
    if one_sided := np.flatnonzero(labels[0] == labels[1]).tolist():
        place = work.place(vertices[faces[one_sided[0]]])
        raise ShipError(
            f"{work.where} has facets wound both ways at {place}, but must have an inner and an "
            "outer side."
        )
    sizes = np.bincount(labels[0], minlength=labels.max() + 1)
    size, turned_size = sizes[labels]
    is_reversed = (size < turned_size) | ((size == turned_size) & (labels[0] > labels[1]))
    place = work.place(vertices[faces[is_reversed][0]])
    work.faults.append(
        f"{count_text(int(is_reversed.sum()), 'facet')} wound the other way than those around "
        f"(the first at {place})"
    )
    return np.where(is_reversed[:, None], faces[:, ::-1], faces)


def _weld(surface: Surface, work: RepairContext) -> Surface:
    """Return a surface welded along open edges, or unchanged if welding makes it one-sided.

    Welding may fold slivers beside an opening onto each other.
    """
    closer, faults = weld_surface(surface)
    try:
        faces = _align_winding(closer.vertices, closer.faces, work)
    except ShipError:
        return surface
    work.faults += faults
    return closer if faces is closer.faces else surface_of(closer.vertices, faces)


def _close_openings(surface: Surface, work: RepairContext) -> Surface:
    """Return a split surface with its openings closed; refuse openings that may not be closed."""
    holes = openings(surface)
    distance = WELD_DISTANCE * float(np.ptp(surface.vertices, axis=0).max())
    wide = np.flatnonzero(2 * holes.areas > distance * holes.perimeters)
    slits = len(holes.loops) - len(wide)
    closed = surface_of(surface.vertices, np.concatenate([surface.faces, *holes.patches]))
    if closed.open_edges.size:
        raise ShipError(f"{work.where} is open at {work.place(closed.corners)}, where no plane is.")
    if slits:
        work.faults.append(f"{count_text(slits, 'slit')} less than {1000 * distance:.2g} mm wide")
    if len(wide):
        work.faults.append(_describe_openings(surface, holes, wide, work))
    return closed


def _describe_openings(
    surface: Surface, holes: Openings, wide: NDArray[np.int64], work: RepairContext
) -> str:
    """Describe the openings in words; refuse the surface if they may not be closed."""
    areas, loops = holes.areas[wide], [holes.loops[number] for number in wide]
    water = WELD_DISTANCE * float(np.ptp(surface.vertices, axis=0).max())
    above_water = np.array([surface.vertices[loop, 2].max() > water for loop in loops])
    total_area = float(triangle_areas(surface.corners).sum() + holes.areas.sum())
    share = float(areas[above_water].sum()) / total_area
    largest = int(np.argmax(areas))
    measures = (
        f"{count_text(len(loops), 'opening')} (above water {100 * share:.2g} % of its surface; the "
        f"largest is {areas[largest]:,.2f} m2, at {work.place(surface.vertices[loops[largest]])})"
    )
    if work.repair and share <= MAX_OPEN:
        return measures
    advice = (
        "repair: true would close it"
        if share <= MAX_OPEN
        else f"repair: true closes at most {100 * MAX_OPEN:g} %; add the missing facets"
    )
    edges = count_text(sum(map(len, loops)), "edge")
    raise ShipError(
        f"{work.where} is open along {edges} in {measures}, but must be a closed surface "
        f"({advice})."
    )


def _distinct_bodies(
    faces: Faces, members: list[NDArray[np.int64]], work: RepairContext
) -> list[NDArray[np.int64]]:
    """Return the facets of each distinct body."""
    if len(members) == 1:
        return members
    known: dict[bytes, NDArray[np.int64]] = {}
    for facets in members:
        corners = np.sort(faces[facets], axis=1)
        known.setdefault(corners[np.lexsort(corners.T)].tobytes(), facets)
    if doubles := len(members) - len(known):
        work.faults.append(f"{count_text(doubles, 'body', 'bodies')} given twice")
    return list(known.values())


def _orient_outward(bodies: list[Body], work: RepairContext) -> list[Body]:
    """Return bodies turned outward, each with its cavities, followed by flat bodies."""
    solids, flat = [body for body in bodies if body.volume], [b for b in bodies if not b.volume]
    inverse = sum(body.volume for body in solids) < 0
    outward = [body if body.volume > 0 else body.reversed_body for body in solids]
    bounds = np.array([body.bounds for body in outward]).reshape(-1, 2, 3)
    outer, cavities, inside_out = [], [], []
    for number, (body, turned) in enumerate(zip(solids, outward, strict=True)):
        around = []
        if (body.volume < 0) != inverse:
            # Bounds exclude most bodies; only the candidates left are compared as solids.
            larger = (bounds[:, 0] <= turned.bounds[0]) & (bounds[:, 1] >= turned.bounds[1])
            candidates = np.flatnonzero(larger.all(axis=1)).tolist()
            around = [
                k for k in candidates if k != number and turned.is_within(outward[k], work.where)
            ]
        if len(around) % 2:
            cavities.append((number, around))
        else:
            outer.append(number)
        if (body.volume < 0) != (len(around) % 2 == 1):
            inside_out.append(number)
    containers = dict(zip(outer, (outward[number] for number in outer), strict=True))
    for number, around in cavities:
        container = min((k for k in around if k in containers), key=lambda k: outward[k].volume)
        containers[container] = containers[container].join(outward[number].reversed_body)
    if inside_out:
        place = work.place(solids[inside_out[0]].vertices)
        work.faults.append(
            "its whole surface inside out"
            if len(inside_out) == len(bodies)
            else f"{len(inside_out)} of {len(bodies)} bodies inside out (the first at {place})"
        )
    return [*containers.values(), *flat]

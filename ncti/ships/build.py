"""Building of ships: components are placed, united, cut, clipped and checked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from manifold3d import Error, Manifold
from numpy.typing import NDArray

from ncti.ships import fittings, solids
from ncti.ships.errors import ShipError, short_repr
from ncti.ships.lofting import union
from ncti.ships.sheets import Component, Part, Sheet

HOUSE_SINK = 0.45  # greatest depth [m] of a base in a deck, which may slope under it
MOUNT_SINK = 0.15  # depth [m] of a mount in its platform
PART_SINK = 0.03  # depth [m] of a template's parts in each other
SLIVER = 1e-4  # tolerance [m] of the simplification that removes slivers where bars cross

MAKERS: dict[str, Callable[..., Manifold]] = {
    "box": solids.box,
    "cyl": solids.cylinder,
    "pole": solids.cylinder,
    "sphere": solids.sphere,
    "ellipsoid": solids.ellipsoid,
    "beam": solids.beam,
    "barrel": solids.barrel,
    "trunnion": solids.trunnion,
    "drum": solids.drum,
    "plate": solids.plate,
    "dish": solids.dish,
    "mesh_dish": solids.mesh_dish,
    "boat": solids.boat,
    "prism": solids.prism,
    "poly": solids.house,
    "yard": solids.yard,
    "lattice": lambda **sizes: solids.Lattice(**sizes).solid(),
    "recess": solids.recess,
    "step": solids.step,
}


@dataclass(frozen=True, eq=False)
class Piece:
    """A component's solid with all its copies, in sheet axes, to be added or cut away."""

    name: str
    solid: Manifold
    cuts: bool


@dataclass(frozen=True, eq=False)
class Ship:
    """A built ship in ship axes.

    `vertices` (n, 3) [m]; `faces` (m, 3) are counter-clockwise from outside; `loa` and `beam` [m]
    are those of the hull itself, without overhanging parts.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    loa: float
    beam: float


def _primitive(part: Part, sink: float) -> Manifold:
    sizes = dict(part.sizes)
    if part.primitive.stands:
        sizes.setdefault("sink", sink)
    return MAKERS[part.prim](**sizes)


@lru_cache(maxsize=256)
def equipment(parts: tuple[Part, ...], *, azimuth: float, sink: float = MOUNT_SINK) -> Manifold:
    """Return equipment about its mount axis, pointing to `azimuth` [deg, 90 to starboard]."""
    primitives = [
        _primitive(part, sink if part.at[2] == 0 else PART_SINK).translate(part.at)
        for part in parts
    ]
    cos, sin = np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth))
    # Columns: directions of u (ahead), v (to its right) and w (up) in sheet axes.
    turn = np.array([[-cos, sin, 0, 0], [sin, cos, 0, 0], [0, 0, 1, 0]])
    return union(primitives).transform(turn)


def _windows(sheet: Sheet, component: Component) -> Manifold:
    sizes = dict(component.sizes)
    name = sizes.pop("host")
    host = next(other for other in sheet.components if other.name == name)
    shape = ("outline", "height", "top_scale", "front_rake")
    plan = solids.house_plan(**{key: host.sizes[key] for key in shape if key in host.sizes})
    sill = component.at[2] - host.at[2]
    return fittings.windows(plan, host.sizes["height"], sill=sill, **sizes)


def _single_copy(sheet: Sheet, component: Component) -> Manifold:
    """Return one copy of a component about its own origin."""
    sizes: dict[str, Any] = dict(component.sizes)
    match component.prim:
        case "eq":
            parts = sheet.templates[sizes.pop("template")]
            return equipment(parts, **sizes)
        case "bulwark":
            return fittings.bulwark(sheet.hull, **sizes)
        case "rail" | "net":
            edge, inset = sizes.pop("edge", None), sizes.pop("inset", 0.1)
            if edge is not None:
                pitch = sizes["pitch"]
                sizes["path"] = fittings.edge_path(sheet.hull, edge, inset=inset, pitch=pitch)
            return fittings.fence(component.prim, **sizes)
        case "windows":
            return _windows(sheet, component)
    return _primitive(component, min(HOUSE_SINK, sizes.get("height", 0.0) / 4))


def copies_of(sheet: Sheet, component: Component) -> list[Manifold]:
    """Return the copies of a component at the sheet's places, without mirror images."""
    single = _single_copy(sheet, component)
    if single.status() != Error.NoError or single.volume() <= 0:
        raise ShipError(
            f"{sheet.name}: component {short_repr(component.name)} is not a solid with these "
            "sizes, but must enclose a volume."
        )
    return [single.translate(np.add(component.at, (*shift, 0.0))) for shift in component.offsets]


def piece(sheet: Sheet, component: Component) -> Piece:
    """Return the solid of one component with all its copies."""
    copies = copies_of(sheet, component)
    if component.mirror:
        copies += [copy.mirror((0, 1, 0)) for copy in copies]
    return Piece(component.name, union(copies), component.primitive.cuts)


def build(sheet: Sheet) -> Ship:
    """Build a ship from its sheet: one watertight solid in ship axes, clipped at the waterline.

    Refuses (`ShipError`) a component with any part that is not connected to the hull.
    """
    hull = sheet.hull.solid()
    pieces = [piece(sheet, component) for component in sheet.components]
    solid = union([hull] + [p.solid for p in pieces if not p.cuts])
    solid -= union([p.solid for p in pieces if p.cuts])
    if solid.bounding_box()[2] < 0:
        solid = solid.trim_by_plane((0, 0, 1), 0)
    mesh = _keep_main_body(sheet, solid, hull, pieces).as_original().simplify(SLIVER).to_mesh64()
    vertices = np.array(mesh.vert_properties[:, :3]) * [-1, -1, 1] + [sheet.hull.loa / 2, 0, 0]
    low, high = np.reshape(hull.bounding_box(), (2, 3))
    loa, beam, _ = high - low
    return Ship(vertices, np.array(mesh.tri_verts, dtype=np.int32), float(loa), float(beam))


def _keep_main_body(sheet: Sheet, solid: Manifold, hull: Manifold, pieces: list[Piece]) -> Manifold:
    """Return the outer shell: fill hidden cavities, and refuse detached components."""
    shells = [shell for shell in solid.decompose() if shell.volume() > 0]
    if not shells:
        raise ShipError(
            f"{sheet.name}: the hull encloses no volume, but its stations must be apart, and each "
            "have a width and a height."
        )
    ship, *loose = sorted(shells, key=Manifold.volume, reverse=True)
    if loose:
        solids = [(p.name, p.solid) for p in pieces if not p.cuts]
        solids.append(("a cut-off part of the hull", hull))
        names = {name for name, part in solids for a in loose if not (part ^ a).is_empty()}
        raise ShipError(
            f"{sheet.name}: {', '.join(sorted(names))} would float in the air, "
            "but every component must be attached to the hull."
        )
    return ship

"""Closed solids in metres, each about its own origin: the primitives of ship sheets.

Every solid is a watertight `manifold3d.Manifold`. A component's axes are x aft, y to starboard
and z up; a template's are u along the pointing axis, v to its right and w up. The functions
serve both: the first axis is `length`, the second `width`, the third `height`.

`sink` extends the base of a standing solid down into its support, so that the union joins them:
solids that only touch remain separate.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from manifold3d import CrossSection, Manifold, triangulate

from ncti.ships.lofting import Points, loft, pitch_points, tube, union


def _round_sides(radius: float) -> int:
    return int(np.select([radius < 0.1, radius < 0.25, radius < 0.5], [8, 12, 16], 32))


# Sections of length and width 1.
SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
_ANGLE = 2 * np.pi * np.arange(48) / 48
CIRCLE = np.column_stack([np.cos(_ANGLE), np.sin(_ANGLE)]) / 2


def _section(
    length: float, width: float, height: float, shift: float = 0.0, shape: Points = SQUARE
) -> Points:
    """Return the corners of a level section at a height: a rectangle, or another shape."""
    plan = shape * [length, width] + [shift, 0]
    return np.column_stack([plan, np.full(len(shape), height)])


def _frustum(
    shape: Points,
    *,
    length: float,
    width: float,
    height: float,
    top_length: float | None = None,
    top_width: float | None = None,
    top_shift: float = 0.0,
    sink: float = 0.0,
) -> Points:
    """Return the lowest and the highest section of a tapered solid."""
    wider = 0.0 if top_width is None else top_width - width
    longer = 0.0 if top_length is None else top_length - length
    return np.array(
        [
            _section(length + t * longer, width + t * wider, t * height, t * top_shift, shape)
            for t in (-sink / height, 1.0)
        ]
    )


def box(*, yaw: float = 0.0, **sizes: float) -> Manifold:
    """Return a box or frustum on its base; `yaw` [deg] turns it as an azimuth, 90 to starboard."""
    cos, sin = np.cos(np.radians(yaw)), np.sin(np.radians(yaw))
    return loft(_frustum(SQUARE, **sizes) @ [[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])


def prism(*, shape: str = "box", **sizes: float) -> Manifold:
    """Return a tapered tower; `shape` "oval" gives it an elliptical section (a mack)."""
    return loft(_frustum(CIRCLE if shape == "oval" else SQUARE, **sizes))


def house_plan(
    outline: Points, height: float, top_scale: float = 1.0, front_rake: float = 0.0
) -> tuple[Points, Points]:
    """Return the bottom and top polygon of a house.

    The top shrinks by `top_scale` about the mean of the corners, and its foremost corners move
    aft by height tan(`front_rake`) [deg]; a negative rake leans the front forward.
    """
    centre = outline.mean(axis=0)
    top = centre + top_scale * (outline - centre)
    foremost = outline[:, 0] < outline[:, 0].min() + 1e-6
    top[foremost, 0] += height * np.tan(np.radians(front_rake))
    return outline, top


def house(
    *,
    outline: Points,
    height: float,
    top_scale: float = 1.0,
    front_rake: float = 0.0,
    sink: float = 0.0,
) -> Manifold:
    """Return a house over a plan polygon, see `house_plan`."""
    bottom, top = house_plan(outline, height, top_scale, front_rake)
    foot = bottom - (top - bottom) * sink / height
    rings = [np.column_stack([p, np.full(len(p), z)]) for p, z in ((foot, -sink), (top, height))]
    return loft(rings, cap=np.asarray(triangulate([bottom]), dtype=np.int64))


def cylinder(
    *, radius: float, height: float, top_radius: float | None = None, sink: float = 0.0
) -> Manifold:
    """Return an upright cylinder, cone or tapered pole."""
    top_radius = radius if top_radius is None else top_radius
    solid = Manifold.cylinder(
        height + sink, radius, top_radius, _round_sides(max(radius, top_radius))
    )
    return solid.translate((0, 0, -sink))


def sphere(*, radius: float) -> Manifold:
    """Return a sphere about its centre."""
    return Manifold.sphere(radius, 48)


def ellipsoid(*, length_radius: float, width_radius: float, height_radius: float) -> Manifold:
    """Return an ellipsoid about its centre."""
    return Manifold.sphere(1.0, 48).scale((length_radius, width_radius, height_radius))


def yard(*, width: float, radius: float) -> Manifold:
    """Return a level tube of full `width` athwart, about its middle."""
    return tube([[0.0, -width / 2, 0.0], [0.0, width / 2, 0.0]], radius, sides=_round_sides(radius))


def beam(*, length: float, width: float, height: float, elevation: float = 0.0) -> Manifold:
    """Return a rectangular beam whose axis starts at the origin and rises at `elevation` [deg]."""
    section = _section(height, width, 0.0)[:, [2, 1, 0]]
    far = section + np.array([length, 0, 0])
    return loft(pitch_points(np.array([section, far]), elevation))


def barrel(*, length: float, radius: float, elevation: float = 0.0) -> Manifold:
    """Return a round bar whose axis starts at the origin and rises at `elevation` [deg]."""
    path = pitch_points([[0.0, 0.0, 0.0], [length, 0.0, 0.0]], elevation)
    return tube(path, radius, sides=max(12, _round_sides(radius)))


def trunnion(*, length: float, radius: float) -> Manifold:
    """Return a round bar from the origin along the second axis (a trunnion)."""
    return tube([[0.0, 0.0, 0.0], [0.0, length, 0.0]], radius, sides=_round_sides(radius))


def drum(*, length: float, radius: float, elevation: float = 0.0) -> Manifold:
    """Return a round bar about its middle, its axis forward and up by `elevation` [deg]."""
    path = pitch_points([[-length / 2, 0.0, 0.0], [length / 2, 0.0, 0.0]], elevation)
    return tube(path, radius, sides=max(24, _round_sides(radius)))


def plate(*, width: float, height: float, thickness: float, tilt: float = 0.0) -> Manifold:
    """Return a flat antenna about its centre, leaned back by `tilt` [deg]."""
    face = _section(height, width, 0.0)[:, [2, 1, 0]]
    half = np.array([thickness / 2, 0, 0])
    return loft(pitch_points(np.array([face - half, face + half]), tilt))


def dish(*, radius: float, depth: float) -> Manifold:
    """Return a paraboloid reflector 0.1 m thick along the first axis, about its rim's centre."""
    across = np.linspace(0, radius, 7)
    bowl = depth * ((across / radius) ** 2 - 1)
    front = np.column_stack([across, bowl])
    back = np.column_stack([across, bowl - 0.1])
    profile = CrossSection([np.concatenate([back, front[::-1]])])
    # Turn by half a step: no corner may lie in a plane of symmetry, where boxes have faces.
    return Manifold.revolve(profile, 32).rotate((0, 0, 180 / 32)).rotate((0, 90, 0))


def mesh_dish(*, width: float, height: float, depth: float, tilt: float = 0.0) -> Manifold:
    """Return an open-work reflector of bars about its vertex, leaned back by `tilt` [deg]."""
    half_width, half_height = width / 2, height / 2

    def bowl(across: Points, up: Points) -> Points:
        along = depth * ((across / half_width) ** 2 + (up / half_height) ** 2)
        return pitch_points(np.column_stack([along, across, up]), tilt)

    def reach(fraction: Points) -> Points:
        return (1 - np.abs(fraction) ** 3) ** (1 / 3)  # a rectangle with well-rounded corners

    angle = 2 * np.pi * np.arange(32) / 32
    cos, sin = np.cos(angle), np.sin(angle)
    rounding = (np.abs(cos) ** 3 + np.abs(sin) ** 3) ** (-1 / 3)
    rim = bowl(half_width * rounding * cos, half_height * rounding * sin)
    bars = [tube(rim, 0.06, closed=True)]
    levels = np.linspace(-1, 1, 2 + round(height / 0.36))[1:-1]
    bars += [
        tube(
            bowl(np.linspace(-1, 1, 9) * half_width * r, np.full(9, level * half_height)),
            0.035,
            sides=4,
        )
        for level, r in zip(levels, reach(levels), strict=True)
    ]
    ribs = np.linspace(-1, 1, 2 + round(width / 0.9))[1:-1]
    bars += [
        tube(
            bowl(np.full(5, rib * half_width), np.linspace(-1, 1, 5) * half_height * r),
            0.05,
            sides=6,
        )
        for rib, r in zip(ribs, reach(ribs), strict=True)
    ]
    return union(bars)


@dataclass(frozen=True, kw_only=True)
class Lattice:
    """An open mast of three or four legs with `bays` storeys of X braces and girths.

    The legs run 0.1 m past the top, into the platform they carry.
    """

    length: float
    width: float
    height: float
    top_length: float
    top_width: float
    leg_radius: float
    brace_radius: float
    legs: int
    bays: int
    top_shift: float = 0.0
    sink: float = 0.0

    def solid(self) -> Manifold:
        """Return the union of legs, braces and girths."""
        base = _section(self.length, self.width, 0.0)
        top = _section(self.top_length, self.top_width, self.height, self.top_shift)
        if self.legs == 3:  # one leg forward, two aft
            base = np.array([base[[0, 3]].mean(axis=0), base[1], base[2]])
            top = np.array([top[[0, 3]].mean(axis=0), top[1], top[2]])
        slope = (top - base) / self.height
        bars = [
            tube([foot - self.sink * s, head + 0.1 * s], self.leg_radius, sides=8)
            for foot, head, s in zip(base, top, slope, strict=True)
        ]
        storeys = np.arange(self.bays + 1) * self.height / self.bays
        for lower, upper in pairwise(base + storeys[:, None, None] * slope):
            for leg in range(self.legs):
                next_leg = (leg + 1) % self.legs
                for ends in (
                    [lower[leg], upper[next_leg]],
                    [lower[next_leg], upper[leg]],
                    [upper[leg], upper[next_leg]],
                ):
                    bars.append(tube(ends, self.brace_radius))
        return union(bars)


def boat(*, length: float, width: float, height: float) -> Manifold:
    """Return a double-ended whaleboat standing on its keel."""
    along = np.linspace(-1, 1, 13)
    fullness = np.maximum(1 - along**4, 0.05)
    angle = np.linspace(-np.pi, 0, 9)
    sheer = height * (0.85 + 0.15 * along**2)
    rings = np.stack(
        [
            np.broadcast_to(along[:, None] * length / 2, (13, 9)),
            width / 2 * fullness[:, None] * np.cos(angle),
            sheer[:, None] * (1 + np.sin(angle) * np.sqrt(fullness)[:, None]),
        ],
        axis=-1,
    )
    return loft(rings)


def recess(*, length: float, width: float, height: float, face: str = "aft") -> Manifold:
    """Return the volume to cut for a recess open on the side `face`, extended 0.2 m outward.

    `length` is fore-aft, `width` athwart; the origin is the middle of the sill.
    """
    air = 0.2
    low, high = {
        "aft": ((-length, -width / 2), (air, width / 2)),
        "fore": ((-air, -width / 2), (length, width / 2)),
        "starboard": ((-length / 2, -width), (length / 2, air)),
        "port": ((-length / 2, -air), (length / 2, width)),
    }[face]
    size = (high[0] - low[0], high[1] - low[1], height)
    return Manifold.cube(size).translate((*low, 0.0))


def step(*, length: float, width: float, height: float) -> Manifold:
    """Return the volume to cut aft of a break of deck, which leaves a vertical face."""
    return Manifold.cube((length, width, height)).translate((0.0, -width / 2, 0.0))

"""Variants of ships: sheets perturbed within their stated uncertainty.

Components that touch in a sheet must touch in its variants. So one warp moves the sheet's whole
space first, and components then move with their supports. A variant is built like any sheet.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from manifold3d import Manifold
from numpy.typing import NDArray

from ncti.ships.build import Ship, build, copies_of
from ncti.ships.errors import ShipError, short_repr
from ncti.ships.hull import Hull
from ncti.ships.sheets import Component, Sheet

Floats = NDArray[np.float64]

MAX_DRAWS = 100  # of draws for a variant, until one builds
MIN_SIGMA_SCALE, MAX_SIGMA_SCALE = 0.001, 4.0  # beyond, warps would fold
MIN_SIZE, MAX_SIZE = 0.5, 2.0
MAX_SIGMAS = 2.0  # sigmas at which deviates of places and sizes are clipped
ACROSS_RATIO, UPWARD_RATIO = 0.5, 0.7  # sigma in y and z, in terms of that in x: `sheets/README.md`
MODES = 6  # half waves along the ship of the displacement common to its parts
SHEER_MODES = 2  # of heights, so that a component on two neighbours still stands on both
FULL_SIGMA_HEIGHT = 10.0  # height [m] from which heights vary by their full sigma
OFFSET_SIGMA = 0.03  # sigma of half-breadths, relative: 0.2 m of generic lines
MIN_CONTACT = 0.5  # least share of the contact with its support that a moved component keeps
HALVINGS = 5

# Sizes along x, y and z of primitives that stretch with the space about them. Equipment does not,
# as the sizes of its type are known, nor do bars and bodies of revolution.
LENGTH_KEYS = ("length", "top_length", "top_shift")
BREADTH_KEYS = ("width", "top_width")
STRETCHED = ("box", "prism", "poly", "lattice", "recess", "step", "yard", "cyl", "pole")
# Sizes of a component that supports nothing have an error of their own.
SIZE_KEYS = ("length", "width", "height", "top_length", "top_width", "radius", "top_radius")
RESIZED = ("box", "prism", "cyl", "pole", "sphere", "yard")


def variant_error(name: str) -> ShipError:
    """Return the error for a name with '@' that is not a valid name of a variant."""
    return ShipError(
        f"variant {short_repr(name)} must be SHIP@SEED.NUMBER, numbered from 1 on, or "
        "SHIP@SEED.NUMBERxSCALEsSIZE, without needless digits."
    )


@dataclass(frozen=True)
class Variant:
    """Name of a variant: a packaged ship, seed, number from 1, scale of uncertainties, and size.

    The size is relative to the ship's, the same along all axes.
    """

    base: str
    seed: int
    number: int
    scale: float = 1.0
    size: float = 1.0

    def __str__(self) -> str:
        scale_suffix = "" if self.scale == 1 else f"x{self.scale:g}"
        size_suffix = "" if self.size == 1 else f"s{self.size:g}"
        return f"{self.base}@{self.seed}.{self.number}{scale_suffix}{size_suffix}"

    @classmethod
    def parse(cls, name: str) -> Variant | None:
        """Return the variant of a name, None if it has another form; refuse invalid values."""
        decimal = r"(\d{1,8}(?:\.\d{1,8})?)"
        pattern = rf"([^@]*)@(\d{{1,18}})\.(\d{{1,18}})(?:x{decimal})?(?:s{decimal})?"
        match = re.fullmatch(pattern, name)
        if match is None:
            return None
        base, seed, number, scale, size = match.groups(default="1")
        variant = cls(base, int(seed), int(number), float(scale), float(size))
        if str(variant) != name or variant.number < 1:
            raise variant_error(name)
        for key, factor, low, high in (
            ("scale", variant.scale, MIN_SIGMA_SCALE, MAX_SIGMA_SCALE),
            ("size", variant.size, MIN_SIZE, MAX_SIZE),
        ):
            if not low <= factor <= high:
                raise ShipError(
                    f"variant {short_repr(name)} has the {key} {factor:g}, but must have one "
                    f"between {low:g} and {high:g}."
                )
        return variant

    def stream(self, attempt: int) -> np.random.Generator:
        """Return the random stream of an attempt, the same for any scale and size."""
        ship = int.from_bytes(hashlib.sha256(self.base.encode()).digest()[:8])
        return np.random.default_rng([ship, self.seed, self.number, attempt])


@dataclass(frozen=True, eq=False)
class SupportTree:
    """Tree of the components of a sheet, each on the one that supports it; the hull is its root.

    `order` has the numbers of all components, each after its support; `support` the number of each
    component's support, -1 for the hull; `contact` the volume that each copy shares with it [m^3].
    """

    order: tuple[int, ...]
    support: tuple[int, ...]
    contact: tuple[Floats, ...]

    def ancestors(self) -> tuple[int, ...]:
        """Return for each component its ancestor on the hull, which may be the component itself."""
        roots = list(range(len(self.order)))
        for number in self.order:
            if self.support[number] >= 0:
                roots[number] = roots[self.support[number]]
        return tuple(roots)

    def sigmas(self, sheet: Sheet) -> Floats:
        """Return for each component the least sigma of itself and all components on it [m]."""
        smallest = np.array([component.sigma for component in sheet.components])
        for number in reversed(self.order):
            support = self.support[number]
            if support >= 0:
                smallest[support] = min(smallest[support], smallest[number])
        return smallest


def _shared_volumes(copies: list[Manifold], bearers: list[Manifold]) -> Floats:
    """Return the volume that each copy has in common with its support [m^3]."""
    return np.array([sum((copy ^ bearer).volume() for bearer in bearers) for copy in copies])


def _bounds(solids: list[Manifold]) -> Floats:
    """(2, 3) least and greatest coordinates of solids [m]."""
    boxes = np.reshape([solid.bounding_box() for solid in solids], (-1, 2, 3))
    return np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def support_tree(sheet: Sheet) -> SupportTree:
    """Return the supports of a ship's components by their strongest contacts.

    They form the maximum spanning tree by common volume, grown from the hull (Prim's algorithm).
    Cuts support nothing. The hull supports a component that touches nothing.
    """
    count = len(sheet.components)
    solids = [copies_of(sheet, component) for component in sheet.components]
    solids.append([sheet.hull.solid()])
    low, high = np.array([_bounds(copies) for copies in solids]).transpose(1, 0, 2)
    touching = (low[:, None] <= high[None]).all(axis=-1)
    touching &= touching.T

    def shared_volume(number: int, other: int) -> Floats:
        if not touching[number, other]:
            return np.zeros(len(solids[number]))
        return _shared_volumes(solids[number], solids[other])

    support, contact = [-1] * count, [shared_volume(number, -1) for number in range(count)]
    remaining, order = set(range(count)), []
    while remaining:
        best = max(remaining, key=lambda number: (contact[number].sum(), -number))
        remaining.remove(best)
        order.append(best)
        if sheet.components[best].primitive.cuts:
            continue
        for number in remaining:
            volumes = shared_volume(number, best)
            if volumes.sum() > contact[number].sum():
                support[number], contact[number] = best, volumes
    return SupportTree(tuple(order), tuple(support), tuple(contact))


@dataclass(frozen=True, eq=False)
class _Wave:
    """A smooth displacement along the ship, zero at both ends, of a stated sigma between them."""

    length: float
    amplitudes: Floats

    @classmethod
    def draw(
        cls, rng: np.random.Generator, length: float, sigma: float, modes: int = MODES
    ) -> _Wave:
        wave = cls(length, sigma * np.sqrt(2 / modes) * rng.standard_normal(modes))
        highest = np.abs(wave(np.linspace(0, length, 200))).max()
        beyond = max(1.0, highest / (MAX_SIGMAS * sigma)) if sigma else 1.0
        return replace(wave, amplitudes=wave.amplitudes / beyond)

    def __call__(self, x: Any) -> Floats:
        share = np.clip(np.asarray(x, dtype=np.float64) / self.length, 0, 1)
        half_waves = np.arange(1, len(self.amplitudes) + 1)
        return np.sin(np.pi * share[..., None] * half_waves) @ self.amplitudes


@dataclass(frozen=True, eq=False)
class _Warp:
    """A smooth map of the sheet's space on to itself, odd in y; ends, keel and beam stay."""

    hull: Hull
    along: _Wave
    across: _Wave
    upward: _Wave
    deck: _Wave
    water: _Wave

    @classmethod
    def draw(cls, rng: np.random.Generator, hull: Hull, sigma: float, scale: float) -> _Warp:
        return cls(
            hull,
            along=_Wave.draw(rng, hull.loa, sigma),
            across=_Wave.draw(rng, hull.loa, ACROSS_RATIO * sigma),
            upward=_Wave.draw(rng, hull.loa, UPWARD_RATIO * sigma, modes=SHEER_MODES),
            deck=_Wave.draw(rng, hull.loa, OFFSET_SIGMA * scale),
            water=_Wave.draw(rng, hull.loa, OFFSET_SIGMA * scale),
        )

    def x(self, x: Any) -> Floats:
        return np.asarray(x, dtype=np.float64) + self.along(x)

    def z(self, x: Any, z: Any) -> Floats:
        height = np.asarray(z, dtype=np.float64)
        return height + self.upward(x) * np.clip(height / FULL_SIGMA_HEIGHT, 0, 1)

    def half(self, x: Any, half: Floats, wave: _Wave) -> Floats:
        """Return warped half-breadths; the widest stays, which preserves the beam of the hull."""
        widest = self.hull.stations[:, 2].max()
        return half * (1 + wave(x) * np.clip(1 - half / widest, 0, 1))

    def y(self, x: Any, y: Any) -> Floats:
        """Return y warped within the hull, and scaled with the deck edge."""
        edge, _ = self.hull.deck_edge(x)
        edge = np.maximum(edge, 0.5)
        share = np.abs(np.asarray(y, dtype=np.float64)) / edge
        inside = np.clip(share, 0, 1)
        moved = share * edge + self.across(x) * 2.6 * inside * (1 - inside**2)
        moved = np.maximum(moved, 0) * self.half(x, edge, self.deck) / edge
        return np.sign(y) * moved

    def lines(self) -> Hull:
        """Return the warped hull."""
        x, deck, half, water = self.hull.stations.T
        stations = np.column_stack(
            [
                self.x(x),
                self.z(x, deck),
                self.half(x, half, self.deck),
                self.half(x, water, self.water),
            ]
        )
        return replace(
            self.hull,
            stations=stations,
            stem_foot=float(self.x(self.hull.stem_foot)),
            transom_head=float(self.z(self.hull.loa, self.hull.transom_head)),
        )


def _midpoint(component: Component) -> float:
    """Return the middle of a component along the ship [m]."""
    for key in ("outline", "path"):
        if key in component.sizes:
            return float(component.sizes[key][:, 0].mean())
    return component.at[0]


def _stretch(component: Component, warp: _Warp, column: float) -> tuple[float, float, float]:
    """Return the stretch of the space about a component along x, y and z."""
    (x, y, z), sizes = component.at, component.sizes
    length, width, height = (sizes.get(key, 0.1) for key in ("length", "width", "height"))
    along = np.ptp(warp.x([x - length / 2, x + length / 2])) / length
    across = np.ptp(warp.y(column, [y - width / 2, y + width / 2])) / width
    up = np.ptp(warp.z(column, [z, z + height])) / height
    return float(along), float(across), float(up)


def _warp_component(component: Component, warp: _Warp, column: float) -> Component:
    """Return a component moved and stretched by the warp.

    `column` is the place along the ship [m] of its support on the hull: the warp there moves
    heights and breadths, so that stacked components stay stacked.
    """
    (x, y, z), sizes = component.at, dict(component.sizes)
    position = (
        float(warp.x(x)) if "x" in component.primitive.place else x,
        float(warp.y(column, y)) if "y" in component.primitive.place else y,
        float(warp.z(column, z)) if "z" in component.primitive.place else z,
    )
    if component.prim in STRETCHED:
        along, across, up = _stretch(component, warp, column)
        factors = (
            dict.fromkeys(LENGTH_KEYS, along) | dict.fromkeys(BREADTH_KEYS, across) | {"height": up}
        )
        sizes |= {key: size * factors[key] for key, size in sizes.items() if key in factors}
    if "outline" in sizes:
        px, py = sizes["outline"].T
        sizes["outline"] = np.column_stack([warp.x(px), warp.y(column, py)])
    if "path" in sizes:
        px, py, pz = sizes["path"].T
        sizes["path"] = np.column_stack([warp.x(px), warp.y(column, py), warp.z(column, pz)])
    for key, end in (("stem_top", 0), ("aft_top", 1)):
        if key in sizes:
            sizes[key] = float(warp.z(sizes["edge"][end], sizes[key]))
    if "edge" in sizes:
        sizes["edge"] = tuple(map(float, warp.x(sizes["edge"])))
    if "end" in sizes:
        sizes["end"] = float(warp.x(sizes["end"]))
    px, py = np.add(component.offsets, (x, y)).T
    moved = np.column_stack([warp.x(px), warp.y(column, py)])
    offsets = tuple((float(dx), float(dy)) for dx, dy in moved - moved[0])
    return replace(component, at=position, sizes=sizes, offsets=offsets)


def _move_component(component: Component, shift: Floats) -> Component:
    """Return a component moved by (x, y, z) [m]."""
    sizes = dict(component.sizes)
    movable = [axis in component.primitive.place for axis in "xyz"]
    if "outline" in sizes:
        sizes["outline"] = sizes["outline"] + shift[:2]
    if "path" in sizes:
        sizes["path"] = sizes["path"] + shift
    x, y, z = map(float, component.at + np.where(movable, shift, 0))
    return replace(component, at=(x, y, z), sizes=sizes)


def _is_amidships(component: Component) -> bool:
    """Return whether a component stands on the centreline, from which it must not move."""
    if "outline" in component.sizes:
        return bool(abs(component.sizes["outline"][:, 1].mean()) < 0.01)
    return component.at[1] == 0 and "path" not in component.sizes


def _resize_component(component: Component, factor: float, beam: float) -> Component:
    """Return a component that is larger by a factor, but does not reach beyond the beam."""
    if abs(component.at[1]) + component.sizes.get("width", 0.0) * factor / 2 > beam / 2:
        factor = min(factor, 1.0)
    sizes = {
        key: size * factor if key in SIZE_KEYS else size for key, size in component.sizes.items()
    }
    return replace(component, sizes=sizes)


def perturb_sheet(
    sheet: Sheet, support_tree: SupportTree, *, rng: np.random.Generator, scale: float
) -> Sheet:
    """Return a sheet with places and sizes moved within their uncertainty, times `scale`.

    Hull length, beam and components stay; the draw is the same for any scale. The sheet need not
    build: thin contacts may be torn apart. The move of a component relative to its support is
    halved until each copy keeps half of its contact with the support and none reaches farther out
    than the hull, or than before; if `HALVINGS` attempts fail, the component does not move relative
    to its support. Refuses (`ShipError`) a warp that folds the hull.
    """
    common = scale * min((component.sigma for component in sheet.components), default=0.5)
    warp = _Warp.draw(rng, sheet.hull, common, scale)
    if (np.diff(warp.x(sheet.hull.stations[:, 0])) <= 0).any():
        raise ShipError(f"{sheet.name}: a warp of scale {scale:g} folds the hull.")
    warped = replace(sheet, hull=warp.lines())
    hull = [warped.hull.solid()]
    sigma, roots = scale * support_tree.sigmas(sheet), support_tree.ancestors()
    places = np.clip(rng.standard_normal((len(sigma), 2)), -MAX_SIGMAS, MAX_SIGMAS)
    places[:, 1] *= ACROSS_RATIO
    sizes = np.clip(rng.standard_normal(len(sigma)), -MAX_SIGMAS, MAX_SIGMAS)
    moves, components, solids = np.zeros((len(sigma), 2)), list(sheet.components), {-1: hull}

    def place(number: int, move: Floats) -> Component:
        component, column = sheet.components[number], _midpoint(sheet.components[roots[number]])
        plan = move if roots[number] == number else moves[roots[number]]
        # Rise of the deck between the foot's place after the warp alone and its final place.
        _, before = sheet.hull.deck_edge(column)
        _, after = warped.hull.deck_edge(warp.x(column) + plan[0])
        rise = float(after - warp.z(column, before))
        changed = _move_component(_warp_component(component, warp, column), np.array([*move, rise]))
        if number not in support_tree.support and component.prim in RESIZED:
            factor = float(np.exp(scale * component.size_sigma * sizes[number]))
            changed = _resize_component(changed, factor, 2 * sheet.hull.stations[:, 2].max())
        return changed

    def keeps_contact(number: int, room: Floats, copies: list[Manifold]) -> bool:
        low, high = room
        reach = _bounds(copies)[:, :2]
        if (reach[0] < low).any() or (reach[1] > high).any():
            return False
        contact = _shared_volumes(copies, solids[support_tree.support[number]])
        return bool((contact >= MIN_CONTACT * support_tree.contact[number]).all())

    for number in support_tree.order:
        component, support = sheet.components[number], support_tree.support[number]
        base = moves[support] if support >= 0 else np.zeros(2)
        below = max(common, sigma[support]) if support >= 0 else common
        shift = places[number] * max(0.0, sigma[number] ** 2 - below**2) ** 0.5
        if _is_amidships(component):
            base, shift = base * [1, 0], shift * [1, 0]
        if component.primitive.cuts or "edge" in component.sizes:
            shift[:] = 0.0  # the deck's edge, or the body they are cut from, fixes their place
        if shift.any():
            base_copies = copies_of(warped, place(number, base))
            room = _bounds([*hull, *base_copies])[:, :2]
            halved = (shift / 2**halving for halving in range(HALVINGS))
            placed = ((move, copies_of(warped, place(number, base + move))) for move in halved)
            fitting = (move for move, copies in placed if keeps_contact(number, room, copies))
            shift = next(fitting, np.zeros(2))
        moves[number] = base + shift
        components[number] = place(number, moves[number])
        if number in support_tree.support:
            solids[number] = copies_of(warped, components[number])
    return replace(warped, components=tuple(components))


def build_variant(sheet: Sheet, support_tree: SupportTree, variant: Variant) -> Ship:
    """Return the ship of the first attempt that builds; `ShipError` if none does.

    Ship, seed, number and attempt key the stream of an attempt.
    """
    for attempt in range(MAX_DRAWS):
        try:
            rng = variant.stream(attempt)
            ship = build(perturb_sheet(sheet, support_tree, rng=rng, scale=variant.scale))
        except ShipError:
            continue
        size = variant.size
        return Ship(ship.vertices * size, ship.faces, ship.loa * size, ship.beam * size)
    raise ShipError(
        f"{variant}: none of {MAX_DRAWS} draws of scale {variant.scale:g} gives one whole ship, so "
        "the scale must be smaller."
    )

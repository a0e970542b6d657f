"""Reading of ship sheets into checked, frozen dataclasses; `sheets/README.md` has the rules.

Errors in a sheet are found here, before any solid is built: a `ShipError` names the value and the
allowed ones.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from ncti.ships import checks
from ncti.ships.documents import read
from ncti.ships.errors import ShipError, short_repr
from ncti.ships.hull import Hull
from ncti.ships.vocabulary import (
    COPIES,
    KEYS,
    PARTS,
    PRIMITIVES,
    PRINCIPAL,
    REMARKS,
    SHEET,
    TEMPLATE,
    UNCERTAINTY,
    Primitive,
)


@dataclass(frozen=True, eq=False)
class Part:
    """A primitive, its place [m], and the keyword arguments of its builder."""

    prim: str
    at: tuple[float, float, float]
    sizes: Mapping[str, Any]

    @property
    def primitive(self) -> Primitive:
        """Primitive of the part: the coordinates that place it, and whether it stands or cuts."""
        return PRIMITIVES[self.prim]


@dataclass(frozen=True, eq=False)
class Component(Part):
    """A named part of a ship with its copies: plan offsets [m], mirrored or not.

    `sigma` is the uncertainty of its place along x [m], `size_sigma` that of its sizes, relative.
    """

    name: str
    offsets: tuple[tuple[float, float], ...]
    mirror: bool
    sigma: float
    size_sigma: float


@dataclass(frozen=True, eq=False)
class Sheet:
    """Content of a sheet, in sheet axes."""

    name: str
    hull: Hull
    components: tuple[Component, ...]
    templates: Mapping[str, tuple[Part, ...]]


def _value(where: str, key: str, value: Any, check: checks.Check) -> Any:
    try:
        return check(value)
    except checks.RefusedValueError as allowed:
        raise ShipError(
            f"{where}: '{key}' is {short_repr(value)}, but must be {allowed}."
        ) from None


def _mapping(where: str, value: Any, needs: frozenset[str]) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ShipError(f"{where}: must be a mapping of keys to values, not {short_repr(value)}.")
    for key in sorted(needs - value.keys()):
        raise ShipError(f"{where}: '{key}' is missing; required are {', '.join(sorted(needs))}.")
    return value


def _checked_mapping(
    where: str, value: Any, keys: tuple[frozenset[str], frozenset[str]]
) -> dict[str, Any]:
    """Return a mapping that has all keys of the first set, and others only of the second."""
    mapping = _mapping(where, value, keys[0])
    for key in sorted(mapping.keys() - keys[0] - keys[1], key=str):
        allowed = ", ".join(sorted(keys[0] | keys[1]))
        raise ShipError(f"{where}: {short_repr(key)} is not a key here; allowed are {allowed}.")
    return mapping


def _sizes(where: str, prim: str, entry: Mapping[str, Any]) -> dict[str, Any]:
    sizes = {KEYS[key].parameter: _value(where, key, entry[key], KEYS[key].check) for key in entry}
    if prim == "bulwark" and sizes["end"] <= sizes["edge"][1]:
        raise ShipError(f"{where}: 'x_end' is {sizes['end']:g}, but must be aft of 'edge'.")
    if prim in ("rail", "net") and ("path" in sizes) == ("edge" in sizes):
        raise ShipError(f"{where}: {prim} needs either 'path' or 'edge', and not both.")
    return sizes


def _check_primitive(where: str, value: Any, known: Mapping[str, Primitive]) -> str:
    if not isinstance(value, str) or value not in known:
        raise ShipError(
            f"{where}: unknown primitive {short_repr(value)}, known are {', '.join(known)}."
        )
    return value


def _templates(where: str, value: Any) -> dict[str, tuple[Part, ...]]:
    templates = {}
    for name, entry in _mapping(f"{where}: templates", value, frozenset()).items():
        place = f"{where}: template {short_repr(name)}"
        parts = _checked_mapping(place, entry, TEMPLATE)["parts"]
        if not isinstance(parts, list) or not parts:
            raise ShipError(f"{place}: 'parts' must be a list of [prim, u, v, w, sizes].")
        templates[str(name)] = tuple(_template_part(place, part) for part in parts)
    return templates


def _template_part(where: str, part: Any) -> Part:
    if not isinstance(part, list) or len(part) != 5:
        raise ShipError(f"{where}: a part must be [prim, u, v, w, sizes], not {short_repr(part)}.")
    prim = _check_primitive(where, part[0], PARTS)
    position = tuple(
        _value(where, key, value, checks.number)
        for key, value in zip("uvw", part[1:4], strict=True)
    )
    sizes = _checked_mapping(where, part[4], (PARTS[prim].needs, PARTS[prim].may))
    return Part(prim, position, _sizes(where, prim, sizes))


def _component(where: str, value: Any, templates: Mapping[str, Any]) -> Component | None:
    entry = _mapping(where, value, frozenset({"name", "prim", "src"}))
    name = _value(where, "name", entry["name"], checks.text)
    where = f"{where} {short_repr(name)}"
    place_sigma, size_sigma = _uncertainty(_value(where, "src", entry["src"], checks.text))
    prim = _check_primitive(where, entry["prim"], PRIMITIVES)
    needs, may, place = PRIMITIVES[prim].needs, PRIMITIVES[prim].may, PRIMITIVES[prim].place
    copies = COPIES if place == "xyz" else frozenset({"mirror"})
    required = needs | {"name", "prim", "src", *place}
    _checked_mapping(where, entry, (required, may | REMARKS | copies))
    x, y, z = (
        _value(where, key, entry[key], checks.number) if key in place else 0.0 for key in "xyz"
    )
    sizes = _sizes(where, prim, {key: entry[key] for key in entry if key in needs | may})
    if prim == "eq" and sizes["template"] not in templates:
        known = ", ".join(sorted(templates))
        raise ShipError(
            f"{where}: unknown template {short_repr(sizes['template'])}, known are {known}."
        )
    count = _value(where, "n", entry.get("n", 1), checks.count)
    pitch = _value(where, "dx_n", entry.get("dx_n", 0.0), checks.number)
    if count > 1 and pitch == 0:
        raise ShipError(f"{where}: 'n' is {count}, so 'dx_n' must be their distance in metres.")
    offsets = [(k * pitch, 0.0) for k in range(count)]
    if "repeat" in entry:
        repeats = _value(
            where, "repeat", entry["repeat"], partial(checks.points, columns=2, rows=1)
        )
        offsets += [(float(px) - x, float(py) - y) for px, py in repeats]
    component = Component(
        prim=prim,
        at=(x, y, z),
        sizes=sizes,
        name=name,
        offsets=tuple(offsets),
        mirror=_value(where, "mirror", entry.get("mirror", False), checks.flag),
        sigma=_value(where, "unc", entry.get("unc", place_sigma), checks.spread),
        size_sigma=size_sigma,
    )
    fitted = _value(where, "fitted", entry.get("fitted", True), checks.flag)
    return component if fitted else None


def _uncertainty(src: str) -> tuple[float, float]:
    """Return the uncertainty of place [m] and sizes (relative) of the least certain tag."""
    tags = [UNCERTAINTY[tag] for tag in re.findall(r"\b[PMGE]\b", src)]
    place, size = np.max(tags or [UNCERTAINTY["E"]], axis=0)
    return float(place), float(size)


def _hull(where: str, sheet: Mapping[str, Any]) -> Hull:
    place = f"{where}: principal"
    principal = _checked_mapping(place, sheet["principal"], PRINCIPAL)
    loa, beam, stem_foot = (
        _value(place, key, principal[key], checks.size)
        for key in ("LOA", "beam_max", "stem_at_wl_x")
    )
    head_x, head_z = _value(place, "transom_head", principal["transom_head"], checks.pair)
    key, upright = "transom_angle_from_vertical", partial(checks.number, low=0.0, high=80.0)
    angle = _value(place, key, principal[key], upright)
    stations = _stations(where, sheet["stations"])
    first, last = stations[0, 0], stations[-1, 0]
    if first != 0 or abs(last - loa) > 0.01:
        raise ShipError(
            f"{where}: stations run from {first:g} to {last:g}, "
            f"but must run from 0 to LOA, {loa:g}."
        )
    if abs(head_x - loa) > 0.01:
        raise ShipError(f"{place}: 'transom_head' is at {head_x:g}, but must be at LOA, {loa:g}.")
    widest = 2 * np.nanmax(stations[:, 2:])
    if abs(widest - beam) > 0.1:
        raise ShipError(
            f"{where}: the widest station is {widest:g}, but must be beam_max, {beam:g}."
        )
    if stem_foot >= loa:
        raise ShipError(
            f"{place}: 'stem_at_wl_x' is {stem_foot:g}, but must be less than LOA, {loa:g}."
        )
    return Hull(loa, stations, stem_foot, head_z, angle)


def _stations(where: str, table: Any) -> np.ndarray:
    where = f"{where}: stations"
    if not isinstance(table, list) or any(not isinstance(s, list) or len(s) != 4 for s in table):
        raise ShipError(f"{where} must be a list of [x, deck z, half-breadth, half-breadth at WL].")
    height = partial(checks.number, low=0.3, high=50.0)
    breadth = partial(checks.number, low=0.01, high=50.0)
    rows = [
        (
            _value(where, "x", x, checks.number),
            _value(where, "deck z", deck, height),
            _value(where, "half-breadth", half, breadth),
            np.nan if water is None else _value(where, "half-breadth at WL", water, breadth),
        )
        for x, deck, half, water in table
    ]
    stations = np.array(rows).reshape(-1, 4)
    wet = np.flatnonzero(~np.isnan(stations[:, 3]))
    if len(wet) < 2 or len(wet) != wet[-1] - wet[0] + 1:
        raise ShipError(f"{where} must reach the waterline at two or more neighbouring sections.")
    for before, after in pairwise(stations[:, 0]):
        if not after - before > 1e-12:  # so that slopes are finite
            raise ShipError(f"{where}: x must grow, but {after:g} follows {before:g}.")
    return stations


def parse(text: str, templates: str, *, where: str) -> Sheet:
    """Return the sheet of a YAML text; `sheets/README.md` has its rules.

    `templates` is the YAML of common equipment templates; templates of the sheet add to them or
    replace them. `where` names the sheet in messages. Refuses (`ShipError`) a key that is missing,
    unknown or given twice, or a wrong value.
    """
    sheet = _checked_mapping(where, read(where, text), SHEET)
    known = _templates("templates", read("templates", templates))
    known |= _templates(where, sheet.get("templates", {}))
    hull = _hull(where, sheet)
    if not isinstance(sheet["components"], list):
        raise ShipError(f"{where}: 'components' must be a list.")
    listed = [_component(f"{where}: component", entry, known) for entry in sheet["components"]]
    components = tuple(component for component in listed if component is not None)
    houses = {component.name for component in components if component.prim == "poly"}
    for component in components:
        host = component.sizes.get("host")
        if host is not None and host not in houses:
            raise ShipError(
                f"{where}: component {short_repr(component.name)}: 'house' is {short_repr(host)}, "
                f"but must be the name of a poly: {', '.join(sorted(houses)) or 'there is none'}."
            )
    return Sheet(_value(where, "name", sheet["name"], checks.text), hull, components, known)

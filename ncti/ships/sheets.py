"""Ship sheets: YAML text in, checked and frozen dataclasses out. `sheets/README.md` has the rules.

Nothing is built here. Everything a user can get wrong in a sheet is refused here, before any
solid is made, by a `ShipError` that names the value and what is allowed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import yaml
from manifold3d import CrossSection

from ncti.ships.errors import ShipError
from ncti.ships.hull import Hull

Check = Callable[[Any], Any]


class Refused(Exception):
    """What is allowed, raised by the check of one value."""


def _number(value: Any, low: float = -1000.0, high: float = 1000.0) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise Refused("a finite number")
    if not low <= value <= high:
        raise Refused(f"between {low:g} and {high:g}")
    return float(value)


_size = partial(_number, low=0.001, high=500.0)  # [m]
_angle = partial(_number, low=-360.0, high=360.0)  # [deg]
_slope = partial(_number, low=-80.0, high=80.0)  # [deg]


def _count(value: Any, low: int = 1, high: int = 100) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise Refused(f"a whole number between {low} and {high}")
    return value


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise Refused("true or false")
    return value


def _text(value: Any) -> str:
    if not isinstance(value, str) or not value:
        raise Refused("a text")
    return value


def _one_of(*names: str) -> Check:
    def check(value: Any) -> str:
        if value not in names:
            raise Refused(" or ".join(names))
        return value

    return check


def _points(value: Any, *, columns: int, rows: int) -> np.ndarray:
    if not isinstance(value, list) or len(value) < rows:
        raise Refused(f"a list of at least {rows} points")
    if any(not isinstance(point, list) or len(point) != columns for point in value):
        raise Refused(f"a list of points of {columns} numbers")
    return np.array([[_number(number) for number in point] for point in value])


def _polygon(value: Any) -> np.ndarray:
    corners = _points(value, columns=2, rows=3)
    if len(np.unique(corners, axis=0)) < len(corners):
        raise Refused("a polygon without repeated corners")
    ahead = np.roll(corners, -1, axis=0)
    area = np.sum(corners[:, 0] * ahead[:, 1] - corners[:, 1] * ahead[:, 0]) / 2
    corners = corners if area > 0 else corners[::-1]
    if abs(area) < 1e-6 or not math.isclose(
        CrossSection([corners]).area(), abs(area), rel_tol=1e-6
    ):
        raise Refused("a polygon that encloses an area and does not cross itself")
    return corners


def _span(value: Any) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise Refused("two numbers")
    first, last = (_number(number) for number in value)
    if first >= last:
        raise Refused("two growing numbers")
    return first, last


class Key(NamedTuple):
    """What a key of a sheet is called in `solids` and `fittings`, and how it is checked."""

    parameter: str
    check: Check


KEYS = {
    "l": Key("length", _size),
    "len": Key("length", _size),
    "w": Key("width", _size),
    "h": Key("height", _size),
    "t": Key("thickness", _size),
    "lt": Key("top_length", _size),
    "wt": Key("top_width", _size),
    "dx": Key("top_shift", _number),
    "r": Key("radius", _size),
    "r_top": Key("top_radius", _size),
    "ru": Key("length_radius", _size),
    "rv": Key("width_radius", _size),
    "rw": Key("height_radius", _size),
    "depth": Key("depth", _size),
    "leg_r": Key("leg_radius", _size),
    "brace_r": Key("brace_radius", _size),
    "legs": Key("legs", partial(_count, low=3, high=4)),
    "bays": Key("bays", _count),
    "yaw": Key("yaw", _angle),
    "el": Key("elevation", _slope),
    "tilt": Key("tilt", _slope),
    "front_rake": Key("front_rake", _slope),
    "top_scale": Key("top_scale", partial(_number, low=0.01, high=10.0)),
    "shape": Key("shape", _one_of("box", "oval")),
    "face": Key("face", _one_of("aft", "fore", "starboard", "port")),
    "pts": Key("outline", _polygon),
    "path": Key("path", partial(_points, columns=3, rows=2)),
    "edge": Key("edge", _span),
    "inset": Key("inset", _number),
    "pitch": Key("pitch", _size),
    "z_stem": Key("stem_top", _number),
    "z_aft": Key("aft_top", _number),
    "x_end": Key("end", _number),
    "flare": Key("flare", _slope),
    "house": Key("host", _text),
    "sink": Key("sink", partial(_number, low=0.0, high=5.0)),
    "type": Key("template", _text),
    "az": Key("azimuth", _angle),
}


class Primitive(NamedTuple):
    """Keys a primitive needs and may have; `place` are those of x, y, z which position it."""

    needs: frozenset[str]
    may: frozenset[str] = frozenset()
    place: str = "xyz"
    stands: bool = False  # on something, into which its base is sunk
    cuts: bool = False  # takes material away

    def describe(self) -> str:
        """The keys, for a message."""
        return ", ".join([*self.place, *sorted(self.needs)])


def _primitive(needs: str, may: str = "", **flags: Any) -> Primitive:
    return Primitive(frozenset(needs.split()), frozenset(may.split()), **flags)


PARTS = {  # of a template or a ship
    "box": _primitive("l w h", "lt wt dx yaw sink", stands=True),
    "cyl": _primitive("r h", "r_top sink", stands=True),
    "pole": _primitive("r h", "r_top sink", stands=True),
    "sphere": _primitive("r"),
    "ellipsoid": _primitive("ru rv rw"),
    "beam": _primitive("len w h", "el"),
    "barrel": _primitive("len r", "el"),
    "trunnion": _primitive("len r"),
    "drum": _primitive("len r", "el"),
    "plate": _primitive("w h t", "tilt"),
    "dish": _primitive("r depth"),
    "mesh_dish": _primitive("w h depth", "tilt"),
    "boat": _primitive("l w h"),
}
PRIMITIVES = PARTS | {  # of a ship only
    "prism": _primitive("l w h lt wt", "dx shape sink", stands=True),
    "poly": _primitive("pts h", "top_scale front_rake sink", place="z", stands=True),
    "yard": _primitive("w r"),
    "lattice": _primitive("l w h lt wt legs bays leg_r brace_r", "dx sink", stands=True),
    "eq": _primitive("type az", "sink", stands=True),
    "bulwark": _primitive("edge x_end z_stem z_aft w flare", place=""),
    "rail": _primitive("h pitch", "path edge inset", place=""),
    "net": _primitive("h pitch", "path edge inset", place=""),
    "recess": _primitive("l w h face", cuts=True),
    "step": _primitive("l w h", cuts=True),
    "windows": _primitive("house h w pitch depth", place="z", cuts=True),
}
REMARKS = frozenset({"name", "prim", "src", "unc", "note", "ir", "fitted"})
COPIES = frozenset({"mirror", "repeat", "n", "dx_n"})


@dataclass(frozen=True, eq=False)
class Part:
    """A primitive, where it is [m] and the keyword arguments of its builder."""

    prim: str
    at: tuple[float, float, float]
    sizes: Mapping[str, Any]

    @property
    def cuts(self) -> bool:
        """Whether it takes material away."""
        return PRIMITIVES[self.prim].cuts

    @property
    def stands(self) -> bool:
        """Whether it has a base to sink into what bears it."""
        return PRIMITIVES[self.prim].stands


@dataclass(frozen=True, eq=False)
class Component(Part):
    """A named part of a ship with its copies: plan offsets [m], and their mirror image or not."""

    name: str
    source: str
    offsets: tuple[tuple[float, float], ...]
    mirror: bool


@dataclass(frozen=True, eq=False)
class Sheet:
    """A ship as its sheet describes it, in sheet axes."""

    name: str
    beam: float
    hull: Hull
    components: tuple[Component, ...]
    templates: Mapping[str, tuple[Part, ...]]


def _value(where: str, key: str, value: Any, check: Check) -> Any:
    try:
        return check(value)
    except Refused as allowed:
        raise ShipError(f"{where}: '{key}' is {value!r}, but must be {allowed}.") from None


def _mapping(where: str, value: Any, needs: frozenset[str]) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ShipError(f"{where}: must be a mapping of keys to values, not {value!r:.60}.")
    for key in sorted(needs - value.keys()):
        raise ShipError(f"{where}: '{key}' is missing; required are {', '.join(sorted(needs))}.")
    return value


def _sizes(where: str, prim: str, given: Mapping[str, Any]) -> dict[str, Any]:
    spec = PRIMITIVES[prim]
    for key in sorted(spec.needs - given.keys()):
        raise ShipError(f"{where}: '{key}' is missing; {prim} needs {spec.describe()}.")
    for key in sorted(given.keys() - spec.needs - spec.may, key=str):
        known = ", ".join(sorted(spec.needs | spec.may))
        raise ShipError(f"{where}: '{key}' is not a key of {prim}, which knows {known}.")
    sizes = {KEYS[key].parameter: _value(where, key, given[key], KEYS[key].check) for key in given}
    if prim in ("rail", "net") and ("path" in sizes) == ("edge" in sizes):
        raise ShipError(f"{where}: {prim} needs either 'path' or 'edge', and not both.")
    return sizes


def _prim(where: str, value: Any, known: Mapping[str, Primitive]) -> str:
    if not isinstance(value, str) or value not in known:
        raise ShipError(f"{where}: unknown primitive {value!r}, known are {', '.join(known)}.")
    return value


def _templates(where: str, given: Any) -> dict[str, tuple[Part, ...]]:
    templates = {}
    for name, entry in _mapping(f"{where}: templates", given, frozenset()).items():
        place = f"{where}: template '{name}'"
        parts = _mapping(place, entry, frozenset({"parts"}))["parts"]
        if not isinstance(parts, list) or not parts:
            raise ShipError(f"{place}: 'parts' must be a list of [prim, u, v, w, sizes].")
        templates[str(name)] = tuple(_template_part(place, part) for part in parts)
    return templates


def _template_part(where: str, part: Any) -> Part:
    if not isinstance(part, list) or len(part) != 5:
        raise ShipError(f"{where}: a part must be [prim, u, v, w, sizes], not {part!r:.60}.")
    prim = _prim(where, part[0], PARTS)
    at = tuple(
        _value(where, key, value, _number) for key, value in zip("uvw", part[1:4], strict=True)
    )
    return Part(prim, at, _sizes(where, prim, _mapping(where, part[4], frozenset())))


def _component(where: str, given: Any, templates: Mapping[str, Any]) -> Component | None:
    entry = _mapping(where, given, frozenset({"name", "prim", "src"}))
    name = _value(where, "name", entry["name"], _text)
    where = f"{where} '{name}'"
    prim = _prim(where, entry["prim"], PRIMITIVES)
    place = PRIMITIVES[prim].place
    for key in place:
        if key not in entry:
            needs = PRIMITIVES[prim].describe()
            raise ShipError(f"{where}: '{key}' is missing; {prim} needs {needs}.")
    x, y, z = (_value(where, key, entry[key], _number) if key in place else 0.0 for key in "xyz")
    copies = COPIES if place == "xyz" else frozenset({"mirror"})
    other = entry.keys() - REMARKS - copies - set(place)
    sizes = _sizes(where, prim, {key: entry[key] for key in entry if key in other})
    if prim == "eq" and sizes["template"] not in templates:
        known = ", ".join(sorted(templates))
        raise ShipError(f"{where}: unknown template {sizes['template']!r}, known are {known}.")
    count = _value(where, "n", entry.get("n", 1), _count)
    pitch = _value(where, "dx_n", entry.get("dx_n", 0.0), _number)
    if count > 1 and pitch == 0:
        raise ShipError(f"{where}: 'n' is {count}, so 'dx_n' must be their distance in metres.")
    offsets = [(k * pitch, 0.0) for k in range(count)]
    if "repeat" in entry:
        again = _value(where, "repeat", entry["repeat"], partial(_points, columns=2, rows=1))
        offsets += [(float(px) - x, float(py) - y) for px, py in again]
    component = Component(
        prim=prim,
        at=(x, y, z),
        sizes=sizes,
        name=name,
        source=_value(where, "src", entry["src"], _text),
        offsets=tuple(offsets),
        mirror=_value(where, "mirror", entry.get("mirror", False), _flag),
    )
    fitted = _value(where, "fitted", entry.get("fitted", True), _flag)
    return component if fitted else None


def _hull(where: str, sheet: Mapping[str, Any]) -> tuple[Hull, float]:
    needs = frozenset({"LOA", "beam_max", "stem_at_wl_x", "transom_foot", "transom_head"})
    where_principal = f"{where}: principal"
    principal = _mapping(where_principal, sheet["principal"], needs)

    def dimension(key: str, check: Check = _size) -> Any:
        return _value(where_principal, key, principal[key], check)

    def point(key: str) -> tuple[float, float]:
        check = partial(_points, columns=2, rows=1)
        x, z = _value(where_principal, key, [principal[key]], check)[0]
        return float(x), float(z)

    loa, beam, stem_foot = dimension("LOA"), dimension("beam_max"), dimension("stem_at_wl_x")
    foot, head = point("transom_foot"), point("transom_head")
    if not foot[1] < head[1]:
        raise ShipError(f"{where_principal}: 'transom_head' {list(head)} must be above the foot.")
    stations = _stations(where, sheet["stations"])
    if stations[0, 0] != 0 or abs(stations[-1, 0] - loa) > 0.01:
        raise ShipError(
            f"{where}: stations run from {stations[0, 0]:g} to {stations[-1, 0]:g} m, "
            f"but must run from 0 to the LOA, {loa:g} m."
        )
    if abs(2 * stations[:, 2:].max(initial=0, where=~np.isnan(stations[:, 2:])) - beam) > 0.1:
        raise ShipError(f"{where}: the stations must be as wide as beam_max, {beam:g} m.")
    if not stations[0, 0] < stem_foot < loa:
        raise ShipError(
            f"{where_principal}: 'stem_at_wl_x' is {stem_foot:g}, but must be on the ship."
        )
    return Hull(loa, stations, stem_foot, foot, head), beam


def _stations(where: str, given: Any) -> np.ndarray:
    where = f"{where}: stations"
    if not isinstance(given, list) or any(not isinstance(s, list) or len(s) != 4 for s in given):
        raise ShipError(f"{where} must be a list of [x, deck z, half-breadth, half-breadth at WL].")
    rows = [
        [
            _value(where, "x", x, _number),
            _value(where, "deck z", deck, partial(_number, low=0.3, high=50.0)),
            _value(where, "half-breadth", half, partial(_number, low=0.01, high=50.0)),
            np.nan
            if water is None
            else _value(where, "half-breadth at WL", water, partial(_number, low=0.01, high=50.0)),
        ]
        for x, deck, half, water in given
    ]
    stations = np.array(rows).reshape(-1, 4)
    wet = np.flatnonzero(~np.isnan(stations[:, 3]))
    if len(wet) < 2 or len(wet) != wet[-1] - wet[0] + 1:
        raise ShipError(f"{where} must reach the waterline at two or more neighbouring sections.")
    for before, after in zip(stations[:-1, 0], stations[1:, 0], strict=True):
        if not before < after:
            raise ShipError(f"{where}: x must grow, but {after:g} follows {before:g}.")
    return stations


def _document(where: str, text: str) -> dict[str, Any]:
    try:
        document = yaml.safe_load(text)
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        line = getattr(getattr(error, "problem_mark", None), "line", None)
        at = "" if line is None else f" (line {line + 1})"
        raise ShipError(f"{where}: is not valid YAML{at}.") from None
    return _mapping(where, document, frozenset())


def parse(text: str, templates: str, *, where: str) -> Sheet:
    """Read a sheet.

    Parameters
    ----------
    text : str
        YAML of the sheet; `sheets/README.md` has its rules.
    templates : str
        YAML of the equipment templates; the sheet's own `templates` come on top.
    where : str
        What to call the sheet in messages.

    Raises
    ------
    ShipError
        When a key is missing or unknown, or a value is not allowed.
    """
    sheet = _document(where, text)
    needs = frozenset({"name", "principal", "stations", "components"})
    _mapping(where, sheet, needs)
    known = _templates("templates", _document("templates", templates))
    known |= _templates(where, sheet.get("templates", {}))
    hull, beam = _hull(where, sheet)
    if not isinstance(sheet["components"], list):
        raise ShipError(f"{where}: 'components' must be a list.")
    listed = [_component(f"{where}: component", entry, known) for entry in sheet["components"]]
    components = tuple(component for component in listed if component is not None)
    return Sheet(_value(where, "name", sheet["name"], _text), beam, hull, components, known)

"""The keys and primitives of ship sheets; `sheets/README.md` explains them."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

from ncti.ships import checks


class Key(NamedTuple):
    """Name of a sheet's key in `solids` and `fittings`, and its check."""

    parameter: str
    check: checks.Check


KEYS = {
    "l": Key("length", checks.size),
    "len": Key("length", checks.size),
    "w": Key("width", checks.size),
    "h": Key("height", checks.size),
    "t": Key("thickness", checks.size),
    "lt": Key("top_length", checks.size),
    "wt": Key("top_width", checks.size),
    "dx": Key("top_shift", checks.number),
    "r": Key("radius", checks.size),
    "r_top": Key("top_radius", checks.size),
    "ru": Key("length_radius", checks.size),
    "rv": Key("width_radius", checks.size),
    "rw": Key("height_radius", checks.size),
    "depth": Key("depth", checks.size),
    "leg_r": Key("leg_radius", checks.size),
    "brace_r": Key("brace_radius", checks.size),
    "legs": Key("legs", partial(checks.count, low=3, high=4)),
    "bays": Key("bays", checks.count),
    "yaw": Key("yaw", checks.angle),
    "el": Key("elevation", checks.slope),
    "tilt": Key("tilt", checks.slope),
    "front_rake": Key("front_rake", checks.slope),
    "top_scale": Key("top_scale", partial(checks.number, low=0.01, high=10.0)),
    "shape": Key("shape", checks.one_of("box", "oval")),
    "face": Key("face", checks.one_of("aft", "fore", "starboard", "port")),
    "pts": Key("outline", checks.polygon),
    "path": Key("path", checks.path),
    "edge": Key("edge", checks.span),
    "inset": Key("inset", checks.number),
    "pitch": Key("pitch", checks.spacing),
    "z_stem": Key("stem_top", checks.number),
    "z_aft": Key("aft_top", checks.number),
    "x_end": Key("end", checks.number),
    "flare": Key("flare", checks.slope),
    "house": Key("host", checks.text),
    "sink": Key("sink", partial(checks.number, low=0.0, high=5.0)),
    "type": Key("template", checks.text),
    "az": Key("azimuth", checks.angle),
}


class Primitive(NamedTuple):
    """Required and optional keys of a primitive; `place` lists the coordinates that position it."""

    needs: frozenset[str]
    may: frozenset[str] = frozenset()
    place: str = "xyz"
    stands: bool = False  # on something, into which its base is sunk
    cuts: bool = False  # takes material away


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
# Keys of a sheet, of its `principal` and of a template: required ones, and others.
SHEET = (
    frozenset({"name", "principal", "stations", "components"}),
    frozenset({"templates", "class", "configuration", "published", "estimated", "note", "src"}),
)
PRINCIPAL = (
    frozenset({"LOA", "beam_max", "stem_at_wl_x", "transom_head", "transom_angle_from_vertical"}),
    frozenset({"LWL", "draft_hull", "draft_max", "freeboard_bow_deck", "freeboard_bow_bulwark"})
    | {"freeboard_mid", "freeboard_stern", "freeboard_after_step", "freeboard_flight_deck"}
    | {"freeboard_main_deck_aft", "transom_half_width_deck", "transom_half_width_wl"}
    | {"bow_rake_from_vertical", "mast_top_z", "note", "src"},
)
TEMPLATE = (frozenset({"parts"}), frozenset({"desc", "overall_lwh", "src", "unc", "note"}))
REMARKS = frozenset({"name", "prim", "src", "unc", "note", "ir", "fitted"})
COPIES = frozenset({"mirror", "repeat", "n", "dx_n"})
# Defaults by provenance tag: sigma of a place along x [m] for lines without `unc`, the usual `unc`
# of lines with that tag; and relative sigma of sizes, half of the 10 to 20 % within which they are
# known.
UNCERTAINTY = {
    "P": (0.5, 0.0),  # published
    "M": (0.6, 0.05),  # scaled from a model of the published length
    "G": (1.2, 0.08),  # second-hand positions, scaled and shifted
    "E": (1.5, 0.1),  # assumed from the class layout
}

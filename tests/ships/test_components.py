"""Every component of every packaged sheet is in the ship's mesh, at its place and size."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import yaml
from manifold3d import Manifold
from shipyard import bounds, packaged_sheet, packaged_text, solid_of

from ncti import ships
from ncti.ships.build import Piece, piece
from ncti.ships.lofting import union

# Surfaces may move by 0.1 mm when slivers go: 2 % of the volume of a wire 10 mm in radius.
MISSING = 0.05


@cache
def pieces(name: str) -> tuple[Piece, ...]:
    sheet = packaged_sheet(name)
    return tuple(piece(sheet, component) for component in sheet.components)


@pytest.mark.parametrize("name", ships.names())
def test_components_are_in_the_mesh(name) -> None:
    """The mesh fills all of a component except what others cut away, and nothing of a cut."""
    mesh = ships.load(name)
    ship = solid_of(mesh).rotate((0, 0, 180)).translate((mesh.metadata["loa"] / 2, 0, 0))
    cuts = union([p.solid for p in pieces(name) if p.cuts])
    added = union([p.solid for p in pieces(name) if not p.cuts])
    for part in pieces(name):
        room = part.solid - added if part.cuts else part.solid - cuts
        room = room.trim_by_plane((0, 0, 1), 0)
        filled = (room ^ ship).volume() / room.volume()
        assert (filled if part.cuts else 1 - filled) < MISSING, part.name


def listed(name: str) -> list[dict]:
    """Return the fitted component lines of a sheet's file."""
    lines = yaml.safe_load(packaged_text(name))["components"]
    return [line for line in lines if line.get("fitted", True)]


@pytest.mark.parametrize("name", ships.names())
def test_component_positions_match_the_sheet(name) -> None:
    """Compare every copy's place and the component's height with the lines of the file."""
    for line, built in zip(listed(name), pieces(name), strict=True):
        if not {"x", "y", "z"} <= line.keys():
            continue
        places = [(line["x"] + k * line.get("dx_n", 0), line["y"]) for k in range(line.get("n", 1))]
        places += line.get("repeat", [])
        if line.get("mirror"):
            places += [(x, -y) for x, y in places]
        for x, y in places:
            side = max(line["l"], line["w"]) if line["prim"] == "lattice" else 0.7
            column = Manifold.cube((side, side, 200), True).translate((x, y, 0))
            assert not (built.solid ^ column).is_empty(), line["name"]
        low, high = bounds(built.solid)
        if line["prim"] in ("box", "cyl", "pole", "prism"):
            assert high[2] == pytest.approx(line["z"] + line["h"], abs=1e-9), line["name"]
            assert line["z"] - 0.46 <= low[2] <= line["z"], line["name"]
        if line["prim"] == "box" and len(places) == 1 and "yaw" not in line:
            spread = (high - low)[:2]
            expected = [max(line["l"], line.get("lt", 0)), max(line["w"], line.get("wt", 0))]
            # A sunken frustum's foot is a little larger than its footprint.
            np.testing.assert_allclose(spread, expected, rtol=0.05)


@pytest.mark.parametrize("name", ships.names())
def test_every_component_has_provenance_and_uncertainty(name) -> None:
    for line in listed(name):
        assert set(line["src"]) <= set("PMGE+/"), line["name"]
        assert line["unc"] > 0, line["name"]

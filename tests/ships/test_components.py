"""Every component of every packaged sheet is in the ship's mesh, at its place and size.

The evidence of a component is the volume that only it adds outside all others, or that only it
cuts away. In a mesh that has the component this volume is filled (or empty, for a cut); in a mesh
built without it, the reverse.
"""

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
    """Return the hull, then every component."""
    sheet = packaged_sheet(name)
    hull = Piece("hull", sheet.hull.solid(), cuts=False)
    return (hull, *(piece(sheet, component) for component in sheet.components))


def meets(a: Manifold, b: Manifold) -> bool:
    (low_a, high_a), (low_b, high_b) = bounds(a), bounds(b)
    return bool((low_a <= high_b).all() and (low_b <= high_a).all())


@cache
def evidence(name: str, index: int) -> Manifold:
    """Return the volume that only this component fills, or only it cuts away."""
    body = pieces(name)[index]
    low, high = bounds(body.solid)
    around = Manifold.cube(high - low + 0.02).translate(low - 0.01)
    near = [p for i, p in enumerate(pieces(name)) if i != index and meets(p.solid, body.solid)]
    added = union([p.solid ^ around for p in near if not p.cuts])
    cut = union([p.solid ^ around for p in near if p.cuts])
    room = (body.solid ^ added) - cut if body.cuts else body.solid - added - cut
    return room.trim_by_plane((0, 0, 1), 0)


def missing(name: str, index: int, ship: list[Manifold]) -> float:
    """Return the share of a component's evidence missing from a ship given as slabs."""
    room = evidence(name, index)
    filled = sum((room ^ slab).volume() for slab in ship if meets(room, slab)) / room.volume()
    return filled if pieces(name)[index].cuts else 1 - filled


@pytest.fixture(scope="session")
def slabs():
    """Return a function that cuts a ship in sheet axes every 15 m, for fast local tests."""

    @cache
    def cut(name: str) -> list[Manifold]:
        mesh = ships.load(name)
        length = mesh.metadata["loa"]
        solid = solid_of(mesh).rotate((0, 0, 180)).translate((length / 2, 0, 0))
        slab = Manifold.cube((15, 40, 60)).translate((0, -20, 0))
        return [solid ^ slab.translate((x, 0, 0)) for x in np.arange(-1.0, length, 15.0)]

    return cut


CASES = [
    pytest.param(name, index, id=f"{name}-{index}-{component.name}")
    for name in ships.names()
    for index, component in enumerate(packaged_sheet(name).components, start=1)
]


@pytest.mark.parametrize(("name", "index"), CASES)
def test_component_is_in_the_mesh(slabs, name, index) -> None:
    # At least a litre must be visible for the test to mean something.
    assert evidence(name, index).volume() > 1e-3
    assert missing(name, index, slabs(name)) < MISSING


def listed(name: str) -> list[dict]:
    """Return the fitted component lines of a sheet's file."""
    lines = yaml.safe_load(packaged_text(name))["components"]
    return [line for line in lines if line.get("fitted", True)]


@pytest.mark.parametrize("name", ships.names())
def test_components_stand_where_their_lines_say(name) -> None:
    """Compare every copy's place and the component's height with the lines of the file."""
    for line, built in zip(listed(name), pieces(name)[1:], strict=True):
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
def test_every_line_keeps_its_provenance(name) -> None:
    for line in listed(name):
        assert set(line["src"]) <= set("PMGE+/"), line["name"]
        assert line["unc"] > 0, line["name"]

"""A valid sheet becomes a solid of its size; any fault in a sheet is refused in one sentence."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import trimesh
import yaml
from hypothesis import example, given, settings
from hypothesis import strategies as st
from shipyard import barge, sentence

from ncti import ships
from ncti.ships import build, sheets


def built(document: Any, *, templates: str = "{}") -> trimesh.Trimesh:
    ship = build.build(sheets.parse(yaml.safe_dump(document), templates, where="barge"))
    return trimesh.Trimesh(ship.vertices, ship.faces, process=False)


def refusal(document: Any) -> str:
    with pytest.raises(ships.ShipError, match=r"^barge") as caught:
        built(document)
    return sentence(caught.value)


def component(document: dict[str, Any], name: str) -> dict[str, Any]:
    return next(line for line in document["components"] if line["name"] == name)


def test_barge_is_one_solid_of_expected_size() -> None:
    mesh = built(barge())
    assert mesh.is_volume
    assert mesh.body_count == 1
    assert mesh.extents[:2] == pytest.approx([40, 8])
    assert mesh.extents[2] == pytest.approx(8.5)


def test_azimuth_90_points_to_starboard() -> None:
    document = barge()
    document["templates"]["GUN"]["parts"].append(["barrel", 0, 0, 0.5, {"len": 5.0, "r": 0.1}])
    component(document, "gun")["az"] = 90
    mesh = built(document)
    assert mesh.bounds[0, 1] == pytest.approx(-5.0)  # starboard is -y in ship axes
    assert mesh.bounds[1, 1] == pytest.approx(4.0)


BAD = yaml.safe_load(Path(__file__).with_name("bad_sheets.yaml").read_text())


@pytest.mark.parametrize("case", BAD["lines"])
def test_bad_line_is_refused(case) -> None:
    name, change, message = BAD["lines"][case]
    document = barge()
    component(document, name).update(change)
    assert message in refusal(document)


@pytest.mark.parametrize("case", BAD["hulls"])
def test_bad_sheet_is_refused(case) -> None:
    (*path, last), value, message = BAD["hulls"][case]
    document = barge()
    place: Any = document
    for step in path:
        place = place[step]
    place[last] = value
    assert message in refusal(document)


@pytest.mark.parametrize("key", ["name", "principal", "stations", "components"])
def test_missing_key_is_refused(key) -> None:
    document = barge()
    del document[key]
    assert f"'{key}' is missing" in refusal(document)


def leaves(document: Any, path: tuple = ()) -> Iterator[tuple]:
    """Return the paths to every value of a document, containers too."""
    yield path
    items = document.items() if isinstance(document, dict) else enumerate(document)
    for key, value in items:
        if isinstance(value, dict | list):
            yield from leaves(value, (*path, key))
        else:
            yield (*path, key)


PATHS = [path for path in leaves(barge()) if path]
VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**400), 10**400),
    st.floats(),
    st.floats(-50, 50),
    st.text(max_size=5),
    st.lists(st.floats(-50, 50), max_size=4),
    st.lists(st.lists(st.floats(-50, 50), min_size=2, max_size=4), max_size=4),
    st.dictionaries(st.text(max_size=3), st.integers(), max_size=2),
    st.just(...),  # take it away
)


@settings(max_examples=80, deadline=None)
@given(path=st.sampled_from(PATHS), value=VALUES)
@example(path=("stations", 1, 0), value=5.7e-131)
def test_any_value_gives_a_solid_or_a_ship_error(path, value) -> None:
    document = copy.deepcopy(barge())
    place: Any = document
    for step in path[:-1]:
        place = place[step]
    if value is ...:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    try:
        mesh = built(document)
    except ships.ShipError as error:
        assert sentence(error).startswith("barge")
    else:
        assert mesh.is_volume
        assert mesh.body_count == 1


def test_non_utf8_sheet_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "barge.yaml"
    path.write_bytes(b"\xff\xfe\x00\xd8")
    with pytest.raises(ships.ShipError, match="UTF-8"):
        ships.load(path, cache=tmp_path)

"""Sheets: what a good one becomes, and that a bad one is refused, whatever is bad about it."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import trimesh
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from shipyard import barge

from ncti import ships
from ncti.ships import build, sheets
from ncti.ships.errors import ShipError


def built(document: Any, *, templates: str = "{}") -> trimesh.Trimesh:
    ship = build.build(sheets.parse(yaml.safe_dump(document), templates, where="barge"))
    return trimesh.Trimesh(ship.vertices, ship.faces, process=False)


def refusal(document: Any) -> str:
    with pytest.raises(ships.ShipError) as caught:
        built(document)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith("barge")
    assert message.endswith(".")
    return message


def component(document: dict[str, Any], name: str) -> dict[str, Any]:
    return next(line for line in document["components"] if line["name"] == name)


def test_barge_is_a_solid_of_its_size() -> None:
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


BAD_LINES = {
    "unknown primitive": ("house", {"prim": "sphinx"}, "unknown primitive 'sphinx'"),
    "unknown template": ("gun", {"type": "MK99"}, "unknown template 'MK99'"),
    "unknown key": ("house", {"lenght": 6.0}, "'lenght' is not a key of box"),
    "negative size": ("house", {"l": -6.0}, "'l' is -6.0, but must be a number between"),
    "zero size": ("bitts", {"r": 0}, "'r' is 0"),
    "NaN": ("house", {"x": float("nan")}, "'x' is nan"),
    "infinity": ("house", {"h": float("inf")}, "'h' is inf"),
    "text for a number": ("house", {"w": "wide"}, "'w' is 'wide'"),
    "truth for a number": ("house", {"w": True}, "'w' is True"),
    "number for truth": ("bitts", {"mirror": 1}, "'mirror' is 1"),
    "no provenance": ("house", {"src": ""}, "'src' is ''"),
    "copies in one place": ("bitts", {"dx_n": 0.0}, "'n' is 2"),
    "crossing outline": ("bridge", {"pts": [[0, 0], [2, 2], [2, 0], [0, 2]]}, "cross itself"),
    "flat outline": ("bridge", {"pts": [[0, 0], [1, 1], [2, 2]]}, "encloses an area"),
    "no such house": ("panes", {"house": "barn"}, "'house' is 'barn'"),
    "backward edge": ("rail", {"edge": [30.0, 10.0]}, "two growing numbers"),
    "edge and path": ("rail", {"path": [[0, 0, 0], [1, 0, 0]]}, "not both"),
    "unknown face": ("door", {"face": "up"}, "aft or fore or starboard or port"),
    "floating": ("house", {"z": 20.0, "x": 30.0}, "house would float in the air"),
}


@pytest.mark.parametrize("case", BAD_LINES)
def test_bad_line_is_refused(case) -> None:
    name, change, message = BAD_LINES[case]
    document = barge()
    component(document, name).update(change)
    assert message in refusal(document)


BAD_HULLS = {
    "stations go back": (("stations", 2, 0), 1.0, "x must grow, but 1 follows 2"),
    "stations end early": (("stations", 3, 0), 39.0, "must run from 0 to LOA, 40"),
    "stations too wide": (("stations", 2, 2), 5.0, "must be beam_max, 8"),
    "negative breadth": (("stations", 2, 2), -4.0, "'half-breadth' is -4.0"),
    "dry hull": (("stations", 2, 3), None, "must reach the waterline"),
    "short station": (("stations", 2), [10.0, 3.0], "must be a list of [x"),
    "transom elsewhere": (("principal", "transom_head"), [30.0, 3.0], "must be at LOA, 40"),
    "transom flat": (("principal", "transom_angle_from_vertical"), 90, "between 0 and 80"),
    "stem abaft": (("principal", "stem_at_wl_x"), 41.0, "must be less than LOA, 40"),
    "no principal": (("principal",), None, "must be a mapping"),
    "no components": (("components",), {}, "'components' must be a list"),
    "component a text": (("components", 0), "house", "must be a mapping"),
    "bad template": (("templates", "GUN"), {}, "'parts' is missing"),
    "bad part": (("templates", "GUN", "parts", 0), ["cyl", 0, 0], "a part must be"),
    "hull part": (("templates", "GUN", "parts", 0, 0), "yard", "unknown primitive 'yard'"),
}


@pytest.mark.parametrize("case", BAD_HULLS)
def test_bad_sheet_is_refused(case) -> None:
    (*path, last), value, message = BAD_HULLS[case]
    document = barge()
    place: Any = document
    for step in path:
        place = place[step]
    place[last] = value
    assert message in refusal(document)


UNKNOWN = {
    "sheet": ((), "barge.yaml: 'componets' is not a key here; allowed are "),
    "principal": (("principal",), "principal: 'componets' is not a key here; allowed are LOA, "),
    "template": (("templates", "GUN"), "'GUN': 'componets' is not a key here; allowed are desc, "),
}


@pytest.mark.parametrize("place", UNKNOWN)
def test_unknown_key_is_refused(place) -> None:
    path, message = UNKNOWN[place]
    document: Any = barge()
    inner = document
    for step in path:
        inner = inner[step]
    inner["componets"] = 1
    assert message.partition(": ")[2] in refusal(document)


TWICE = {
    "sheet": ("name: barge\n", "'name' is given twice (line "),
    "component": ("{a: 1, 'a': 2}", "'a' is given twice (line "),
    "number": ("{1: 1, 1: 2}", "1 is given twice (line "),
}


@pytest.mark.parametrize("what", TWICE)
def test_key_given_twice_is_refused(what) -> None:
    given, message = TWICE[what]
    text = yaml.safe_dump(barge())
    text += given if what == "sheet" else f"note: [0, {given}]\n"
    with pytest.raises(ShipError) as refused:
        sheets.parse(text, "{}", where="barge.yaml")
    assert message in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize("key", ["name", "principal", "stations", "components"])
def test_missing_key_is_refused(key) -> None:
    document = barge()
    del document[key]
    assert f"'{key}' is missing" in refusal(document)


@pytest.mark.parametrize(
    "text", ["", "[]", "a: [", "- 1", "\t", "!!python/object:os.system {}", "a: &a [*a]"]
)
def test_text_that_is_no_sheet_is_refused(text) -> None:
    with pytest.raises(ships.ShipError, match=r"^barge.*\.$"):
        sheets.parse(text, "{}", where="barge")


def leaves(document: Any, path: tuple = ()) -> Iterator[tuple]:
    """Paths to every value of a document, containers too."""
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
def test_any_value_anywhere_gives_a_solid_or_one_sentence(path, value) -> None:
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
    except ships.ShipError:
        refusal(document)
    else:
        assert mesh.is_volume
        assert mesh.body_count == 1


def test_sheet_that_is_not_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "barge.yaml"
    path.write_bytes(b"\xff\xfe\x00\xd8")
    with pytest.raises(ships.ShipError, match="UTF-8"):
        ships.load(path, cache=tmp_path)

"""Ships in other axes, of another unit or origin: each is found, and mended by what is proposed."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ncti import ships
from ncti.ships.orientation import diagnose, section_areas
from ncti.ships.transform import AXES, FARTHEST

SIX = ships.names()
TURNS = [(up, forward) for up in AXES for forward in AXES if up[-1] != forward[-1]]
ROUNDED = 0.01 * np.sqrt(3) / 2  # offsets are proposed to 0.01 m

six = pytest.mark.parametrize("name", SIX)


@pytest.fixture
def arrays(ship):
    """Function: vertices and facets of a ship."""
    return lambda name: (np.array(ship(name).vertices), np.array(ship(name).faces))


def in_file(vertices, transform):
    """Coordinates of a file that a transform turns into these."""
    turned = (vertices - np.array(transform.offset)) / transform.scale
    return turned @ transform.axes


def wigley(length=100.0, beam=13.0, draught=4.5, freeboard=6.0) -> trimesh.Trimesh:
    """Hull of parabolic waterlines and frames with vertical topsides, and a house on its deck."""
    x, z = np.linspace(-1, 1, 41), np.linspace(-1, 0, 13)
    breadth = np.sqrt(np.clip(1 - z**2, 0, None))[:, None] * (1 - 0.98 * x**2) + 0.002
    breadth = np.vstack([breadth, breadth[-1:]])
    height = np.append(z * draught, freeboard)[:, None] + np.zeros_like(x)
    rings = [
        np.dstack([np.broadcast_to(x * length / 2, height.shape), side, height])
        for side in (breadth * beam / 2, -breadth * beam / 2)
    ]
    hull = trimesh.Trimesh(np.concatenate(rings).reshape(-1, 3)).convex_hull
    house = trimesh.creation.box(
        (25, 8, 12), trimesh.transformations.translation_matrix((-5, 0, 9))
    )
    return trimesh.boolean.union([hull, house], engine="manifold")


@six
def test_a_ship_in_its_frame_is_not_suspicious(name, arrays):
    assert diagnose(*arrays(name)).findings == ()
    assert ships.describe(name).mend is None


@six
@pytest.mark.parametrize(("up", "forward"), TURNS)
def test_every_turned_ship_is_turned_back(name, up, forward, arrays):
    """All 24 ways to lie along axes, but for the bow pointing aft, which is not looked for."""
    vertices, faces = arrays(name)
    turn = ships.Transform(up=up, forward=forward)
    found = diagnose(in_file(vertices, turn), faces)
    if (up, forward) in {("z", "x"), ("z", "-x")}:
        assert found.findings == ()
        return
    upright = {"z": "has its length along y", "-z": "is upside down"}
    lying = "stands on end" if forward[-1] == "z" else "lies on its side"
    # Upside down and along y is one turn.
    assert found.findings[0] == upright.get(up, lying)
    assert (found.mend.up, found.mend.forward) == (up, forward)


@six
@settings(
    max_examples=4, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    turn=st.sampled_from([one for one in TURNS if one != ("z", "-x")]),
    scale=st.floats(0.2, 3.0),
    place=st.tuples(*[st.floats(-300, 300)] * 3),
)
def test_any_transform_is_undone(name, turn, scale, place, arrays):
    """Ships of any size, turned and shifted: after the proposal nothing is found."""
    vertices, faces = arrays(name)
    vertices = vertices * scale
    given_ = ships.Transform(up=turn[0], forward=turn[1], offset=place)
    file = in_file(vertices, given_)
    found = diagnose(file, faces)
    if found.mend is None:
        assert turn == ("z", "x")
        np.testing.assert_array_less(np.abs(place[:2]), 0.25 * np.ptp(vertices, axis=0)[:2] + 1e-9)
        return
    mended = found.mend.apply(file)
    assert diagnose(mended, faces).findings == ()
    if found.mend.offset[0] and found.mend.offset[1] and found.mend.offset[2]:
        assert np.linalg.norm(mended - vertices, axis=1).max() <= ROUNDED + 1e-6 * scale


@six
@pytest.mark.parametrize(
    ("offset", "finding"),
    [
        ((0, 0, 12.5), "floats 12.5 m above the water"),
        ((0.5, 0, 0), "has its origin at the stern"),
        ((-0.5, 0, 0), "has its origin at the bow"),
        ((2.0, 0, 0), "m from amidships"),
        ((0, 0.5, 0), "m off its centreline"),
    ],
)
def test_a_shifted_ship_is_shifted_back(name, offset, finding, arrays):
    vertices, faces = arrays(name)
    length, beam, _ = np.ptp(vertices, axis=0)
    shift = np.array(offset) * [length, beam, 1]
    found = diagnose(vertices + shift, faces)
    [said] = found.findings
    assert finding in said
    mended = found.mend.apply(vertices + shift)
    assert np.abs(mended - vertices).max() <= ROUNDED


def test_a_hull_on_its_keel_is_lowered_by_a_draught():
    hull = wigley()
    vertices, faces = np.array(hull.vertices), np.array(hull.faces)
    assert diagnose(vertices, faces).findings == ()
    for lifted, findings in ((4.5, 1), (20.0, 2)):
        above = vertices + np.array([0, 0, lifted])
        found = diagnose(above, faces)
        assert len(found.findings) == findings and "keel" in found.findings[-1]
        mended = found.mend.apply(above)
        assert mended[:, 2].min() == pytest.approx(-13 / 3, abs=0.01)
        assert diagnose(mended, faces).findings == ()
    upside_down = ships.Transform(up="-z").apply(vertices)
    assert diagnose(upside_down, faces).findings[0] == "is upside down"


@pytest.mark.parametrize("box", [(40, 8, 6), (200, 30, 25), (100, 60, 5), (30, 29, 28)])
def test_a_box_afloat_is_not_suspicious(box):
    """Barges are as symmetric along all axes, and as large above as below."""
    mesh = trimesh.creation.box(box)
    for height in (0, box[2] / 2, 0.3 * box[2]):
        vertices = mesh.vertices + np.array([0, 0, height])
        assert diagnose(np.array(vertices), np.array(mesh.faces)).findings == ()


def test_ships_of_other_kinds_are_not_suspicious():
    def block(size, at):
        return trimesh.creation.box(size, trimesh.transformations.translation_matrix(at))

    kinds = {
        "tanker": [block((250, 44, 24), (0, 0, -4)), block((25, 40, 20), (-105, 0, 18))],
        "carrier": [block((320, 40, 30), (0, 0, 3)), block((320, 75, 4), (0, 5, 18)),
                    block((40, 9, 25), (0, -26, 32))],
        "sailing yacht": [block((12, 3.5, 1.8), (0, 0, 0.4)), block((2, 0.3, 2), (0, 0, -1.5)),
                          block((0.2, 0.2, 16), (1, 0, 9))],
        "catamaran": [block((80, 4, 8), (0, 12, 1)), block((80, 4, 8), (0, -12, 1)),
                      block((70, 28, 6), (-3, 0, 8))],
    }  # fmt: skip
    for kind, blocks in kinds.items():
        mesh = trimesh.boolean.union(blocks, engine="manifold")
        found = diagnose(np.array(mesh.vertices), np.array(mesh.faces))
        assert found.findings == (), kind


def test_areas_of_sections_of_a_cone():
    """pi r^2 (1 - t)^2; facets are cut along their length, where the share is linear: to 1/4."""
    cone = trimesh.creation.cone(radius=3.0, height=10.0, sections=360)
    vertices, faces = np.array(cone.vertices), np.array(cone.faces)
    for axes in permutations(range(3)):
        if np.linalg.det(np.eye(3)[list(axes)]) < 0:
            continue
        turned, axis = vertices[:, axes], axes.index(2)
        ends = section_areas(turned, faces, axis, places=np.array([1e-9, 1 - 1e-9]))
        np.testing.assert_allclose(ends, [9 * np.pi, 0], rtol=1e-3, atol=1e-6)
    box = trimesh.creation.box((2, 3, 5))
    for axis, area in enumerate((15, 10, 6)):
        found = section_areas(np.array(box.vertices), np.array(box.faces), axis)
        np.testing.assert_allclose(found, area, rtol=1e-12)


@pytest.mark.parametrize("unit", [0.001, 0.01, 0.0254])
def test_the_unit_of_a_file_is_proposed(unit, ship, tmp_path):
    path = tmp_path / "hull.stl"
    mesh = ship("texas")
    trimesh.Trimesh(mesh.vertices / unit, mesh.faces, process=False).export(path)
    with pytest.raises(ships.ShipError, match=f"scale: {unit:g} makes it 178.3 m") as refused:
        ships.load(path)
    assert "\n" not in str(refused.value)
    np.testing.assert_allclose(ships.load(path, scale=unit).extents, mesh.extents, atol=1e-4)


def test_a_file_is_loaded_by_the_proposed_transform(ship, tmp_path):
    """Through a file of millimetres that lies on its side, with its origin at the stern."""
    mesh, path = ship("duncan"), tmp_path / "hull.stl"
    wrong = ships.Transform(up="y", forward="-z", scale=0.001, offset=(-67.0, 0.0, -9.0))
    trimesh.Trimesh(in_file(mesh.vertices, wrong), mesh.faces, process=False).export(path)
    found = ships.describe(path, scale=0.001)
    assert found.findings[0] == "stands on end" and len(found.findings) > 1
    keys = {"up": found.mend.up, "forward": found.mend.forward, "offset": found.mend.offset}
    again = ships.load(path, scale=found.mend.scale, **keys)
    assert again.metadata["findings"] == ()
    np.testing.assert_allclose(again.bounds, mesh.bounds, atol=0.02)
    assert again.metadata["digest"] == ships.digest(path, scale=0.001, **keys)
    assert ships.digest(path, scale=0.001, **keys) != ships.digest(path, scale=0.001)


def test_a_ship_under_water_is_refused_with_what_would_lift_it(ship, tmp_path):
    mesh, path = ship("duncan"), tmp_path / "hull.stl"
    trimesh.Trimesh(mesh.vertices * [1, -1, -1], mesh.faces, process=False).export(path)
    with pytest.raises(ships.ShipError, match=r"under water and is upside down.*\{up: -z\} would"):
        ships.load(path)
    np.testing.assert_allclose(ships.load(path, up="-z").bounds, mesh.bounds, atol=1e-4)


WRONG = [
    ({"up": "w"}, "up is 'w', but must be one of x, y, z, -x, -y, -z."),
    ({"up": None}, "up is None, but must be one of"),
    ({"up": ["z"]}, "up is ['z'], but must be one of"),
    ({"forward": "Z"}, "forward is 'Z', but must be one of"),
    ({"up": "y", "forward": "-y"}, "forward is '-y', but must be along another axis than up, 'y'."),
    ({"scale": 0}, "scale is 0, but must be"),
    ({"scale": -1}, "scale is -1, but must be"),
    ({"scale": np.nan}, "scale is nan, but must be"),
    ({"scale": "1"}, "scale is '1', but must be"),
    ({"offset": [1, 2]}, "offset is [1, 2], but must be 3 numbers."),
    ({"offset": 3}, "offset is 3, but must be 3 numbers."),
    ({"offset": [0, 0, np.inf]}, "offset[2] is inf, but must be"),
    ({"offset": [0, 2 * FARTHEST, 0]}, "offset[1] is 20000000.0, but must be"),
]


@pytest.mark.parametrize(("keys", "sentence"), WRONG)
def test_wrong_transforms_are_refused(keys, sentence):
    for function in (ships.Transform, lambda **one: ships.load("duncan", **one)):
        with pytest.raises(ships.ShipError) as refused:
            function(**keys)
        assert str(refused.value).startswith(sentence)
        assert "\n" not in str(refused.value) and str(refused.value).endswith(".")


TRANSFORMS = st.builds(
    lambda turn, scale, offset: ships.Transform(
        up=turn[0], forward=turn[1], scale=scale, offset=offset
    ),
    st.sampled_from(TURNS),
    st.floats(0.01, 100.0),
    st.tuples(*[st.floats(-1000, 1000)] * 3),
)


@given(TRANSFORMS, TRANSFORMS)
def test_two_transforms_are_one(first, second):
    """A rotation each, so that volumes keep their sign."""
    assert np.linalg.det(first.axes) == pytest.approx(1)
    points = np.array([[0, 0, 0], [1, 2, 3], [-40, 5, 20.0]])
    one, two = first.then(second).apply(points), second.apply(first.apply(points))
    np.testing.assert_allclose(one, two, rtol=1e-12, atol=1e-6)  # offsets to 1e-9 m, scaled


def test_equal_transforms_are_equal_however_they_are_written():
    assert ships.Transform(up="y") == ships.Transform(up="y", forward="x", offset=[0, -0.0, 0])
    assert ships.Transform(up="-x").forward == "z" and str(ships.Transform(up="-x")) == "up: -x"
    assert hash(ships.Transform()) == hash(ships.Transform(scale=1))

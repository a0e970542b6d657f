"""Meshes in other axes, units or origins are detected, and the proposed transform corrects them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from ncti import ships
from ncti.ships.orientation import diagnose
from ncti.ships.transform import AXES

TURNS = [(up, forward) for up in AXES for forward in AXES if up[-1] != forward[-1]]
ROUNDED = 0.01 * np.sqrt(3) / 2  # offsets are proposed to 0.01 m


def in_file(vertices, transform):
    """Return the coordinates of a file that a transform turns into these."""
    turned = (vertices - np.array(transform.offset)) / transform.scale
    return turned @ transform.axes


def wigley(length=100.0, beam=13.0, draught=4.5, freeboard=6.0) -> trimesh.Trimesh:
    """Return a hull of parabolic waterlines and frames, with topsides and a deckhouse."""
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


@pytest.mark.parametrize("name", ships.names())
@settings(max_examples=4, deadline=None)
@given(
    turn=st.sampled_from([turn for turn in TURNS if turn != ("z", "-x")]),
    scale=st.floats(0.2, 3.0),
    place=st.tuples(*[st.floats(-300, 300)] * 3),
)
def test_suggested_transform_undoes_any_transform(name, turn, scale, place):
    """Ships of any size, turned and shifted, have no findings after the proposed transform."""
    mesh = ships.load(name)
    vertices, faces = mesh.vertices * scale, np.array(mesh.faces)
    given_ = ships.Transform(up=turn[0], forward=turn[1], offset=place)
    file = in_file(vertices, given_)
    diagnosis = diagnose(file, faces)
    if diagnosis.suggested_transform is None:
        assert turn == ("z", "x")
        np.testing.assert_array_less(np.abs(place[:2]), 0.25 * np.ptp(vertices, axis=0)[:2] + 1e-9)
        return
    mended = diagnosis.suggested_transform.apply(file)
    assert diagnose(mended, faces).findings == ()
    if all(diagnosis.suggested_transform.offset):
        assert np.linalg.norm(mended - vertices, axis=1).max() <= ROUNDED + 1e-6 * scale


def test_a_hull_on_its_keel_is_lowered_by_a_draught():
    hull = wigley()
    vertices, faces = np.array(hull.vertices), np.array(hull.faces)
    assert diagnose(vertices, faces).findings == ()
    for lifted, findings in ((4.5, 1), (20.0, 2)):
        above = vertices + np.array([0, 0, lifted])
        diagnosis = diagnose(above, faces)
        assert len(diagnosis.findings) == findings and "keel" in diagnosis.findings[-1]
        mended = diagnosis.suggested_transform.apply(above)
        assert mended[:, 2].min() == pytest.approx(-13 / 3, abs=0.01)
        assert diagnose(mended, faces).findings == ()
    upside_down = ships.Transform(up="-z").apply(vertices)
    assert diagnose(upside_down, faces).findings[0] == "is upside down"


def test_suggested_transform_corrects_a_loaded_file(tmp_path):
    """The file is in millimetres, lies on its side, and has its origin at the stern."""
    mesh, path = ships.load("duncan"), tmp_path / "hull.stl"
    wrong = ships.Transform(up="y", forward="-z", scale=0.001, offset=(-67.0, 0.0, -9.0))
    trimesh.Trimesh(in_file(mesh.vertices, wrong), mesh.faces, process=False).export(path)
    description = ships.describe(path, scale=0.001)
    assert description.findings[0] == "stands on end" and len(description.findings) > 1
    keys = {
        "up": description.suggested_transform.up,
        "forward": description.suggested_transform.forward,
        "offset": description.suggested_transform.offset,
    }
    again = ships.load(path, scale=description.suggested_transform.scale, **keys)
    assert again.metadata["findings"] == ()
    np.testing.assert_allclose(again.bounds, mesh.bounds, atol=0.02)
    assert again.metadata["digest"] == ships.digest(path, scale=0.001, **keys)
    assert ships.digest(path, scale=0.001, **keys) != ships.digest(path, scale=0.001)


def test_submerged_ship_is_refused_with_suggested_fix(tmp_path):
    mesh, path = ships.load("duncan"), tmp_path / "hull.stl"
    trimesh.Trimesh(mesh.vertices * [1, -1, -1], mesh.faces, process=False).export(path)
    with pytest.raises(ships.ShipError, match=r"under water and is upside down.*\{up: -z\} would"):
        ships.load(path)
    np.testing.assert_allclose(ships.load(path, up="-z").bounds, mesh.bounds, atol=1e-4)


def block(size, middle) -> trimesh.Trimesh:
    return trimesh.creation.box(size).apply_translation(middle)


UPSIDE_DOWN = trimesh.util.concatenate(
    [block((100, 12, 8), (0, 0, 0)), block((20, 8, 10), (0, 0, -9.5))]
)
MODEL = trimesh.util.concatenate(
    [block((2.5, 0.6, 0.4), (0, 0, 0.2)), block((0.5, 0.4, 0.4), (0, 0, 0.67))]
)
STANCES = [  # a mesh, how far it is lifted, and the message about that
    (
        block((12, 6, 100), (0, 0, 0)),
        50.0,
        ["stands on end", "has its origin 50.0 m from amidships"],
    ),
    (trimesh.creation.cylinder(5, 100, sections=24), 0.0, ["stands on end"]),
    (block((60, 12, 100), (0, 0, 0)), 50.0, []),  # less than twice as high as long
    (UPSIDE_DOWN, 200.0, ["is upside down", "floats 185.5 m above the water"]),
    (UPSIDE_DOWN, 14.5, ["is upside down"]),
    (UPSIDE_DOWN, -30.0, ["lies wholly under water", "is upside down"]),
    (MODEL, 0.03, ["floats 3 cm above the water"]),
    (MODEL, 0.004, []),
]


@pytest.mark.parametrize(("mesh", "lift", "said"), STANCES)
def test_findings_describe_the_mesh_as_given(mesh, lift, said):
    given_ = mesh.vertices + np.array([0, 0, lift])
    diagnosis = diagnose(given_, mesh.faces)
    assert sorted(diagnosis.findings) == sorted(said)
    if diagnosis.suggested_transform is not None:
        assert diagnose(diagnosis.suggested_transform.apply(given_), mesh.faces).findings == ()


WRONG = [
    ({"up": "w"}, "up is 'w', but must be one of x, y, z, -x, -y, -z."),
    ({"forward": "Z"}, "forward is 'Z', but must be one of"),
    ({"up": "y", "forward": "-y"}, "forward is '-y', but must be along another axis than up, 'y'."),
    ({"scale": 0}, "scale is 0, but must be"),
    ({"scale": np.nan}, "scale is nan, but must be"),
    ({"offset": [1, 2]}, "offset is [1, 2], but must be 3 numbers."),
    ({"offset": [0, 0, np.inf]}, "offset[2] is inf, but must be"),
]


@pytest.mark.parametrize(("keys", "sentence"), WRONG)
def test_wrong_transforms_are_refused(keys, sentence):
    with pytest.raises(ships.ShipError) as refused:
        ships.load("duncan", **keys)
    assert str(refused.value).startswith(sentence)
    assert "\n" not in str(refused.value) and str(refused.value).endswith(".")

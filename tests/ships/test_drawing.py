"""The side view of ships in notebooks covers the areas of closed forms and of all facets."""

from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

from ncti import ships
from ncti.ships.drawing import COLUMNS, side_view, spans_at


def test_spans_of_bodies_are_those_of_their_sections():
    """Test a gate of two posts below a beam, beside a pyramid and a ball."""
    posts = [trimesh.creation.box((1, 1, 4)).apply_translation((x, 0, 2)) for x in (0, 4)]
    beam = trimesh.creation.box((5, 1, 1)).apply_translation((2, 0, 4.5))
    pyramid = trimesh.creation.cone(2.0, 6.0, sections=4).apply_translation((10, 0, 0))
    ball = trimesh.creation.icosphere(5, 2.0).apply_translation((20, 0, 3))
    mesh = trimesh.util.concatenate([*posts, beam, pyramid, ball])
    spans = lambda x: spans_at(np.array([x]), mesh.vertices, mesh.faces)[0]  # noqa: E731
    np.testing.assert_allclose(spans(0.1), [[0, 5]])
    np.testing.assert_allclose(spans(2.0), [[4, 5]])
    np.testing.assert_allclose(spans(11.0), [[0, 3]], atol=1e-9)
    np.testing.assert_allclose(spans(21.0), [[3 - np.sqrt(3), 3 + np.sqrt(3)]], atol=0.01)
    assert spans(7.0).shape == (0, 2)


def test_a_ship_covers_points_inside_its_facets():
    """Test points of the view by the signs of the areas that each spans with every facet."""
    ship = ships.load("duncan")
    flat = ship.triangles[..., [0, 2]]
    low, high = ship.bounds[:, [0, 2]]
    points = np.random.default_rng(4).uniform(low, high, (300, 2))
    spans = spans_at(points[:, 0], ship.vertices, ship.faces)
    covered = [
        bool(((column[:, 0] < z) & (z < column[:, 1])).any())
        for column, (_, z) in zip(spans, points, strict=True)
    ]
    inside = []
    for point in points:
        (ax, az), (bx, bz) = (
            np.moveaxis(flat[:, k] - point, -1, 0) for k in ([0, 1, 2], [1, 2, 0])
        )
        signs = np.sign(ax * bz - az * bx)
        inside.append(bool((np.abs(signs.sum(axis=1)) == 3).any()))
    assert covered == inside and 30 < sum(inside) < 270


@pytest.mark.parametrize("view", [ships.describe, ships.load])
def test_notebooks_show_a_ship_with_its_measures(view):
    description = ships.describe("texas", offset=[0, 0, 3])
    figure = ElementTree.fromstring(view("texas", offset=[0, 0, 3])._repr_html_())
    assert description.measures in "".join(figure.itertext())
    assert description.findings[0] in figure[1].text
    picture = figure[0]
    ratio = float(picture.get("height")) / float(picture.get("width"))
    assert ratio == pytest.approx(description.height / description.length, abs=1 / COLUMNS)


def test_names_are_escaped():
    box = trimesh.creation.box((4, 1, 1))
    picture = ElementTree.fromstring(side_view("<b>&", box.vertices, box.faces))
    assert picture[0].text == "<b>&"

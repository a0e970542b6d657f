"""The side view of ships in notebooks covers the areas of closed forms."""

from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection, FillRule

from ncti import ships
from ncti.ships.drawing import WIDTH, side_view


def test_side_view_has_correct_area_and_title():
    """Test a gate of two posts below a beam, beside a plate."""
    posts = [trimesh.creation.box((1, 1, 4)).apply_translation((x, 0, 2)) for x in (0, 4)]
    beam = trimesh.creation.box((5, 1, 1)).apply_translation((2, 0, 4.5))
    plate = trimesh.Trimesh([[8, 0, 0], [10, 0, 0], [10, 0, 3]], [[0, 1, 2], [0, 2, 1]])
    mesh = trimesh.util.concatenate([*posts, beam, plate])
    picture = ElementTree.fromstring(side_view("<b>&", mesh.vertices, mesh.faces))
    assert picture[0].text == "<b>&"
    outlines = [
        np.array([corner.split() for corner in ring.split("L")], dtype=float)
        for ring in picture[1].get("d").strip("Mz").split("zM")
    ]
    covered = CrossSection(outlines, FillRule.NonZero).area() * (10.5 / WIDTH) ** 2
    assert abs(covered) == pytest.approx(4 + 4 + 5 + 3, rel=0.005)


@pytest.mark.parametrize("view", [ships.describe, ships.load])
def test_repr_html_shows_measures_and_side_view(view):
    description = ships.describe("texas", offset=[0, 0, 3])
    figure = ElementTree.fromstring(view("texas", offset=[0, 0, 3])._repr_html_())
    assert description.measures in "".join(figure.itertext())
    assert description.findings[0] in figure[1].text
    picture = figure[0]
    ratio = float(picture.get("height")) / float(picture.get("width"))
    assert ratio == pytest.approx(description.height / description.length, abs=1 / WIDTH)

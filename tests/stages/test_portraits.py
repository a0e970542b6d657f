"""A user's ship in a configuration: its keys, its lines on the screen, its place in the store."""

import os
import pickle
import shlex

import numpy as np
import pytest
import trimesh
from range_channel import choose

import ncti.ships
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.stage import value_token
from sweeps.stages import portraits, views
from sweeps.stages.ships import ship_name
from sweeps.stages.views import Grid


def block(size, at):
    return trimesh.creation.box(size, trimesh.transformations.translation_matrix(at))


@pytest.fixture
def hull(tmp_path, monkeypatch):
    """Name of a file in millimetres, y up: a hull afloat with a house and a mast on it."""
    parts = [block((60, 10, 5), (0, 0, 2.5)), block((12, 8, 6), (-5, 0, 7)),
             block((1, 1, 14), (-2, 0, 14))]  # fmt: skip
    mesh = trimesh.boolean.union(parts, engine="manifold")
    axes = ncti.ships.Transform(up="y", scale=0.001).axes
    turned = trimesh.Trimesh(mesh.vertices @ axes * 1000, mesh.faces, process=False)
    turned.export(tmp_path / "hull.stl")
    monkeypatch.chdir(tmp_path)
    return "hull.stl"


def ship(**given):
    [found] = choose(grid__ship=given)[Grid.ship]
    return found


def test_a_mapping_is_a_ship_beside_names_and_paths(hull):
    found = choose(grid__ship=["texas", {"path": hull, "up": "y", "scale": 0.001}])[Grid.ship]
    assert found == ("hull", "texas")
    assert found[0].source == os.path.abspath(hull)
    assert found[0].transform == ncti.ships.Transform(up="y", scale=0.001)
    assert choose(grid__ship=list(found))[Grid.ship] == found
    assert ship(path="duncan", name="half", scale=0.5).source == "duncan"
    again = pickle.loads(pickle.dumps(found[0]))
    assert (again, again.origin) == (found[0], found[0].origin)


WRONG = [
    ({"up": "y"}, "grid.ship is {'up': 'y'}, but must have path"),
    ({"path": 3}, "grid.ship.path is 3, but must be a text"),
    ({"path": "duncan", "up": "w"}, "grid.ship.up has 'w', but every value must be one of x, y"),
    ({"path": "duncan", "up": ["x", "y"]}, "grid.ship.up has 2 values, but must have one"),
    ({"path": "duncan", "colour": 1}, "grid.ship.colour is not a key of the configuration; "),
    ({"path": "duncan", 3: 1}, "grid.ship.3 is not a key of the configuration; grid.ship has path"),
    ({"path": "duncan", "up": "y", "forward": "y"}, "forward is 'y', but must be along another"),
    ({"path": "duncan", "scale": 0}, "grid.ship.scale has 0, but every value must be"),
    ({"path": "duncan", "scale": {"start": 1, "stop": 2, "step": 1}}, "grid.ship.scale has 2 val"),
    ({"path": "duncan", "offset": [0, 0]}, "grid.ship.offset is [0, 0], but must be a list of 3"),
    ({"path": "duncan", "offset": [0, 0, True]}, "grid.ship.offset is [0, 0, True], but must be"),
    ({"path": "duncan", "name": "a\x1b[1m"}, r"grid.ship.name is 'a\x1b[1m', but must be 1 to 100"),
    ({"path": "duncan", "name": "a.stl"}, "grid.ship.name is 'a.stl', but must not end as a file"),
    ({"path": "duncan", "name": " "}, "grid.ship.name is ' ', but must be 1 to 100 printable"),
]


@pytest.mark.parametrize(("given", "sentence"), WRONG)
def test_wrong_keys_and_values_are_refused_in_one_sentence(given, sentence):
    with pytest.raises(ConfigurationError) as refused:
        choose(grid__ship=[given, "texas"])
    assert sentence in str(refused.value) and "\n" not in str(refused.value)
    assert str(refused.value).startswith("grid.ship")


def test_two_ships_have_two_labels(hull):
    with pytest.raises(ConfigurationError, match="'duncan' is the name of another ship"):
        choose(grid__ship=["duncan", {"path": "duncan", "scale": 0.5}])
    both = choose(grid__ship=["duncan", {"path": "duncan", "scale": 0.5, "name": "half"}])
    assert both[Grid.ship] == ("duncan", "half")


def test_only_ships_of_the_grid_are_mappings():
    for key in ("irar__flown", "classifier__unknown"):
        with pytest.raises(ConfigurationError, match="must be"):
            choose(**{key: {"path": "duncan"}})


def test_a_transform_counts_in_the_key_of_results(hull):
    turned, same, other = (
        views.hull(ship(path=hull, up=up, scale=0.001)) for up in ("y", "y", "-y")
    )
    assert value_token(turned) == value_token(same) != value_token(other)
    plain = ncti.ships.digest("duncan")
    assert views.hull(ship(path="duncan")).digest == views.hull(ship_name("duncan")).digest == plain
    np.testing.assert_allclose(views.read_mesh(turned).extents, (60, 10, 21), atol=1e-5)
    assert views.description(turned).length == pytest.approx(60)


def test_a_ship_is_told_in_a_line_and_what_is_wrong_in_another(hull):
    chosen = choose(grid__ship=["duncan", {"path": hull, "up": "y", "scale": 0.001}])
    duncan, own = portraits.about(chosen)
    assert duncan == "duncan  135.6 x 13.7 x 31.2 m, 43,672 facets"
    assert own.startswith("hull    60.0 x 10.0 x 21.0 m, ")
    lying = {"path": hull, "scale": 0.001, "name": "my hull", "up": "z", "offset": [0, 0, 50]}
    measures, warning = portraits.about(choose(grid__ship=lying))
    assert measures.startswith("my hull  60.0 x ")
    assert warning.startswith("warning: my hull lies on its side and has its origin 50.0 m off ")
    [fragment] = shlex.split(warning.partition("use ")[2])
    assert fragment.startswith('grid.ship={path: hull.stl, name: "my hull", up: y, scale: 0.001')
    assert "\n" not in warning


def test_of_many_ships_some_are_told(monkeypatch):
    monkeypatch.setattr(portraits, "MOST_LINES", 2)
    lines = portraits.about(choose(grid__ship=list(ncti.ships.names())))
    assert len(lines) == 3 and lines[2] == "and 4 more ships, 138.1 to 178.3 m long"


def test_a_window_that_is_too_small_for_a_shifted_ship_says_why():
    shifted = ship(path="duncan", offset=[65, 0, 0])
    assert views.hint(shifted).startswith("; duncan has its origin at the stern: if so, use no")
    assert views.hint(ship_name("duncan")) == ""


def test_a_portrait_is_the_ship_from_its_port_bow(hull):
    own = views.read_mesh(views.hull(ship(path=hull, up="y", scale=0.001)))
    found = portraits.portrait(own)
    assert (found["facets"], found["warning"]) == (len(own.faces), "")
    picture = found["picture"]
    assert picture.shape == (portraits.ROWS, portraits.COLUMNS) and picture.dtype == np.float32
    there = np.isfinite(picture)
    assert picture[there].min() >= 0 and picture[there].max() <= 1
    # The outline of a box: its silhouette's area over that of a pixel, within one pixel all round.
    box = block((60, 10, 5), (0, 0, 2.5))
    box.metadata.update(findings=(), mend=None)
    pixel, picture = portraits.drawn(box)
    aspect, depression = np.radians([portraits.ASPECT, portraits.DEPRESSION])
    towards = np.array([np.cos(aspect), np.sin(aspect)]) * np.cos(depression)
    area = np.abs([10 * 5, 60 * 5] @ towards) + 60 * 10 * np.sin(depression)
    count = np.isfinite(picture).sum()
    outline = 2 * (60 + 10 + 5) / pixel
    assert abs(count - area / pixel**2) < outline
    # Its bow is on the left, whose edge is the lower one: nearer to the eye, which looks down.
    rows = [np.flatnonzero(np.isfinite(column)).min() for column in picture.T[[5, -5]]
            if np.isfinite(column).any()]  # fmt: skip
    assert rows[0] < rows[1]

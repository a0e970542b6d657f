"""A user's ship in a configuration: its keys, its lines on the screen, its place in the store."""

import numpy as np
import pytest
import trimesh
from range_channel import choose

import ncti.ships
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.stage import value_token
from sweeps.stages import views
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


WRONG = [
    ({"up": "y"}, "grid.ship is {'up': 'y'}, but must have path"),
    ({"path": "duncan", "up": ["x", "y"]}, "grid.ship.up has 2 values, but must have one"),
    ({"path": "duncan", 3: 1}, "grid.ship.3 is not a key of the configuration; grid.ship has path"),
    ({"path": "duncan", "up": "y", "forward": "y"}, "forward is 'y', but must be along another"),
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


def test_a_transform_counts_in_the_key_of_results(hull):
    turned, same, other = (
        views.hull(ship(path=hull, up=up, scale=0.001)) for up in ("y", "y", "-y")
    )
    assert value_token(turned) == value_token(same) != value_token(other)
    plain = ncti.ships.digest("duncan")
    assert views.hull(ship(path="duncan")).digest == views.hull(ship_name("duncan")).digest == plain
    np.testing.assert_allclose(views.read_mesh(turned).extents, (60, 10, 21), atol=1e-5)
    assert views.description(turned).length == pytest.approx(60)

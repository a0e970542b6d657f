"""Ships are known by their meshes, and drawn finely enough at the depression of the scene."""

import re

import numpy as np
import pytest
import trimesh
from range_channel import choose

import ncti.ships
from ncti.render import Sampling, line_image, refined
from sweeps.engine.declare.settings import CACHE_VARIABLE, read_choices
from sweeps.engine.declare.stage import value_token
from sweeps.experiment import EXPERIMENT
from sweeps.stages import meshes, views
from sweeps.stages.ships import ship_name
from sweeps.stages.views import Grid


@pytest.fixture
def box(tmp_path):
    """Return the path of a floating mesh, with a name of its own."""
    mesh = trimesh.creation.box((40.0, 8.0, 6.0))
    mesh.apply_translation((0, 0, 3.0))
    path = tmp_path / "barge.stl"
    mesh.export(path)
    return path


def test_mesh_key_depends_on_file_content_not_on_its_name(box, tmp_path):
    """Its key does not depend on the name of the file."""
    copy = tmp_path / "again.stl"
    copy.write_bytes(box.read_bytes())
    first, second = (views.mesh_source(ship_name(str(path))) for path in (box, copy))
    assert value_token(first) == value_token(second)
    assert value_token(first) != value_token(views.mesh_source(ship_name("duncan")))


def test_mesh_key_depends_on_the_transform(box):
    """A turn about the vertical changes the key, and the same transform does not."""
    (plain,), (turned,), (again,) = (
        choose(grid__ship={"path": str(box), "forward": axis})[Grid.ship]
        for axis in ("x", "-x", "-x")
    )
    tokens = [value_token(views.mesh_source(name)) for name in (plain, turned, again)]
    assert tokens[1] == tokens[2] != tokens[0]


def test_a_ship_that_changed_is_refused(box):
    before = views.mesh_source(ship_name(str(box)))
    mesh = trimesh.creation.box((41.0, 8.0, 6.0))
    mesh.apply_translation((0, 0, 3.0))
    mesh.export(box)
    with pytest.raises(ValueError, match="was changed while the sweep ran"):
        views.mesh(before)


def test_building_many_ships_logs_progress(tmp_path, monkeypatch, caplog):
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    monkeypatch.setattr(meshes, "FEW_SHIPS", 2)
    monkeypatch.setattr(meshes, "LINE_INTERVAL", 0.0)
    names = ["duncan@0.11", "duncan@0.12", "duncan@0.13"]
    views.check(read_choices(EXPERIMENT.declared, {"grid.ship": names[:2]}))
    assert caplog.messages == []
    (tmp_path / "meshes").rename(tmp_path / "two")
    meshes.description.cache_clear()
    views.check(read_choices(EXPERIMENT.declared, {"grid.ship": names}))
    first, *progress = caplog.messages
    assert first == "building 3 ships (once)"
    assert progress
    assert all(re.fullmatch("[1-3] of 3 ships are built", line) for line in progress)
    assert len([*(tmp_path / "meshes").iterdir()]) == 3
    caplog.clear()
    views.check(read_choices(EXPERIMENT.declared, {"grid.ship": names}))
    assert caplog.messages == []


def image_of(aspect, samples=20_000):
    mesh_source = views.mesh_source(ship_name("duncan"))
    view = (aspect, 3.84, None, Sampling("embree", 0.25, samples, views.ROLL), ())
    return views.image(views.mesh(mesh_source), *view)


def test_ends_are_drawn_finer_than_broadsides():
    end, broadside = image_of(0.0), image_of(60.0)
    assert end.pixel < 0.25 == broadside.pixel
    assert end.hit.sum() == pytest.approx(20_000, rel=0.02)


@pytest.mark.parametrize("aspect", [0.0, 56.0, 200.0])
def test_line_spacing_is_halved_until_lines_suffice(aspect):
    mesh, sampling = ncti.ships.load("duncan"), Sampling("lines", 0.25, 20_000, views.ROLL)
    view = {"aspect": aspect, "depression": 3.84, "roll": sampling.roll_at(aspect)}
    lines = line_image(mesh, spacing=0.25, **view)
    while lines.area.sum() < 20_000 * lines.spacing**2 and lines.spacing > 0.0625:
        lines = refined(mesh, lines)
    drawn = sampling.draw(mesh, aspect=aspect, depression=3.84)
    for name, value in vars(lines).items():
        np.testing.assert_array_equal(getattr(drawn, name), value, err_msg=name)


def test_depression_follows_the_scene_geometry():
    scene = {"altitude": 6705.6, "earth_radius": 6371e3}
    assert views.depression(100e3, "fixed", 3.84, **scene) == 3.84
    assert views.depression(100e3, "altitude", 3.84, **scene) == pytest.approx(3.396, abs=0.001)
    assert views.depression(25e3, "altitude", 3.84, **scene) == pytest.approx(15.46, abs=0.01)


@pytest.mark.parametrize(
    ("tolerance", "skip", "drawn"),
    [
        (None, "all", 100e3),
        (0.01, "all", 100e3),
        (0.011, "all", None),
        (0.011, "none", 100e3),
    ],
)
def test_far_field_is_used_below_a_tenth_of_the_tolerance(tolerance, skip, drawn):
    mesh_source = views.mesh_source(ship_name("duncan"))
    assert views.drawn_range(mesh_source, 100e3, tolerance, skip) == drawn

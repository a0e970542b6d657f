"""Ships by name and path, what an image is drawn of, and which ranges a scene allows."""

import pickle
from pathlib import Path

import numpy as np
import pytest
import trimesh
from range_channel import EXPERIMENT, choose

import ncti.ships
from ncti.render import range_image
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.plan import Plan
from sweeps.engine.settings import read_choices
from sweeps.engine.stage import Experiment, Output, plain, stage, value_token
from sweeps.stages import ladar, views
from sweeps.stages.ships import ship_name
from sweeps.stages.views import Grid, Hull, Sweep


@pytest.fixture
def box(tmp_path):
    """Path of a mesh that floats, of a name of its own."""
    mesh = trimesh.creation.box((40.0, 8.0, 6.0))
    mesh.apply_translation((0, 0, 3.0))
    path = tmp_path / "barge.stl"
    mesh.export(path)
    return path


def test_ships_are_sorted_by_label_and_keep_their_source(box):
    found = choose(grid__ship=["texas", str(box), "duncan"])[Grid.ship]
    assert found == ("barge", "duncan", "texas")
    assert [ship.source for ship in found] == [str(box), "duncan", "texas"]


def test_a_path_is_made_absolute(box, monkeypatch):
    monkeypatch.chdir(box.parent)
    assert ship_name("barge.stl").source == str(box)


def test_a_ship_goes_to_workers_with_its_source(box):
    again = pickle.loads(pickle.dumps(ship_name(str(box))))
    assert (again, again.source) == ("barge", str(box))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["duncan", "duncan"], "grid.ship has 'duncan' more than once, but values must differ"),
        (
            ["duncan", "elsewhere/duncan.stl"],
            "grid.ship has 'elsewhere/duncan.stl', but 'duncan' is the name of another ship of the "
            "grid",
        ),
        ([], "grid.ship is empty, but must hold at least one value"),
        (3, "grid.ship is 3, but must be a ship, or a list of ships"),
        ([""], "grid.ship is [''], but must be a ship, or a list of ships"),
    ],
)
def test_wrong_ships_are_refused(given, said):
    with pytest.raises(ConfigurationError) as error:
        choose(grid__ship=given)
    assert str(error.value) == said


@pytest.mark.parametrize("name", ["nobody", "nowhere.stl"])
def test_ships_that_are_not_there_are_refused(name):
    with pytest.raises(ConfigurationError, match=r"^grid\.ship has '.*': "):
        views.check(choose(grid__ship=name))


def test_a_mesh_that_is_not_fit_is_refused(tmp_path):
    mesh = trimesh.creation.box((40.0, 8.0, 6.0))
    trimesh.Trimesh(mesh.vertices, mesh.faces[1:]).export(tmp_path / "leak.stl")
    with pytest.raises(ConfigurationError, match=r"^grid\.ship has '.*leak\.stl': "):
        views.check(choose(grid__ship=str(tmp_path / "leak.stl")))


def test_a_hull_is_what_is_in_its_file(box, tmp_path):
    """Wherever it lies, and whatever it is called."""
    copy = tmp_path / "again.stl"
    copy.write_bytes(box.read_bytes())
    first, second = (views.hull(ship_name(str(path))) for path in (box, copy))
    assert value_token(first) == value_token(second)
    assert value_token(first) != value_token(views.hull(ship_name("duncan")))


def test_a_ship_that_changed_is_refused(box):
    before = views.hull(ship_name(str(box)))
    mesh = trimesh.creation.box((41.0, 8.0, 6.0))
    mesh.apply_translation((0, 0, 3.0))
    mesh.export(box)
    with pytest.raises(ValueError, match="was changed while the sweep ran"):
        views.mesh(before)


def test_meshes_are_kept_where_the_environment_says(tmp_path, monkeypatch):
    loaded = []

    def load(source, *, cache, **transform):
        loaded.append((source, cache))
        return trimesh.Trimesh(metadata={"digest": "d"})

    monkeypatch.setattr(ncti.ships, "load", load)
    monkeypatch.setenv(views.CACHE_VARIABLE, str(tmp_path))
    views.mesh(Hull("made up for this test", "d"))
    assert loaded == [("made up for this test", tmp_path / "meshes")]


@pytest.mark.parametrize(
    ("given", "sensors"),
    [
        ("range", ("range",)),
        ("both", ("infrared", "range")),
        (["range", "infrared"], ("infrared", "range")),
        ("irar", ("irar",)),
    ],
)
def test_sensors_are_a_set(given, sensors):
    assert choose(sensor=given).one(Sweep.sensor) == sensors
    looking = {
        name for name in ("range", "infrared", "irar") if views.looks(name)(choose(sensor=given))
    }
    assert looking == set(sensors)


def test_an_unknown_sensor_is_refused():
    words = "range, infrared, irar, run_time, scan, both"
    with pytest.raises(ConfigurationError, match=f"must be one of {words}"):
        choose(sensor="sonar")


@pytest.fixture
def drawn(monkeypatch):
    """Every image drawn, as (pixel, samples)."""
    log = []

    def draw(*args, **kwargs):
        image = range_image(*args, **kwargs)
        log.append((image.pixel, int(image.hit.sum())))
        return image

    monkeypatch.setattr(views, "range_image", draw)
    return log


def image_of(aspect, samples=20_000):
    hull = views.hull(ship_name("duncan"))
    view = (aspect, 3.84, None, "embree", 0.25, samples, views.ROLL, ())
    return views.image(views.mesh(hull), *view)


def test_ends_are_drawn_finer_and_broadsides_once(drawn):
    image_of(0.0)
    (first, few), (second, enough) = drawn
    assert first == 0.25 and second < 0.25
    assert few < 20_000
    assert enough == pytest.approx(20_000, rel=0.02)
    drawn.clear()
    image_of(60.0)
    assert len(drawn) == 1


def test_no_image_is_drawn_much_finer(drawn):
    """However many samples are asked for."""
    image = image_of(0.0, samples=10**7)
    assert [pixel for pixel, _ in drawn] == [0.25, 0.25 * views.FINEST]
    assert image.pixel == 0.25 * views.FINEST


def test_depressions_are_of_the_scene():
    scene = {"altitude": 6705.6, "earth_radius": 6371e3}
    assert views.depression(100.0, "fixed", 3.84, **scene) == 3.84
    assert views.depression(100.0, "altitude", 3.84, **scene) == pytest.approx(3.396, abs=0.001)
    assert views.depression(25.0, "altitude", 3.84, **scene) == pytest.approx(15.46, abs=0.01)


def images_of(**given):
    """Keys of images over range, and of those that are read with a depression of their own."""

    @plain(name="own_depression")
    def own_depression():
        return 3.84

    @stage(Output("size"), group="sizes", reads={"other": "own_image"})
    def size(image, other):
        return image.hit.size - other.hit.size

    experiment = Experiment(
        "images",
        "Images",
        settings=(*views.SETTINGS, *ladar.SETTINGS),
        stages=(
            *(*views.STAGES, ladar.fineness, own_depression),
            *views.image_stages("own_image", range=Grid.range, depression="own_depression"),
            size,
        ),
    )
    plan = Plan(experiment, read_choices(experiment.declared, {"grid.range": [25, 100], **given}))
    return [
        {plan.key(plan.bound[name], place)[:8] for place in plan.cells(plan.bound[name])}
        for name in ("image", "own_image")
    ]


def test_images_of_equal_depression_and_drawn_range_are_one_result():
    """Whichever stage has them drawn."""
    view = {"grid.ship": "duncan", "grid.aspect": 30}
    of_ranges, own = images_of(**view)
    assert of_ranges == own and len(own) == 2
    of_ranges, own = images_of(**view, **{"scene.geometry": "altitude"})
    assert len(of_ranges) == 2 and not set(of_ranges) & set(own)


def test_ranges_share_the_far_field_where_a_tolerance_allows_it():
    """Duncan reaches 68.5 m: 1.5 reach / range is 0.41 % at 25 km and 0.103 % at 100 km."""
    view = {"grid.ship": "duncan", "grid.aspect": 30}
    assert len(images_of(**view, **{"render.tolerance": 0.042})[0]) == 1
    assert len(images_of(**view, **{"render.tolerance": 0.011})[0]) == 2
    drawn_each = {"render.tolerance": 0.042, "render.skip": "none"}
    assert len(images_of(**view, **drawn_each)[0]) == 2


@pytest.mark.parametrize(
    ("tolerance", "skip", "drawn"),
    [
        (None, "all", 100e3),
        (0.01, "all", 100e3),
        (0.011, "all", None),
        (0.011, "none", 100e3),
    ],
)
def test_a_ship_is_drawn_at_its_range_unless_the_far_field_costs_a_tenth_of_the_tolerance(
    tolerance, skip, drawn
):
    hull = views.hull(ship_name("duncan"))
    assert views.drawn_range(hull, 100.0, tolerance, skip) == drawn


@pytest.mark.parametrize(
    ("engine", "fineness"), [("embree", ()), ("lines", ()), ("lines", (0.1, 30, 1))]
)
def test_every_image_is_of_its_drawn_range(box, engine, fineness):
    mesh = ncti.ships.load(str(box))
    for drawn in (None, 4e3):
        image = views.image(mesh, 30.0, 3.84, drawn, engine, 0.5, 0, views.ROLL, fineness)
        assert image.slant_range == drawn


def test_an_engine_that_is_not_there_is_refused(monkeypatch):
    def choose_none(name):
        raise views.EngineError("it does not start")

    monkeypatch.setattr(views, "choose_engine", choose_none)
    with pytest.raises(ConfigurationError, match=r"^render\.engine is 'egl': it does not start$"):
        views.drawing_engine("egl", None)


def test_ranges_beyond_the_scene_are_refused():
    choices = choose(scene__geometry="altitude", scene__altitude=6000)
    with pytest.raises(ConfigurationError, match=r"^grid\.range has 5: .*altitude"):
        views.check_range(choices, "grid.range", 5.0, narrowest=150.0, beam="ladar.ifov")
    with pytest.raises(ConfigurationError, match=r"^grid\.range has 300: .*horizon"):
        views.check_range(choices, "grid.range", 300.0, narrowest=150.0, beam="ladar.ifov")


def test_beams_narrower_than_a_pixel_are_refused():
    """1 urad at 100 km is 0.1 m wide; what is said of it is told in the tests of the sensors."""
    with pytest.raises(ConfigurationError, match=r"^grid\.range has 100, where ladar\.ifov of 1 "):
        views.check_range(choose(), "grid.range", 100.0, narrowest=1.0, beam="ladar.ifov")
    views.check_range(choose(render__pixel=0.09), "r", 100.0, narrowest=1.0, beam="ladar.ifov")


def test_every_setting_says_what_it_is():
    for setting in EXPERIMENT.declared:
        assert setting.label and not setting.label.endswith("."), setting.key
        assert Path(setting.key).name == setting.key


def test_defaults_are_the_source_s_data_base():
    choices = choose()
    assert choices[Grid.ship] == ("duncan", "horne", "spruance", "texas")
    np.testing.assert_array_equal(choices[Grid.aspect], np.arange(0, 91, 3))

"""Every configuration composes; every wrong one is refused in one sentence, nothing written."""

import numpy as np
import pytest
import trimesh
from hydra import compose, initialize_config_dir
from hypothesis import given
from hypothesis import strategies as st
from sweeping import contents

from ncti.render import ROLL
from sweeps.app import check_jobs, conf_folder, main, replace_axes
from sweeps.errors import ConfigurationError
from sweeps.grid import number_axis
from sweeps.prepare import prepare
from sweeps.schema import register, unread

register()


def composed(*overrides):
    with initialize_config_dir(str(conf_folder()), version_base="1.3"):
        return compose("config", overrides=list(overrides))


GROUPS = sorted(
    (path.parent.name, path.stem)
    for path in conf_folder().glob("*/*.yaml")
    if path.parent.name != "experiment"
)
EXPERIMENTS = sorted(path.stem for path in conf_folder().glob("experiment/*.yaml"))


@pytest.mark.parametrize(("group", "name"), GROUPS, ids=lambda v: v)
def test_every_group_composes(group, name, tmp_path):
    sensor = "both" if name == "fusion" else "range"
    prepared = prepare(composed(f"{group}={name}", f"sensor={sensor}", f"cache={tmp_path}"))
    assert [ship.label for ship in prepared.ships] == ["duncan", "horne", "spruance", "texas"]


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_composes(name, tmp_path):
    prepared = prepare(composed(f"+experiment={name}", f"cache={tmp_path}"))
    config = prepared.config
    grid = config.grid.expand()
    assert config.sensors
    if "range" in config.sensors:
        # At its near ranges a profile has thousands of beams: one pulse shows what fusion does.
        assert grid.pulse_width == ((30,) if name == "fusion" else (10, 30, 50))
    if "infrared" in config.sensors:
        assert config.infrared.expand(grid).vigilance == (0.87,)


def test_paper_is_the_sources_grid(tmp_path):
    grid = prepare(composed("+experiment=paper", f"cache={tmp_path}")).config.grid.expand()
    assert grid.ship == ("duncan", "horne", "spruance", "texas")
    assert grid.aspect == tuple(range(0, 91, 3))
    assert grid.pulse_width == (10, 30, 50)
    assert grid.frame_count == (4, 8, 16, 32)
    assert grid.range == (100,)
    assert grid.vigilance == (0.80, 0.85, 0.90, 0.95, 0.99)


def test_defaults_are_those_of_the_library(tmp_path):
    config = prepare(composed(f"cache={tmp_path}")).config
    assert config.render.roll == ROLL
    assert config.render.pixel == 0.25


@pytest.mark.parametrize(
    ("override", "values"),
    [
        ("grid.aspect=30", (30,)),
        ("grid.aspect=[0,45,7.5]", (0, 45, 7.5)),
        ("grid.aspect={start:0,stop:0.3,step:0.1}", (0, 0.1, 0.2, 0.3)),
        ("grid.aspect={start:0,stop:100,step:45}", (0, 45, 90)),
        ("grid.aspect.step=45", (0, 45, 90)),
    ],
)
def test_forms_of_the_aspect_axis(override, values, tmp_path):
    config = composed(*replace_axes([override]), f"cache={tmp_path}")
    assert prepare(config).config.grid.expand().aspect == values


@given(
    st.one_of(
        st.none(),
        st.booleans(),
        st.text(max_size=5),
        st.floats(),
        st.integers(),
        st.lists(st.one_of(st.floats(), st.integers(), st.none(), st.text(max_size=3)), max_size=4),
        st.dictionaries(st.sampled_from(["start", "stop", "step", "x"]), st.floats(), max_size=4),
    )
)
def test_an_axis_is_finite_numbers_in_range_or_a_sentence(spec):
    try:
        values = number_axis("grid.aspect", spec, minimum=0, below=360)
    except ConfigurationError as error:
        assert "grid.aspect" in str(error)
        assert "must" in str(error)
        assert "\n" not in str(error)
    else:
        assert values
        assert all(np.isfinite(values)) and min(values) >= 0 and max(values) < 360
        assert len(set(values)) == len(values)


WRONG = {
    "grid.ship=bismarck": ("grid.ship", "bismarck", "duncan"),
    "grid.ship=[]": ("grid.ship", "empty"),
    "grid.ship=[duncan,duncan]": ("grid.ship", "duncan", "differ"),
    "grid.ship=7": ("grid.ship", "7"),
    "grid.aspect=[]": ("grid.aspect", "empty"),
    "grid.aspect=-3": ("grid.aspect", "-3", "at least 0"),
    "grid.aspect=360": ("grid.aspect", "360", "below 360"),
    "grid.aspect=nan": ("grid.aspect", "nan", "finite"),
    "grid.aspect=inf": ("grid.aspect", "inf", "finite"),
    "grid.aspect=bow": ("grid.aspect", "bow"),
    "grid.aspect={start:0,stop:90}": ("grid.aspect", "step"),
    "grid.aspect={start:90,stop:0,step:3}": ("grid.aspect", "stop"),
    "grid.aspect={start:0,stop:90,step:0}": ("grid.aspect.step", "above 0"),
    "grid.aspect={start:0,stop:90,step:1e-9}": ("grid.aspect.step", "1e-09"),
    "grid.aspect.step=[3]": ("grid.aspect.step", "number"),
    "grid.pulse_width=0": ("grid.pulse_width", "0"),
    "grid.pulse_width=[30,-30]": ("grid.pulse_width", "-30"),
    "grid.frame_count=2.5": ("grid.frame_count", "2.5", "whole"),
    "grid.frame_count=0": ("grid.frame_count", "0"),
    "grid.range=-100": ("grid.range", "-100"),
    "grid.range=100km": ("grid.range", "100km"),
    "grid.vigilance=1.5": ("grid.vigilance", "1.5", "at most 1"),
    "grid.vigilance=[0.9,0.9]": ("grid.vigilance", "0.9", "differ"),
    "grid.shp=duncan": ("grid.shp", "ship"),
    "gird.ship=duncan": ("gird",),
    "+colour=red": ("colour", "grid"),
    "++ladar.power=3": ("ladar.power", "cnr"),
    "+experiment=nope": ("experiment", "nope", "paper", "smoke"),
    "ladar=nope": ("ladar", "nope", "full_profile"),
    "seed=abc": ("seed", "abc", "integer"),
    "seed=-1": ("seed", "-1"),
    "render.engine=povray": ("render.engine", "povray", "osmesa"),
    "render.pixel=0": ("render.pixel", "0"),
    "render.pixel=nan": ("render.pixel", "nan"),
    "scene.depression=91": ("scene.depression", "91"),
    "ladar.window=5": ("ladar.window", "5"),
    "ladar.target_free_ifovs=-1": ("ladar.target_free_ifovs", "-1"),
    "ladar.receiver=ear": ("ladar.receiver", "ear", "peak_pulse"),
    "classifier.learning_rate=0": ("classifier.learning_rate", "0"),
    "cluster.workers=0": ("cluster.workers", "0"),
    "store=": ("store", "path"),
    "grid.pulse_width=9": ("grid.pulse_width", "9", "9.43", "ladar.bin_width"),
    "ladar.bin_width=2 grid.pulse_width=10": ("grid.pulse_width", "18.9"),
    "grid.range=1": ("grid.range", "ladar.ifov", "render.pixel"),
    "grid.ship=duncan ladar.window=150": ("ladar.window", "150", "duncan"),
    "ladar=peak_pulse ladar.target_free_ifovs=1000000": ("ladar.target_free_ifovs", "peak_pulse"),
    f"grid.aspect=1{'0' * 400}": ("grid.aspect", "below 360"),
    f"seed=1{'0' * 400}": ("seed",),
    "grid=[1]": ("grid",),
    "store=/proc/x.zarr": ("store", "/proc"),
    "cache=/proc/x": ("cache", "/proc"),
    "grid.ship=duncan hydra.run.dir=/proc/x": ("/proc/x",),
    "=3": ("=3",),
}


def refused(arguments, folder, monkeypatch, capsys):
    """Run the command; returns its sentence once it is known that nothing else happened."""
    before = contents(folder)
    monkeypatch.chdir(folder)
    monkeypatch.setattr("sys.argv", ["ncti-sweep", *arguments])
    with pytest.raises(SystemExit) as exit_:
        main()
    printed = capsys.readouterr()
    assert exit_.value.code == 2
    assert printed.out == ""
    assert printed.err.startswith("ncti-sweep: ")
    assert printed.err.count("\n") == 1
    assert "Traceback" not in printed.err
    assert contents(folder) == before
    return printed.err


@pytest.mark.parametrize("override", WRONG, ids=str)
def test_wrong_configuration(override, tmp_path, monkeypatch, capsys):
    sentence = refused(override.split(" "), tmp_path, monkeypatch, capsys)
    for word in WRONG[override]:
        assert word in sentence


def test_altitude_above_the_slant_range(tmp_path, monkeypatch, capsys):
    sentence = refused(["scene=altitude", "grid.range=5"], tmp_path, monkeypatch, capsys)
    assert "grid.range" in sentence and "altitude" in sentence


def test_ship_beyond_the_horizon(tmp_path, monkeypatch, capsys):
    sentence = refused(["scene=altitude", "grid.range=400"], tmp_path, monkeypatch, capsys)
    assert "grid.range" in sentence and "horizon" in sentence


def test_one_wrong_job_of_a_multirun_stops_all(tmp_path, monkeypatch, capsys):
    arguments = ["-m", "grid.aspect=[0],[400]", "grid.ship=duncan"]
    assert "400" in refused(arguments, tmp_path, monkeypatch, capsys)


def test_jobs_of_a_multirun_do_not_share_a_store(tmp_path, monkeypatch, capsys):
    arguments = ["-m", "grid.vigilance=0.9,0.95", "store=here.zarr"]
    assert "here.zarr" in refused(arguments, tmp_path, monkeypatch, capsys)


def test_one_store_spelt_two_ways(tmp_path, monkeypatch, capsys):
    arguments = ["-m", "grid.ship=duncan", "store=a.zarr,./a.zarr"]
    assert "a.zarr" in refused(arguments, tmp_path, monkeypatch, capsys)


def test_a_glob_is_left_to_hydra():
    check_jobs(["-m", "ladar=glob(*)", "grid.ship=duncan"])


def test_a_store_named_by_the_job_is_left_to_hydra(tmp_path):
    check_jobs(["-m", "grid.vigilance=0.9,0.95", "store=${hydra:job.num}.zarr"])


def box(**changes):
    mesh = trimesh.creation.box(extents=(60, 10, 8))
    mesh.apply_translation((0, 0, 4))
    return mesh


def bad_mesh(kind, path):
    mesh = box()
    if kind == "open":
        mesh.update_faces(np.arange(len(mesh.faces)) > 0)
    elif kind == "empty":
        path.write_bytes(b"")
        return
    elif kind == "inverted":
        mesh.invert()
    elif kind == "millimetres":
        mesh.apply_scale(1000)
    elif kind == "nan":
        text = mesh.export(file_type="obj").replace("-30.", "nan ", 1)
        path.write_text(text)
        return
    elif kind == "garbage":
        path.write_bytes(bytes(range(256)) * 20)
        return
    mesh.export(path)


@pytest.mark.parametrize("kind", ["open", "empty", "inverted", "millimetres", "nan", "garbage"])
def test_bad_mesh(kind, tmp_path, monkeypatch, capsys):
    path = tmp_path / ("ship.obj" if kind == "nan" else "ship.stl")
    bad_mesh(kind, path)
    sentence = refused([f"grid.ship={path}", f"cache={tmp_path}"], tmp_path, monkeypatch, capsys)
    assert "grid.ship" in sentence
    assert "ship." in sentence


def test_unreadable_mesh_and_unknown_ending(tmp_path, monkeypatch, capsys):
    missing = f"grid.ship={tmp_path}/none.stl"
    assert "none.stl" in refused([missing], tmp_path, monkeypatch, capsys)
    (tmp_path / "notes.txt").write_text("a ship")
    other = f"grid.ship={tmp_path}/notes.txt"
    assert "notes.txt" in refused([other], tmp_path, monkeypatch, capsys)


def test_a_good_mesh_is_a_ship(tmp_path):
    box().export(tmp_path / "barge.stl")
    prepared = prepare(composed(f"grid.ship={tmp_path}/barge.stl", f"cache={tmp_path}"))
    assert [ship.label for ship in prepared.ships] == ["barge"]


def test_something_else_at_the_store_is_not_touched(tmp_path, monkeypatch, capsys):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "data").write_text("precious")
    sentence = refused(["store=mine"], tmp_path, monkeypatch, capsys)
    assert "mine" in sentence
    sentence = refused(["store=mine/data/s.zarr"], tmp_path, monkeypatch, capsys)
    assert "data" in sentence
    sentence = refused(["cache=mine/data"], tmp_path, monkeypatch, capsys)
    assert "cache" in sentence
    (tmp_path / "new-tables").write_text("precious")
    sentence = refused(["store=new.zarr"], tmp_path, monkeypatch, capsys)
    assert "new-tables" in sentence


@pytest.mark.parametrize(
    ("sensor", "given", "told"),
    [
        ("range", ["ladar.cnr=20", "grid.range=100", "seed=3"], []),
        ("range", ["infrared.nedt=1", "+irar.cnr=10"], ["infrared.nedt", "irar.cnr"]),
        ("infrared", ["++grid.pulse_width=null", "grid.pulse_width=30"], ["grid.pulse_width"]),
        ("infrared", ["infrared.range=50", "scene.depression=2"], []),
        ("both", ["ladar.cnr=1", "infrared.nedt=1", "irar=default"], ["irar"]),
        ("irar", ["irar.range=3", "ladar.ifov=150", "grid.pulse_width=30", "grid.rangefoo=1"], []),
        ("irar", ["scene.depression=1", "grid.frame_count=3"], ["scene.dep", "grid.frame_count"]),
    ],
)
def test_keys_that_a_sensor_does_not_read_are_told(sensor, given, told):
    found = unread(given, sensor)
    assert len(found) == len(told)
    for key, sentence in zip(told, found, strict=True):
        assert sentence.startswith(key)
        assert f"is set, but is not read where sensor is {sensor}" in sentence
    assert unread(["grid.range=3"], "irar")[0].endswith("irar: irar.range is")

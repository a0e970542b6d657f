"""Every configuration file composes, and every experiment runs at a small size."""

import runpy
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
import yaml
from commands import COMMAND, FAST, chosen, groups_of, ran
from matplotlib import pyplot as plt
from matplotlib.image import imread
from rich.cells import cell_len

from ncti.render import available_engines
from ncti.render.choice import engines
from sweeps.engine.resolve.plan import Plan
from sweeps.experiment import EXPERIMENT, conf_folder
from sweeps.stages.classifier import Classifier
from sweeps.stages.irar import Irar
from sweeps.stages.ladar import Ladar
from sweeps.stages.views import Grid

GROUPS = sorted(
    (path.parent.name, path.stem)
    for path in conf_folder().glob("*/*.yaml")
    if path.parent.name != "experiment"
)
DOCS = conf_folder().parent / "docs"
EXPERIMENTS = sorted(
    path.stem
    for folder in (conf_folder(), *EXPERIMENT.added_conf)
    for path in folder.glob("experiment/*.yaml")
)

ROWS = yaml.safe_load(Path(__file__).with_name("experiments.yaml").read_text())
TINY, GALLERY = ROWS["small"], ROWS["pictures"]
PAGES = {"benchmark", "operate", "paper", "reproduce", "runtime_vs_error", "scan", "validation"}
"""Experiments whose page is written; that of any other has the same kinds of tables."""


@pytest.mark.parametrize(("group", "name"), GROUPS)
def test_every_group_choice_composes(group, name):
    sensor = "sensor=both" if name == "fusion" else "sensor=range"
    assert chosen(f"{group}={name}", sensor, "grid.ship=duncan").value(Grid.pulse_width) == 30


def test_classifier_and_receiver_configs_match_declared_choices():
    key = Classifier.name.key
    (names,) = (setting.kind.words for setting in EXPERIMENT.declared if setting.key == key)
    choices = {file for group, file in GROUPS if group == "classifier"}
    assert "all" in choices and choices - {"all"} <= {*names}
    receivers = {file for group, file in GROUPS if group == "ladar"}
    assert receivers == set(Ladar.receiver.kind.words)


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_composes(name):
    choices = chosen(f"+experiment={name}", *ROWS["composed"].get(name, ()))
    assert choices[Grid.ship]
    missing = len(engines()) - len(available_engines())
    skipped = [line for line in COMMAND.remarks(choices) if "without" in line]
    assert len(skipped) == (missing if name == "runtime_vs_error" else 0)


def test_command_line_axes_precede_experiment_axes():
    plan = Plan(EXPERIMENT, chosen("+experiment=smoke", "ladar.cnr=[23,26]"))
    swept = [setting.name for setting in plan.varied_settings]
    assert swept[0] == "cnr" and "pulse_width" in swept


def test_ignored_classifiers_are_reported_only_if_requested():
    infrared = ("sensor=infrared", "grid.ship=[duncan,texas]")
    choices = chosen(*infrared, "classifier.name=[acn,correlation]")
    line = "classifier.name=correlation has nothing to do for sensor=infrared; ignored"
    assert line in COMMAND.remarks(choices)
    unasked = COMMAND.remarks(chosen("+experiment=scan"))  # it has acn by default
    assert not [line for line in unasked if "ignored" in line]


def test_sensitivity_varies_one_parameter_at_a_time():
    errors = chosen("+experiment=sensitivity")[Irar.errors]
    assert len(errors) == 1 + 8 + 4 + 6 + 4 + 4 and errors[0] == ("none", 0.0)


def test_every_experiment_has_a_small_run():
    assert {*TINY, "smoke"} == set(EXPERIMENTS)


@pytest.mark.usefixtures("quick_layout", "one_variant")
@pytest.mark.parametrize("name", TINY)
def test_every_experiment_runs(name, folder, results, capsys, monkeypatch):
    fast = [] if name == "runtime_vs_error" else FAST
    arguments = [*fast, *TINY[name], "store=s.zarr", f"cache={results}"]
    if name not in PAGES:
        monkeypatch.setattr("sweeps.report.page.write.write_store_page", lambda *_: [])
    assert ran(f"+experiment={name}", *arguments) == 0, capsys.readouterr().err
    assert_on_a_page(capsys.readouterr().out, page=name in PAGES)
    draw_gallery(name, monkeypatch)
    groups = groups_of(folder / "s.zarr")
    assert "status" in groups
    for group, data in groups.items():
        for variable, values in data.items():
            if group == "status":
                assert np.isin(values, [1, NOT_ASKED.get((name, variable), 1)]).all(), variable
            if variable in SCORES and "n" in data:
                values = values.where(data.n > 0, 0.0)  # no view is between templates of each one
            if variable in SCORES | RESULTS:
                assert np.isfinite(values).all(), (group, variable)


def draw_gallery(experiment, monkeypatch):
    """Run the gallery's scripts for an experiment on its store."""
    for script, *arguments in GALLERY.get(experiment, ()):
        draw(script, "s.zarr", *arguments, monkeypatch=monkeypatch)


def draw(script, *arguments, monkeypatch):
    """Run a script of the gallery, and assert that it draws something."""
    mpl.use("Agg")
    path = DOCS / "gallery" / f"{script}.py"
    monkeypatch.setattr("sys.argv", [str(path), *arguments, "picture.png"])
    runpy.run_path(str(path), run_name="__main__")
    picture = imread("picture.png")
    assert min(picture.shape[:2]) > 200 and picture.std() > 0.05, script
    plt.close("all")


@pytest.mark.usefixtures("quick_layout")
def test_the_published_table_of_the_benchmark_is_drawn(folder, monkeypatch):
    draw("benchmark", str(DOCS / "tables" / "benchmark_splits.csv"), monkeypatch=monkeypatch)


def test_gallery_scripts_are_short_and_tested():
    folder = DOCS / "gallery"
    run = {script for scripts in GALLERY.values() for script, *_ in scripts}
    assert {path.stem for path in folder.glob("*.py")} == {*run, "benchmark", "ships"}
    assert all(len(path.read_text().splitlines()) <= 40 for path in folder.glob("*.py"))


def assert_on_a_page(text, *, page):
    """Assert that text fits 40 lines of 80 columns, and names store, page and next command."""
    lines = text.splitlines()
    assert len(lines) <= 40 and max(map(cell_len, lines)) <= 80
    assert "store   s.zarr" in lines and ("page    s-report.html" in lines) == page
    assert any(line.startswith("next    ncti-report s.zarr --table ") for line in lines)


# Ships that are not flown past have no answers.
NOT_ASKED = {("measured", "measured"): -1}
SCORES = {"accuracy", "ci_low", "ci_high", "spread"}
RESULTS = {"expected", "averaged", "log_polar", "detection_probability", "attenuation", "facets"}

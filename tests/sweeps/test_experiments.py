"""Every configuration file composes, and every experiment runs, however little of it."""

import io
import runpy

import matplotlib as mpl
import numpy as np
import pytest
from commands import FAST, chosen, groups_of, ran
from matplotlib import pyplot as plt
from matplotlib.image import imread
from rich.cells import cell_len
from rich.console import Console

from ncti.render import available_engines
from ncti.render.choice import engines
from sweeps.engine.kinds import Word
from sweeps.experiment import EXPERIMENT, conf_folder
from sweeps.report.summary import report
from sweeps.stages.classifier import Classifier
from sweeps.stages.irar import Irar
from sweeps.stages.ladar import Ladar
from sweeps.stages.views import Grid

GROUPS = sorted(
    (path.parent.name, path.stem)
    for path in conf_folder().glob("*/*.yaml")
    if path.parent.name != "experiment"
)
EXPERIMENTS = sorted(path.stem for path in conf_folder().glob("experiment/*.yaml"))

# What makes them small; `smoke` is run whole by the tests of its store.
TWO = "grid.ship=[duncan,texas]"
PROFILES = "grid.aspect=[0,90] grid.pulse_width=[30,50] grid.frame_count=[2,4]"
MNN = "classifier.mnn.epochs=20"
SEEN = "infrared.frame_count=4 infrared.subpixel_offsets=2 infrared.orders=1"
FAR = "infrared.range=[50,100]"
NEAR = "grid.range=50 infrared.range=50 grid.random_aspects=1 grid.replicate=2"
FLOWN = (
    "irar.ifov=1000 irar.samples=40 irar.line_rate=30 irar.pulse_rate=2000 irar.detectors=2 "
    "irar.range=3 grid.replicate=1"
)
TINY = {
    "corrections": f"{FLOWN} grid.ship=roberts",
    "draws": f"{PROFILES} {SEEN} {MNN} {TWO} {FAR} ladar.subpixel_offsets=2 classifier.orders=2 "
    "grid.vigilance=0.95",
    "fusion": f"{PROFILES} {SEEN} {TWO} grid.range=50 grid.replicate=2",
    "measured": f"{PROFILES} {MNN} grid.aspect=175 grid.ship=[duncan,roberts] irar.flown=roberts "
    f"{FLOWN}",
    "paper": f"{PROFILES} {SEEN} {MNN} {TWO} {FAR}",
    "runtime_vs_error": f"{TWO} grid.aspect=90 render.engine=embree render.pixel=1 render.roll=30 "
    "run_time.repeats=1 run_time.bin_width=1",
    "scan": f"{TWO} grid.aspect=[0,45,90] grid.frame_count=[2,4] grid.range=50 grid.replicate=1 "
    "scan.known_views=4",
    "sensitivity": f"{FLOWN} irar.errors.ship_speed=null irar.errors.ship_heading=null "
    "irar.errors.aircraft_speed=5 irar.errors.aircraft_heading=null irar.errors.pointing=0.2",
    "table2": f"{PROFILES} {MNN} {TWO} grid.replicate=2",
    "table4": f"{PROFILES} {MNN} {TWO} grid.replicate=2",
    "table5": f"{SEEN} grid.aspect=[0,90] {TWO} {FAR}",
    "fresh": f"{PROFILES} grid.aspect=[0,45,90] {SEEN} {MNN} {TWO} {NEAR}",
    "spacing": f"{PROFILES} {SEEN} {TWO} {NEAR} grid.aspect=[0,6,12] "
    "classifier.template_spacing=[6,12]",
    "unknown": f"{PROFILES} grid.aspect=[0,1.5,3] classifier.training_aspect=[0,3]",
    "validation": f"{FLOWN} grid.ship=[duncan,roberts] irar.mast_gain=3 irar.pictures=false",
}


@pytest.mark.parametrize(("group", "name"), GROUPS)
def test_every_group_choice_composes(group, name):
    sensor = "sensor=both" if name == "fusion" else "sensor=range"
    assert chosen(f"{group}={name}", sensor, "grid.ship=duncan").one(Grid.pulse_width) == 30


def test_every_classifier_is_a_choice():
    assert isinstance(Classifier.name.kind, Word)
    (name,) = (one for one in EXPERIMENT.declared if one.key == Classifier.name.key)
    choices = {file for group, file in GROUPS if group == "classifier"}
    assert choices == {*name.kind.words, "all"}
    receivers = {file for group, file in GROUPS if group == "ladar"}
    assert receivers == set(Ladar.receiver.kind.words)


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_composes_whole(name):
    choices = chosen(f"+experiment={name}")
    assert choices[Grid.ship]
    missing = len(engines()) - len(available_engines())
    skipped = [line for line in EXPERIMENT.about(choices) if "without" in line]
    assert len(skipped) == (missing if name == "runtime_vs_error" else 0)


def test_what_the_command_line_sweeps_comes_before_the_axes_of_an_experiment():
    swept = EXPERIMENT.attributes(chosen("+experiment=smoke", "ladar.cnr=[23,26]"))["swept"]
    assert swept[0] == "cnr" and "pulse_width" in swept


def test_sensitivity_is_one_parameter_at_a_time():
    errors = chosen("+experiment=sensitivity")[Irar.errors]
    assert len(errors) == 1 + 8 + 4 + 6 + 4 + 4 and errors[0] == ("none", 0.0)


def test_every_experiment_is_run():
    assert {*TINY, "smoke"} == set(EXPERIMENTS)


@pytest.mark.parametrize("name", TINY)
def test_every_experiment_runs(name, folder, results, capsys, monkeypatch):
    fast = [] if name == "runtime_vs_error" else FAST
    arguments = [*fast, *TINY[name].split(), "store=s.zarr", f"cache={results}"]
    assert ran(f"+experiment={name}", *arguments) == 0, capsys.readouterr().err
    assert_on_a_page(capsys.readouterr().out)
    assert_tables_fit(folder / "s.zarr")
    draw_gallery(name, monkeypatch)
    groups = groups_of(folder / "s.zarr")
    flown = ["roberts"] if name == "measured" else None
    assert any(group.startswith("status") for group in groups)
    for group, data in groups.items():
        for variable, values in data.items():
            if group.startswith("status"):
                assert np.isin(values, [1, NOT_ASKED.get((name, group), 1)]).all(), variable
            if variable in SCORES and "n" in data:
                values = values.where(data.n > 0, 0.0)  # no view is between templates of each one
            assert np.isfinite(asked(values, group, flown)).all(), (group, variable)


GALLERY = {  # scripts of docs/gallery by experiment, with their arguments after the store
    "paper": (("range_profiles",), ("categories", "acn"), ("classifiers",), ("silhouettes",)),
    "draws": (("scores",),),
    "table5": (("infrared_scores",), ("categories", "acn_infrared")),
    "fresh": (("fusion",),),
    "spacing": (("spacing",),),
    "validation": (("near_stern",), ("flight",)),
    "measured": (("measured",),),
    "sensitivity": (("sensitivity",),),
    "scan": (("field_scan",),),
    "runtime_vs_error": (("run_time",),),
}


def draw_gallery(experiment, monkeypatch):
    """Run the gallery's scripts for an experiment on its store."""
    mpl.use("Agg")
    for script, *more in GALLERY.get(experiment, ()):
        path = conf_folder().parent / "docs" / "gallery" / f"{script}.py"
        monkeypatch.setattr("sys.argv", [str(path), "s.zarr", *more, "picture.png"])
        runpy.run_path(str(path), run_name="__main__")
        picture = imread("picture.png")
        assert min(picture.shape[:2]) > 200 and picture.std() > 0.05, script
        plt.close("all")


def test_every_script_of_the_gallery_is_short_and_run():
    folder = conf_folder().parent / "docs" / "gallery"
    run = {script for scripts in GALLERY.values() for script, *_ in scripts}
    assert {path.stem for path in folder.glob("*.py")} == {*run, "ships"}
    assert all(len(path.read_text().splitlines()) <= 40 for path in folder.glob("*.py"))


def assert_on_a_page(text):
    """The end of a sweep is at most a page of 80 columns, and says where everything is."""
    lines = text.splitlines()
    assert len(lines) <= 60 and max(map(cell_len, lines)) <= 80
    assert (
        "swept   " in text and "store   s.zarr" in lines and "next    ncti-report s.zarr" in lines
    )


def assert_tables_fit(store):
    """The tables are printed in 80 columns."""
    console = Console(file=io.StringIO(), width=80)
    report(store, console)
    assert max(map(cell_len, console.file.getvalue().splitlines())) <= 80


# Ships that are not flown past have no answers.
NOT_ASKED = {("measured", "status_measured"): -1}
SCORES = {"accuracy", "ci_low", "ci_high", "spread"}
OF_FLIGHTS = {"validation", "tables/flights"}
PIXELS = {"picture", "image", "infrared_image", "intensity", "range_image"}


def asked(values, group, flown):
    """The numbers of a variable that must all be there."""
    if values.dtype.kind in "OTU" or values.name in PIXELS:
        return np.zeros(0)
    if values.name == "inverse_temperature":  # sensors have one, both together have none
        return values.sel(channel=["range", "infrared"])
    if str(values.name).endswith("_needed"):  # none, for an error that no pixel of these meets
        return np.zeros(0)
    if values.name == "rejected_up_to":  # none, to reject none
        return values.isel(least_rejected=slice(1, None))
    flights = flown and group in OF_FLIGHTS and "ship" in values.dims
    return values.sel(ship=flown) if flights else values

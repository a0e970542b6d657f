"""What no setting has wrong alone: settings, ships and stores that do not go together."""

import pytest
import trimesh
from commands import chosen, prepared
from hydra.errors import HydraException
from omegaconf.errors import OmegaConfBaseException

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.front import explain
from sweeps.experiment import EXPERIMENT
from sweeps.stages.classifier import Classifier
from sweeps.stages.infrared import Infrared
from sweeps.stages.views import Grid

FLOWN = "sensor=irar grid.ship=duncan grid.aspect=175"
BOTH = "sensor=both classifier=fusion grid.ship=duncan"


def sentence(*overrides):
    """What is said of a wrong command line."""
    wrong = (ConfigurationError, HydraException, OmegaConfBaseException)
    with pytest.raises(wrong) as caught:
        prepared(*overrides)
    told = explain(EXPERIMENT, caught.value)
    assert "\n" not in told and "full_key" not in told
    return told


WRONG = {
    # keys and groups
    "grid.shp=duncan": "grid.shp is not a key of the configuration; grid has ship, aspect",
    "+colour=red": "colour is not a key of the configuration; it has sensor, grid",
    "irar.errors.luck=1": "irar.errors.luck is not a key of the configuration; irar.errors has "
    "aircraft_speed, ",
    "irar.errors=null": "irar.errors is null, but must hold aircraft_speed, ship_speed",
    "irar.errors=5": "irar.errors is 5, but must hold aircraft_speed, ship_speed",
    "grid.aspect=${grid.rage}": "grid.aspect is ${grid.rage}, but must refer to keys that have a "
    "value (grid.rage is not a key of the configuration; grid has ship, aspect",
    "grid.ship=null": "grid.ship is null, but must be a ship, or a list of ships",
    "classifier.mnn=5": "classifier.mnn is 5, but must hold epochs, grow_every",
    "grid=[1]": "grid is a list, but must hold ship, aspect",
    "+experiment=nope": "experiment is 'nope', but must be one of",
    "ladar=nope": "ladar is 'nope', but must be one of first_pulse, full_profile, peak_pulse",
    "ladar=[full_profile,peak_pulse]": "but must be one choice",
    "classifier=[acn,mnn]": "but must be one choice; classifier.name takes a list",
    "sensor=radar": "sensor is 'radar', but must be one of range, infrared, irar, run_time, scan, "
    "both",
    # ships
    "grid.ship=bismarck": "grid.ship has 'bismarck': ",
    "grid.ship=[duncan,x/duncan.stl]": "'duncan' is the name of another ship of the grid",
    "grid.ship=leak.stl": "leak.stl': ",
    # the scene and the laser radar
    "scene=altitude grid.range=5": "grid.range has 5: slant_range is 5000 m, but",
    "scene=altitude grid.range=400": "horizon",
    "grid.range=1": "ladar.ifov of 150 urad is 0.15 m wide, but must be at least render.pixel",
    "ladar.bin_width=2 grid.pulse_width=10": "grid.pulse_width has 10, but must be at least 18.9 "
    "for ladar.bin_width 2 m",
    "ladar.window=150": "ladar.window is 150 m, but must be at least",
    "ladar.window=20 ladar.bin_width=5": "must hold at least 10 bins of ladar.bin_width 5 m",
    "ladar=peak_pulse ladar.target_free_ifovs=20000": "ladar.target_free_ifovs has 20000, but must "
    "be at most 10000 with the peak_pulse receiver",
    # the imager
    "sensor=infrared infrared.range=3": "infrared.range has 3, where half infrared.ifov",
    "sensor=infrared infrared.training_range=3": "infrared.training_range has 3, where half",
    "sensor=infrared infrared.window_length=50": "infrared.window_length is 50 m, but must be at "
    "least 137 m to hold duncan",
    # classifiers
    "classifier.training=noisy classifier=correlation": "grid.replicate is 1, but must be at least "
    "2 where classifier.training has noisy",
    "classifier=fusion": "sensor is 'range', but must be both for the classifier fusion",
    f"{BOTH} infrared.range=[25,50]": "grid.range has 100, but every value must be one of 25, 50",
    f"{BOTH} infrared.phases=1": "infrared.phases is 1, but must be at least 2",
    "classifier=likelihood ladar=peak_pulse": "ladar.receiver is 'peak_pulse', but must be "
    "full_profile for the classifier likelihood",
    "classifier.unknown=texas": "classifier.unknown has 'texas', but every value must be one of "
    "duncan, the values of grid.ship",
    "classifier.unknown=duncan": "has every ship of grid.ship, but must leave one",
    "classifier.training_aspect=4": "classifier.training_aspect has 4, but every value must be one "
    "of grid.aspect",
    "classifier=likelihood classifier.left_out=true grid.aspect=0": "classifier.left_out has True",
    # flights
    f"{FLOWN} irar.pulse_rate=19000": "irar.pulse_rate is 19000, but must be at least 19040",
    f"{FLOWN} irar.aircraft_speed=[90,5]": "irar.aircraft_speed is 5",
    f"{FLOWN} irar.errors.ship_speed=-9": "irar.errors.ship_speed has -9, with which ship_speed is",
    f"{FLOWN} irar.pointing=20": "irar.pointing has 20, but must be nearer 5, irar.offset",
    f"{FLOWN} irar.chain=[exact,printed] irar.mirror=[exact,none]": "irar.mirror is exact, none, "
    "but must be exact where irar.chain has printed",
    f"{FLOWN} irar.flown=roberts": "irar.flown has 'roberts', but every value must be one of",
    f"{FLOWN} irar.samples=20": "irar.samples is 20, but must be at least",
    f"{FLOWN} classifier.name=likelihood": "classifier.name is likelihood, but must have one of "
    "acn, mnn, correlation where sensor is irar",
}


@pytest.mark.parametrize("overrides", WRONG)
def test_a_wrong_combination_is_refused_in_one_sentence(overrides, folder):
    box = trimesh.creation.box((40, 8, 6))
    trimesh.Trimesh(box.vertices, box.faces[1:]).export(folder / "leak.stl")
    given = overrides.split(" ")
    ship = [] if "grid.ship" in overrides else ["grid.ship=duncan"]
    assert len(WRONG) <= 45
    assert WRONG[overrides] in sentence(*ship, *given)
    assert [path.name for path in folder.iterdir()] == ["leak.stl"]


def test_what_no_sensor_reads_stands_in_nobodys_way():
    """Values that could not be flown, or seen, are only wrong where something looks at them."""
    assert chosen("grid.ship=duncan", "irar.samples=2", "infrared.window_length=1")


def test_the_imager_has_the_grids_axes_unless_it_has_its_own():
    choices = chosen("sensor=infrared", "grid.ship=duncan", "grid.range=[50,25]")
    assert choices[Infrared.range] == (25, 50) == choices[Grid.range]
    assert choices[Infrared.vigilance] == choices[Grid.vigilance]
    told = sentence("sensor=infrared", "grid.ship=duncan", "grid.range=1")
    assert told.startswith("grid.range has 1, where half infrared.ifov")


def test_flights_are_named_by_those_that_can():
    """Where flights are alone, others are left out of a list of classifiers."""
    names = "classifier.name=[likelihood,mnn]"
    assert chosen(*FLOWN.split(" "), names)[Classifier.name] == ("mnn",)


def test_classifiers_that_name_nothing_here_are_told():
    told = EXPERIMENT.remarks(chosen("grid.ship=duncan", "classifier.name=[acn,fusion]"))
    reason = "identifies nothing with these sensors and ranges"
    assert told == [f"classifier.name has fusion, which {reason}"]
    seen = chosen("grid.ship=duncan", "classifier.name=[acn,mnn]", "sensor=infrared")
    assert [line.split(",")[0] for line in EXPERIMENT.remarks(seen)] == ["classifier.name has mnn"]


def test_a_box_that_floats_is_a_ship(folder):
    box = trimesh.creation.box((60, 10, 8))
    box.apply_translation((0, 0, 4))
    box.export(folder / "barge.stl")
    assert chosen("grid.ship=[barge.stl,duncan]")[Grid.ship] == ("barge", "duncan")

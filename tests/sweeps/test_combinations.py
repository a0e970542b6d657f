"""What no setting has wrong alone: settings, ships and stores that do not go together."""

import pytest
import trimesh
from commands import chosen, prepared

from sweeps.engine.errors import ConfigurationError
from sweeps.stages.infrared import Infrared
from sweeps.stages.views import Grid

FLOWN = "sensor=irar grid.ship=duncan grid.aspect=175"
SCAN = "sensor=scan grid.range=50 render.engine=lines"
BOTH = "sensor=both classifier=fusion grid.ship=duncan"


def sentence(*overrides):
    """What is said of a wrong command line."""
    with pytest.raises(ConfigurationError) as caught:
        prepared(*overrides)
    told = str(caught.value)
    assert "\n" not in told and "full_key" not in told
    return told


# Overrides, and the words that their refusal must have: the key at fault, the value, the bound.
WRONG = {
    # keys of settings of their own kind, and files of this experiment
    "irar.errors.luck=1": "irar.errors.luck irar.errors aircraft_speed, ship_heading",
    "+experiment=nope": "experiment 'nope', one of",
    # ships
    "grid.ship=bismarck": "grid.ship 'bismarck'",
    "grid.ship=[duncan,x/duncan.stl]": "grid.ship 'x/duncan.stl', 'duncan'",
    "grid.ship=[duncan,duncan]": "grid.ship 'duncan' once",
    "grid.ship=nowhere.stl": "grid.ship nowhere.stl",
    "grid.ship=leak.stl": "grid.ship leak.stl",
    # the scene and the laser radar
    "scene=altitude grid.range=5": "grid.range 5: slant_range 5000",
    "scene=altitude grid.range=400": "grid.range 400 horizon",
    "grid.range=1": "grid.range 1, ladar.ifov render.pixel",
    "ladar.ifov=[1,150]": "grid.range 100, ladar.ifov 1 render.pixel, 0.25",
    "ladar.bin_width=2 grid.pulse_width=10": "grid.pulse_width 10, 18.9 ladar.bin_width",
    "ladar.window=150": "ladar.window 150",
    "ladar.window=20 ladar.bin_width=5": "ladar.window 20 10 ladar.bin_width 5",
    "ladar=peak_pulse ladar.target_free_ifovs=20000": "ladar.target_free_ifovs 20000, 10000",
    # the imager
    "sensor=infrared infrared.range=3": "infrared.range 3, infrared.ifov",
    "sensor=infrared infrared.training_range=3": "infrared.training_range 3, half",
    "sensor=infrared infrared.window_length=50": "infrared.window_length 50 137 duncan",
    "sensor=infrared infrared.window_height=5": "infrared.window_height 5 duncan",
    "sensor=infrared infrared.coverage_rule=[0.5,1]": "infrared.coverage_rule 1, 0.01 0.95",
    "sensor=infrared infrared.window_length=[100,200]": "infrared.window_length 2 one",
    "sensor=infrared infrared.ifov=[150,4]": "grid.range 100, infrared.ifov 2",
    "sensor=infrared scene=altitude infrared.range=400": "infrared.range 400:",
    # classifiers
    "classifier=correlation classifier.training=noisy": "grid.replicate 1, 2 classifier.training",
    "classifier=correlation classifier.left_out=true grid.aspect=3": "classifier.left_out True,",
    "classifier=fusion": "sensor 'range', both fusion",
    f"{BOTH} infrared.range=[25,50]": "grid.range 100, 25, 50",
    f"{BOTH} infrared.subpixel_offsets=1": "infrared.subpixel_offsets 1, 2",
    f"{BOTH} ladar.receiver=first_pulse": "ladar.receiver 'first_pulse', full_profile",
    "classifier=likelihood ladar=peak_pulse": "ladar.receiver 'peak_pulse', full_profile",
    "classifier.unknown=texas": "classifier.unknown 'texas', duncan, grid.ship",
    "classifier.unknown=duncan": "classifier.unknown every one",
    "classifier.unknown=[duncan,duncan]": "classifier.unknown 'duncan' once",
    "classifier.training_aspect=4": "classifier.training_aspect 4, grid.aspect",
    "classifier=likelihood classifier.left_out=true grid.aspect=0": "classifier.left_out True",
    # flights
    f"{FLOWN} irar.pulse_rate=19000": "irar.pulse_rate 19000, 19040",
    f"{FLOWN} irar.line_rate=[119,126]": "irar.pulse_rate 20000, 20160",
    f"{FLOWN} irar.aircraft_speed=[90,5]": "irar.aircraft_speed 5",
    f"{FLOWN} irar.offset=[5,120]": "irar.aircraft_speed 90",
    f"{FLOWN} irar.errors.ship_speed=-9": "irar.errors.ship_speed -9, ship_speed -1",
    f"{FLOWN} irar.band_start=12": "irar.band_start 12, irar.band_stop",
    f"{FLOWN} irar.pointing=20": "irar.pointing 20, 5, irar.offset",
    f"{FLOWN} irar.chain=[exact,printed] irar.mirror=[exact,none]": "irar.mirror 'none', exact",
    f"{FLOWN} irar.chain=printed irar.range_filter=mean": "irar.range_filter 'mean', cluster",
    f"{FLOWN} irar.profile_range=[1,100]": "irar.profile_range 1, ladar.ifov render.pixel,",
    f"{FLOWN} irar.flown=roberts": "irar.flown 'roberts', grid.ship",
    f"{FLOWN} irar.flown=[]": "irar.flown empty",
    f"{FLOWN} irar.samples=20": "irar.samples 20,",
    f"{FLOWN} classifier.name=likelihood": "classifier.name likelihood, acn, mnn, correlation",
    f"{FLOWN} classifier.training=noisy grid.replicate=2": "classifier.training 'noisy', expected",
    # run times, and the scan of a field
    "sensor=run_time render.engine=lines render.tolerance=0.01": "render.tolerance 0.01, null",
    "sensor=run_time render.engine=lines run_time.bin_width=50": "run_time.bin_width 50, 250",
    f"{SCAN} scan.pulse_rate=2000 grid.range=100": "scan.pulse_rate 2000, 1428",
    f"{SCAN} grid.ship=[duncan,texas] grid.range=20": "grid.range 20, 22.9 3",
    f"{SCAN} ladar.ifov=100": "infrared.ifov 150, ladar.ifov",
    f"{SCAN} ladar.reflectance=lambertian": "ladar.reflectance 'lambertian', projected_area",
    f"{SCAN} ladar.receiver=peak_pulse": "ladar.receiver 'peak_pulse', full_profile",
    f"{SCAN} render.tolerance=0.01": "render.tolerance 0.01, null",
    f"{SCAN} scan.height=0.1": "scan.depth 0.05, 50",
    f"{SCAN} infrared.window_length=100": "infrared.window_length 100",
}


@pytest.mark.parametrize("overrides", WRONG)
def test_a_wrong_combination_is_refused_in_one_sentence(overrides, folder):
    box = trimesh.creation.box((40, 8, 6))
    trimesh.Trimesh(box.vertices, box.faces[1:]).export(folder / "leak.stl")
    ship = [] if "grid.ship" in overrides else ["grid.ship=duncan"]
    said = sentence(*ship, *overrides.split(" "))
    missing = [word for word in WRONG[overrides].split(" ") if word not in said]
    assert not missing, said
    assert [path.name for path in folder.iterdir()] == ["leak.stl"]


def test_the_imager_has_the_grids_axes_unless_it_has_its_own():
    choices = chosen("sensor=infrared", "grid.ship=duncan", "grid.range=[50,25]")
    assert choices[Infrared.range] == (25, 50) == choices[Grid.range]
    assert choices[Infrared.vigilance] == choices[Grid.vigilance]
    told = sentence("sensor=infrared", "grid.ship=duncan", "grid.range=1")
    assert told.startswith("grid.range has 1, where half infrared.ifov")


def test_a_box_that_floats_is_a_ship(folder):
    box = trimesh.creation.box((60, 10, 8))
    box.apply_translation((0, 0, 4))
    box.export(folder / "barge.stl")
    assert chosen("grid.ship=[barge.stl,duncan]")[Grid.ship] == ("barge", "duncan")

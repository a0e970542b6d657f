"""Settings and ships that are valid alone but do not go together are refused in a sentence."""

from importlib.util import find_spec
from pathlib import Path

import pytest
import trimesh
import yaml
from commands import chosen, prepared

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.stages.infrared import Infrared
from sweeps.stages.views import Grid


def sentence(*overrides):
    """Return the error message of a wrong command line."""
    with pytest.raises(ConfigurationError) as caught:
        prepared(*overrides)
    message = str(caught.value)
    assert "\n" not in message and "full_key" not in message
    return message


ROWS = yaml.safe_load(Path(__file__).with_name("refused.yaml").read_text())
WRONG = {
    f"{common} {added}".strip(): words
    for common, rows in ROWS.items()
    for added, words in rows.items()
}


@pytest.mark.parametrize("overrides", WRONG)
def test_a_wrong_combination_is_refused_in_one_sentence(overrides, folder):
    box = trimesh.creation.box((40, 8, 6))
    trimesh.Trimesh(box.vertices, box.faces[1:]).export(folder / "leak.stl")
    ship = [] if "grid.ship" in overrides else ["grid.ship=duncan"]
    message = sentence(*ship, *overrides.split(" "))
    missing = [word for word in WRONG[overrides].split(" ") if word not in message]
    assert not missing, message
    assert [path.name for path in folder.iterdir()] == ["leak.stl"]


@pytest.mark.skipif(find_spec("torch") is not None, reason="the extra torch is installed")
def test_classifier_of_a_missing_extra_is_refused():
    message = sentence("sensor=benchmark", "benchmark.classifier=[mlp,cnn]")
    assert message.startswith("benchmark.classifier has cnn") and "ncti-sweep[torch]" in message


def test_imager_axes_default_to_those_of_the_grid():
    choices = chosen("sensor=infrared", "grid.ship=duncan", "grid.range=[50,25]")
    assert choices[Infrared.range] == (25, 50) == choices[Grid.range]
    assert choices[Infrared.vigilance] == choices[Grid.vigilance]
    message = sentence("sensor=infrared", "grid.ship=duncan", "grid.range=1")
    assert message.startswith("grid.range has 1, where half infrared.ifov")


def test_range_window_is_not_checked_without_a_radar():
    assert chosen("sensor=infrared", "grid.ship=duncan", "ladar.window=60")


def test_box_mesh_is_accepted_as_a_ship(folder):
    box = trimesh.creation.box((60, 10, 8))
    box.apply_translation((0, 0, 4))
    box.export(folder / "barge.stl")
    assert chosen("grid.ship=[barge.stl,duncan]")[Grid.ship] == ("barge", "duncan")

"""Every key of the infrared channel: what it may hold, and the sentence where it may not."""

from dataclasses import fields
from itertools import product

import numpy as np
import pytest
from hydra.errors import HydraException
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from sweeping import command, contents
from test_configuration import composed, refused

from ncti import infrared as library
from ncti.features import SEGMENTATION_METHODS, segment
from ncti.features.log_polar import INTERPOLATIONS
from sweeps.app import check_jobs, explain, replace_axes
from sweeps.errors import ConfigurationError
from sweeps.prepare import prepare
from sweeps.schema import axis_keys, keys_of, unknown_key
from sweeps.sensor_schema import LEAST_NEDT, MOST_COVERAGE, MOST_FRAMES, InfraredConfig

# Least and most of a key.
NUMBERS = {
    "ifov": (1, 100_000),
    "contrast_at_zero": (0, 1000),
    "extinction": (0, 10),
    "nedt": (0.001, 1000),
    "target_spread": (0, 1000),
    "sea_spread": (0, 1000),
    "false_alarm": (1e-12, 0.5),
    "window_length": (1, 5000),
    "window_height": (1, 500),
    "training_range": (1, 1000),
}
COUNTS = {"phases": (1, 1000), "orders": (1, 1000)}
AXES = {
    "range": (1, 1000),
    "frame_count": (1, 10_000),
    "coverage_rule": (0.01, 0.95),
    "inner_radius": (0.01, 2),
    "vigilance": (0, 1),
}
WORDS = {
    "super_resolution": ("none", "perfect", "shifted"),
    "segmentation": ("matched", "otsu", "li", "isodata"),
    "interpolation": ("bilinear", "nearest"),
}
MAY_BE_NULL = {"range", "frame_count", "vigilance"}


def wrong_numbers(low, high):
    """Values that no number of these bounds may have, and what is said of each."""
    bounds = f"from {low:g} to {high:g}"
    yield "nan", ("nan", bounds)
    yield "inf", ("inf", bounds)
    yield f"{-abs(high):g}", (f"{-abs(high):g}", bounds)
    yield f"{high * 1.01:g}", (f"{high * 1.01:g}", bounds)
    if low > 0:
        yield "0", ("0", bounds)
        yield f"{low * 0.99:g}", (f"{low * 0.99:g}", bounds)
    for word in ("warm", "[]"):
        yield word, (word, "type float")
    yield "null", ("null", "must be given")


def wrong_counts(low, high):
    for value in (low - 1, -1, high + 1):
        yield f"{value}", (f"{value}", f"from {low} to {high}")
    for word in ("2.5", "nan", "warm", "[]", "[1, 2]"):
        yield word, (word, "type integer")
    yield "null", ("null", "must be given")


def wrong_axes(low, high):
    above, below = high * 1.01, low - 0.001
    bounds = f"at least {low:g} and at most {high:g}"
    for value in ("nan", "inf", f"{above:g}", f"{below:g}"):
        yield value, (value, bounds)
    yield "warm", ("'warm'", bounds)
    yield "true", ("True", bounds)
    yield f"[{high}, {above:g}]", (f"{above:g}", bounds)
    yield f"[{high}, null]", ("None", bounds)
    yield f"[{high}, [{high}]]", (f"[{high}]", bounds)
    yield "[]", ("empty", "at least one")
    yield f"[{high}, {high}]", (f"{float(high)}", "must differ")
    yield "{}", ("(none)", "start, stop and step")
    yield f"{{start: {low}, stop: {high}}}", ("start, stop", "start, stop and step")


def wrong_words(*allowed):
    listed = ", ".join(allowed)
    for value in ("best", "''", allowed[0].upper()):
        yield value, (value.strip("'"), listed)
    for value, shown in (("1", "1"), ("true", "True"), ("{a: 1}", "{'a': 1}"), ("null", "None")):
        yield value, (shown, listed)
    yield f"[{allowed[0]}, best]", ("'best'", listed)
    yield f"[{allowed[0]}, {allowed[0]}]", (f"'{allowed[0]}'", "must differ")
    yield "[]", ("empty", "at least one")


WRONG = [
    (f"infrared.{key}={value}", (f"infrared.{key}", *said))
    for table, wrong in (
        (NUMBERS, wrong_numbers),
        (COUNTS, wrong_counts),
        (AXES, wrong_axes),
        (WORDS, wrong_words),
    )
    for key, allowed in table.items()
    for value, said in wrong(*allowed)
]
WRONG += [
    ("infrared.nedt=true", ("infrared.nedt", "True", "type float")),
    ("infrared.nedt={}", ("infrared.nedt", "{}", "type float")),
    ("infrared.nedt=[0.4, 0.5]", ("infrared.nedt", "[0.4, 0.5]", "type float")),
    ("infrared.nedt=''", ("infrared.nedt", "''", "type float")),
    ("infrared.range={start: 9, stop: 1, step: 1}", ("infrared.range", "9 to 1", "below start")),
    ("infrared.range={start: 9, stop: 10, step: 0}", ("infrared.range.step", "0", "above 0")),
    ("infrared.range={start: 1, stop: 9, step: 1e-9}", ("infrared.range.step", "1e-09", "100000")),
    ("infrared.range={start: 1, stop: far, step: 1}", ("infrared.range.stop", "far", "a number")),
    ("infrared.frame_count=2.5", ("infrared.frame_count", "2.5", "whole number")),
    ("infrared.colour=red", ("infrared.colour", "no key", "nedt")),
    ("infrared.nedt=[0.4", ("infrared.nedt", "cannot be read", "KEY=VALUE")),
    ("infrared.range=${grid.rage}", ("infrared.range", "grid.rage")),
    *(
        (f"sensor={value}", ("sensor", shown, "must be"))
        for value, shown in (
            ("radar", "radar"),
            ("Infrared", "Infrared"),
            ("''", "''"),
            ("1", "1"),
            ("null", "null"),
            ("[range,infrared]", "['range', 'infrared']"),
            ("{range: 1}", "{'range': 1}"),
        )
    ),
]


def sentence(*arguments):
    """What is said of a wrong command line."""
    with pytest.raises((ConfigurationError, HydraException, OmegaConfBaseException)) as caught:
        check_jobs(replace_axes(list(arguments)))
    return explain(caught.value)


def checked(*arguments):
    """The configuration of a right one."""
    return prepare(composed(*replace_axes(list(arguments)))).config


def test_every_key_is_tried():
    tried = {*NUMBERS, *COUNTS, *AXES, *WORDS}
    assert tried == {field.name for field in fields(InfraredConfig)}
    assert {f"infrared.{key}" for key in (*AXES, *WORDS)} == {
        key for key in axis_keys() if key.startswith("infrared.")
    }


@pytest.mark.parametrize(("override", "said"), WRONG, ids=lambda value: str(value)[:60])
def test_a_wrong_value_is_refused_in_one_sentence(override, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    first = "grid.ship=duncan" if override.startswith("sensor") else "sensor=both"
    told = sentence(first, override, "store=s.zarr", "cache=cache")
    for word in said:
        assert word in told
    assert "\n" not in told
    assert contents(tmp_path) == {}


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("infrared.nedt=nan", ("infrared.nedt", "nan", "from 0.001 to 1000")),
        ("infrared.segmentation=[otsu,best]", ("infrared.segmentation", "best", "matched")),
        ("infrared.sea_spread=null", ("infrared.sea_spread", "null", "given")),
        ("infrared.range=[25", ("infrared.range=[25", "KEY=VALUE")),
        ("sensor=[infrared]", ("sensor", "infrared", "string")),
    ],
)
def test_the_command_leaves_with_2_and_one_line(override, said, tmp_path, monkeypatch, capsys):
    told = refused([override, "store=s.zarr", "cache=cache"], tmp_path, monkeypatch, capsys)
    for word in said:
        assert word in told


def test_as_its_users_run_it(tmp_path):
    run = command("sensor=infrared", "infrared.nedt=1e-6", "store=s.zarr", folder=tmp_path)
    assert run.returncode == 2
    assert run.stdout == ""
    assert run.stderr.startswith("ncti-sweep: infrared.nedt is 1e-06, but must be from 0.001 ")
    assert run.stderr.count("\n") == 1
    assert contents(tmp_path) == {}


@pytest.mark.parametrize("key", [*NUMBERS, *COUNTS])
def test_both_ends_of_a_number_are_allowed(key):
    for value in (NUMBERS | COUNTS)[key]:
        assert getattr(InfraredConfig(**{key: value}), key) == value


@pytest.mark.parametrize("key", AXES)
def test_both_ends_of_an_axis_are_allowed(key):
    config = OmegaConf.to_object(composed(f"infrared.{key}=[{','.join(map(str, AXES[key]))}]"))
    assert getattr(config.infrared.expand(config.grid.expand()), key) == AXES[key]


@pytest.mark.parametrize("key", WORDS)
def test_every_word_is_allowed(key):
    config = OmegaConf.to_object(composed(f"infrared.{key}=[{','.join(WORDS[key])}]"))
    assert getattr(config.infrared.expand(config.grid.expand()), key) == WORDS[key]


# An axis as the command line has it, and its values.
REPLACED = {
    "infrared.range": ("{start: 25, stop: 100, step: 25}", (25, 50, 75, 100)),
    "infrared.frame_count": ("{start: 4, stop: 16, step: 4}", (4, 8, 12, 16)),
    "infrared.vigilance": ("{start: 0.8, stop: 0.9, step: 0.05}", (0.8, 0.85, 0.9)),
    "infrared.coverage_rule": ("{start: 0.25, stop: 0.75, step: 0.25}", (0.25, 0.5, 0.75)),
    "infrared.inner_radius": ("{start: 0.5, stop: 1, step: 0.5}", (0.5, 1)),
    "infrared.super_resolution": ("[shifted,none]", ("shifted", "none")),
    "infrared.segmentation": ("[otsu,matched]", ("otsu", "matched")),
    "infrared.interpolation": ("[nearest,bilinear]", ("nearest", "bilinear")),
    "ladar.target_free_ifovs": ("{start: 0, stop: 4000, step: 2000}", (0, 2000, 4000)),
    "classifier.learning_rate": ("{start: 0.1, stop: 0.3, step: 0.1}", (0.1, 0.2, 0.3)),
    "classifier.name": ("[mnn,acn]", ("mnn", "acn")),
    "classifier.label_rule": ("[first,majority]", ("first", "majority")),
    "classifier.score_rule": ("[category,ship]", ("category", "ship")),
    "classifier.unknown": ("[duncan,horne]", ["duncan", "horne"]),
    "classifier.training_aspect": (
        "{start: 0, stop: 6, step: 3}",
        {"start": 0, "stop": 6, "step": 3},
    ),
    "classifier.test_vigilance": ("{start: 0, stop: 1, step: 0.5}", (0, 0.5, 1)),
    "classifier.training": ("[expected]", ("expected",)),
    "classifier.left_out": ("[true,false]", (True, False)),
    "classifier.gain_sigma": ("[0,1]", (0, 1)),
    "classifier.mnn.epochs": ("{start: 10, stop: 20, step: 10}", (10, 20)),
    "classifier.mnn.grow_every": ("[5,10]", (5, 10)),
    "classifier.mnn.learning_rate": ("[0.01,0.02]", (0.01, 0.02)),
    "classifier.mnn.tolerance": ("[0.1,0.3]", (0.1, 0.3)),
    "classifier.mnn.inputs": ("[raw]", ("raw",)),
    "classifier.mnn.annealing": ("[true,false]", (True, False)),
    "grid.range": ("{start: 50, stop: 100, step: 25}", (50, 75, 100)),
    "grid.aspect": ("[0,90]", (0, 90)),
    "grid.pulse_width": ("{start: 10, stop: 30, step: 20}", (10, 30)),
    "grid.frame_count": ("{start: 4, stop: 8, step: 4}", (4, 8)),
    "grid.vigilance": ("{start: 0.9, stop: 1, step: 0.1}", (0.9, 1)),
    "grid.ship": ("[duncan]", ("duncan",)),
}


def values_of(config, key):
    """Every value of an axis."""
    group, name = key.rsplit(".", 1)
    grid = config.grid.expand()
    if key in ("classifier.unknown", "classifier.training_aspect"):
        return getattr(config.classifier, name)
    if group.startswith("classifier"):
        of_network = group.endswith("mnn") and name == "learning_rate"
        return getattr(config.classifier.expand(), "mnn_learning_rate" if of_network else name)
    if key == "ladar.target_free_ifovs":
        return config.ladar.floor_axis()
    return getattr(grid if group == "grid" else config.infrared.expand(grid), name)


def test_every_axis_is_replaced():
    # Those of flights are in their own file.
    assert set(REPLACED) == {key for key in axis_keys() if not key.startswith("irar.")}


@pytest.mark.parametrize(
    ("prefix", "key"),
    [*(("", key) for key in REPLACED), ("+", "infrared.range"), ("++", "grid.aspect")],
)
def test_an_axis_replaces_one_of_another_form(key, prefix):
    given, values = REPLACED[key]
    before = [f"++{key}=null", f"++{key}=" + ("[7]" if given[0] == "{" else "{start: 1}")]
    config = composed(*before, *replace_axes([f"{prefix}{key}={given}"]))
    found = values_of(OmegaConf.to_object(config), key)
    assert found == (values if isinstance(values, dict) else pytest.approx(values))


@pytest.mark.parametrize("experiment", ["paper", "table5", "smoke"])
def test_an_axis_replaces_that_of_an_experiment(experiment):
    for key in ("infrared.range", "infrared.frame_count", "grid.pulse_width"):
        given, values = REPLACED[key]
        config = checked(f"+experiment={experiment}", f"{key}={given}", "grid.ship=duncan")
        assert values_of(config, key) == values


def test_axes_of_several_jobs():
    check_jobs(
        replace_axes(
            [
                "-m",
                "+experiment=paper",
                "grid.ship=duncan",
                "infrared.range={start: 25, stop: 100, step: 25},[50],75",
                "store=${hydra:job.num}.zarr",
            ]
        )
    )
    told = sentence("-m", "infrared.range={start: 25, stop: 50, step: 25},[0.5]")
    assert "infrared.range has 0.5" in told


def test_what_is_no_axis_is_left_as_it_is():
    for argument in (
        "infrared.nedt=0.4",
        "infrared=default",
        "-m",
        "store=grid.ship=1",
        "grid=source",
    ):
        assert replace_axes([argument]) == [argument]


def test_the_configuration_holds_the_figures_of_the_library():
    config = OmegaConf.to_object(composed()).infrared
    assert config.contrast_at_zero == library.CONTRAST_AT_ZERO
    assert config.extinction == pytest.approx(library.EXTINCTION * 1e3, rel=1e-15)
    assert config.nedt == library.NEDT
    assert config.ifov == pytest.approx(library.IFOV * 1e6, rel=1e-15)
    assert config.target_spread == config.sea_spread == library.SPREAD
    assert tuple(config.super_resolution) == library.SUPER_RESOLUTIONS
    # The schema's own, which `conf` overrides, are the same.
    schema = InfraredConfig()
    for field in fields(InfraredConfig):
        ours, theirs = getattr(schema, field.name), getattr(config, field.name)
        assert ours == (pytest.approx(theirs) if isinstance(theirs, float) else theirs)


def test_words_are_those_of_the_library():
    assert WORDS == {
        "super_resolution": library.SUPER_RESOLUTIONS,
        "segmentation": SEGMENTATION_METHODS,
        "interpolation": INTERPOLATIONS,
    }


def test_matched_segmentation_takes_the_least_noise_that_is_allowed():
    """Whatever spread, frames and resolution; and the bound is not far too high."""
    image = np.zeros((3, 3))
    image[1, 1] = 1.0
    for way, spread, frames in product(library.SUPER_RESOLUTIONS, (0.0, 1000.0), (1, MOST_FRAMES)):
        sigma = library.pixel_sigma(
            spread, frame_count=frames, nedt=LEAST_NEDT, super_resolution=way
        )
        cut = segment(image, contrast=1.0, target_sigma=sigma, sea_sigma=sigma)
        assert cut.sum() <= 1
    least = library.pixel_sigma(
        0.0, frame_count=MOST_FRAMES, nedt=LEAST_NEDT / 10, super_resolution="shifted"
    )
    with pytest.raises(ValueError, match="sigma"):
        segment(image, contrast=1.0, target_sigma=least, sea_sigma=least)


@pytest.mark.parametrize("phase", [(0.0, 0.0), (0.3, 0.9), (0.77, 0.41)])
@pytest.mark.parametrize("footprint", [1.875, 3.75])
def test_a_pixel_that_the_ship_fills_passes_the_greatest_rule(footprint, phase):
    """Patches of the default pixel on a rolled lattice, over a wall of 60 m by 30 m."""
    render = OmegaConf.to_object(composed()).render
    side, roll = render.pixel, np.radians(render.roll)
    steps = side * (np.arange(-200, 200) + 0.5)
    x, y = np.meshgrid(steps, steps)
    across, up = x * np.cos(roll) - y * np.sin(roll), x * np.sin(roll) + y * np.cos(roll)
    wall = (np.abs(across) < 30) & (np.abs(up) < 15)
    seen = library.coverage_of(
        across[wall], up[wall], area=side**2, footprint=footprint, phase=phase, margin=1
    )
    rows, cols = seen.coverage.shape
    places = [seen.origin[k] + seen.footprint * np.arange(n) for k, n in enumerate((cols, rows))]
    inside = np.ix_(np.abs(places[1]) < 15 - footprint, np.abs(places[0]) < 30 - footprint)
    full = seen.coverage[inside]
    assert full.size > 50
    assert np.all(seen.target(MOST_COVERAGE)[inside])
    # A rule of 1 would not do: chance takes a good part of the pixels away.
    if footprint == 1.875:
        assert np.mean(full < 1) > 0.05


def test_keys_of_the_other_sensor():
    """A wrong value is wrong whoever looks; what only concerns the other sensor's view is not."""
    assert "infrared.vigilance has 7" in sentence("sensor=range", "infrared.vigilance=7")
    assert "infrared.nedt is -1.0" in sentence("sensor=range", "infrared.nedt=-1")
    assert "ladar.receiver is 'ear'" in sentence("sensor=infrared", "ladar.receiver=ear")
    ship = "grid.ship=duncan"
    for sensor, refusing, override, said in (
        ("infrared", "range", "grid.pulse_width=9", "grid.pulse_width has 9"),
        ("infrared", "both", "ladar.window=100", "ladar.window is 100"),
        ("range", "infrared", "infrared.window_length=20", "infrared.window_length is 20"),
        ("range", "both", "infrared.window_height=5", "infrared.window_height is 5"),
        ("range", "infrared", "infrared.range=1", "infrared.range has 1"),
        ("range", "both", "infrared.training_range=1", "infrared.training_range has 1"),
    ):
        assert checked(f"sensor={sensor}", override, ship).sensors == (sensor,)
        assert said in sentence(f"sensor={refusing}", override, ship)


def test_ranges_are_the_grids_unless_the_channel_has_its_own():
    config = checked("sensor=infrared", "grid.range=[50,75]", "grid.ship=duncan")
    assert config.infrared.expand(config.grid.expand()).range == (50, 75)
    told = sentence("sensor=infrared", "grid.range=1", "grid.ship=duncan")
    assert told.startswith("grid.range has 1, where half infrared.ifov")
    config = checked("sensor=infrared", "grid.range=1", "infrared.range=25", "grid.ship=duncan")
    assert config.infrared.expand(config.grid.expand()).range == (25,)


def test_what_is_said_of_unknown_keys():
    assert unknown_key("infrared.colour").endswith(", ".join(keys_of("infrared")))
    assert "the configuration has sensor, grid" in unknown_key("infra")
    assert unknown_key("hydra.colour") == "hydra.colour is no key of the configuration"

"""Every key of the flights: what it may hold, and the sentence where it may not."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hydra.errors import HydraException
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from sweeping import contents
from test_configuration import composed, refused
from test_infrared_configuration import (
    checked,
    sentence,
    wrong_axes,
    wrong_counts,
    wrong_numbers,
    wrong_words,
)

import ncti.ships
from ncti.irar import Flight, plan_scan, ship_heading
from sweeps.app import explain, replace_axes
from sweeps.errors import ConfigurationError
from sweeps.flight_grid import (
    FLOWN,
    IN_SI,
    OF_NO_FLIGHT,
    RECORDED,
    FlightErrors,
    believed,
)
from sweeps.flight_schema import FlightConfig
from sweeps.schema import axis_keys

# Least and most of a key.
NUMBERS = {"profile_range": (1, 1000)}
MAYBE = {"segmentation_threshold": (0, 1e9)}
COUNTS = {"profile_frames": (1, 10_000)}
AXES = {
    "range": (0.1, 1000),
    "depression": (0.1, 60),
    "aircraft_speed": (1, 1000),
    "ship_speed": (0, 50),
    "aircraft_heading": (-360, 360),
    "offset": (-360, 360),
    "mirror_angle": (1, 80),
    "ifov": (1, 10_000),
    "line_rate": (1, 100_000),
    "pulse_rate": (1, 1e9),
    "range_gate": (10, 1e5),
    "cnr": (-100, 90),
    "pulse_width": (2, 1000),
    "range_sigma": (0, 100),
    "threshold": (0, 1e9),
    "nedt": (0, 1000),
    "jitter": (0, 10_000),
    "jitter_time": (1e-6, 1000),
    "transom_gain": (0, 1000),
    "mast_gain": (0, 1000),
}
WHOLE = {"samples": (2, 10_000), "detectors": (1, 1000)}
WITH_NULL = {"aircraft_track": (-360, 360), "pointing": (-360, 360)}
WORDS = {
    "chain": ("exact", "printed", "printed_pulse_rate"),
    "azimuth": ("pixel", "line", "constant", "none"),
    "mirror": ("exact", "printed", "rotation", "none"),
    "range_filter": ("cluster", "median", "mean"),
}
ERRORS = {
    "aircraft_speed": (-50, 50),
    "ship_speed": (-50, 50),
    "aircraft_heading": (-30, 30),
    "ship_heading": (-30, 30),
    "pointing": (-30, 30),
}


def merged(base, key, value):
    """The sentence for a key's value, of a configuration composed once."""

    def check():
        config = base.copy()
        OmegaConf.update(config, key, value, merge=False)
        OmegaConf.to_object(config)

    with pytest.raises((ConfigurationError, HydraException, OmegaConfBaseException)) as caught:
        check()
    return explain(caught.value)


@pytest.fixture(scope="module")
def base():
    return composed("sensor=irar", "grid.ship=duncan", "grid.pulse_width=30")


WRONG = [
    (f"irar.{key}", value, (f"irar.{key}", *said))
    for table, wrong in (
        (NUMBERS, wrong_numbers),
        (COUNTS, wrong_counts),
        (AXES, wrong_axes),
        (WHOLE, wrong_axes),
        (WORDS, wrong_words),
    )
    for key, allowed in table.items()
    for value, said in wrong(*allowed)
]
WRONG += [
    (f"irar.{key}", value, (f"irar.{key}", *said))
    for key, allowed in MAYBE.items()
    for value, said in wrong_numbers(*allowed)
    if value not in ("null", "-360")
]
WRONG += [
    (f"irar.{key}", value, (f"irar.{key}", *said))
    for key, allowed in WITH_NULL.items()
    for value, said in wrong_axes(*allowed)
    if "null" not in value
]
WRONG += [(f"irar.{key}", "2.5", (f"irar.{key}", "a whole number")) for key in WHOLE]
WRONG += [(f"irar.{key}", "[null, null]", (f"irar.{key}", "must differ")) for key in WITH_NULL]
WRONG += [
    (f"irar.errors.{key}", value, (f"irar.errors.{key}", *said))
    for key, allowed in ERRORS.items()
    for value, said in wrong_axes(*allowed)
]
WRONG += [
    ("irar.autofocus", value, ("irar.autofocus", "true, false"))
    for value in ("1", "perhaps", "null", "[true, 2]", "{a: true}")
]
WRONG += [
    ("irar.autofocus", "[true, true]", ("irar.autofocus", "must differ")),
    ("irar.pictures", "perhaps", ("irar.pictures", "true or false")),
    ("irar.pictures", "null", ("irar.pictures", "must be given")),
    ("irar.pictures", "[true]", ("irar.pictures",)),
    ("irar.flown", "texas", ("irar.flown", "texas", "duncan", "grid.ship")),
    ("irar.flown", "[]", ("irar.flown", "empty")),
    ("irar.flown", "7", ("irar.flown", "7", "a ship")),
    ("irar.flown", "[duncan, duncan]", ("irar.flown", "must differ")),
]


def test_every_key_is_tried():
    tried = {
        *NUMBERS,
        *MAYBE,
        *COUNTS,
        *AXES,
        *WHOLE,
        *WITH_NULL,
        *WORDS,
        "autofocus",
        "flown",
        "pictures",
        "errors",
    }
    assert tried == {field.name for field in fields(FlightConfig)}
    assert set(ERRORS) == {field.name for field in fields(FlightErrors)}
    axes = {f"irar.{key}" for key in (*AXES, *WHOLE, *WITH_NULL, *WORDS, "autofocus", "flown")}
    axes |= {f"irar.errors.{key}" for key in ERRORS}
    assert axes == {key for key in axis_keys() if key.startswith("irar.")}


@pytest.mark.parametrize(("key", "value", "said"), WRONG, ids=lambda value: str(value)[:60])
def test_a_wrong_value_is_refused_in_one_sentence(base, key, value, said):
    given = OmegaConf.create(f"value: {value}").value
    told = merged(base, key, given)
    for word in said:
        # Of large numbers all digits are told.
        assert (repr(float(word)) if "e+" in word and word in value else word) in told
    assert "\n" not in told


# What only several keys together, or the ship, make wrong.
TOGETHER = [
    ("irar.range=0", ("irar.range has 0", "at least 0.1")),
    ("irar.aircraft_speed=-90", ("irar.aircraft_speed has -90", "at least 1")),
    ("irar.pulse_rate=19000", ("irar.pulse_rate is 19000", "at least 19040", "line_rate")),
    ("irar.line_rate=[119,126]", ("irar.pulse_rate is 20000", "at least 20160")),
    ("irar.aircraft_speed=[90,5]", ("irar.aircraft_speed is 5", "close on the ship")),
    ("irar.offset=[5,120]", ("irar.aircraft_speed is 90", "close on the ship")),
    ("irar.samples=20", ("irar.samples is 20", "at least", "duncan at 175 deg")),
    ("grid.aspect=[175,90]", ("irar.samples is 160", "at least", "duncan at 90 deg")),
    ("irar.range_gate=100", ("irar.range_gate is 100 m", "as deep as this ship")),
    ("irar.range=[3.9,0.3]", ("irar.range has 0.3, but must be at least 0.", "comes closer")),
    ("irar.line_rate=20000 irar.pulse_rate=1e7", ("irar.line_rate is 20000", "lines in this")),
    ("irar.offset=80", ("irar.offset is 80", "do not climb")),
    ("irar.errors.ship_speed=[-1,-9]", ("irar.errors.ship_speed has -9", "ship_speed is -1")),
    (
        "irar.aircraft_speed=52 irar.errors.ship_speed=42",
        ("irar.errors.ship_speed has 42", "comes closer at 1.", "must be such that it does at 11"),
    ),
    ("irar.errors.aircraft_heading=1 irar.aircraft_heading=360", ("aircraft_heading has 1",)),
    ("irar.pulse_rate=[20000,19000]", ("irar.pulse_rate is 19000", "at least 19040")),
    ("irar.pointing=[null,50]", ("irar.pointing is 50",)),
    ("irar.pointing=20", ("irar.pointing has 20", "nearer 5, irar.offset", "duncan at 175 deg")),
    ("irar.chain=printed irar.azimuth=line", ("irar.azimuth is line", "pixel", "has printed")),
    (
        "irar.chain=[exact,printed_pulse_rate] irar.mirror=[exact,none]",
        ("irar.mirror is exact, none", "must be exact", "printed_pulse_rate"),
    ),
    ("irar.chain=printed irar.range_filter=mean", ("irar.range_filter is mean", "cluster")),
    ("irar.profile_range=1", ("irar.profile_range has 1", "ladar.ifov", "render.pixel")),
    ("irar.flown=roberts", ("irar.flown has 'roberts'", "duncan, the values of grid.ship")),
    ("irar.colour=red", ("irar.colour", "no key", "aircraft_speed")),
    ("irar.errors.luck=1", ("irar.errors.luck", "no key", "ship_heading")),
    ("irar.errors=[1]", ("irar.errors",)),
    ("ladar.window=150", ("ladar.window is 150", "duncan")),
    ("grid.pulse_width=9", ("grid.pulse_width has 9", "at least 9.43")),
    ("ladar.target_free_ifovs=[0,4000]", ("ladar.target_free_ifovs has 2 values", "irar")),
    ("classifier.name=likelihood", ("classifier.name is likelihood", "acn, mnn, correlation")),
    ("classifier.name=fusion", ("sensor is 'irar'", "both")),
    ("classifier.learning_rate=[0.1,0.2]", ("classifier.learning_rate has 2 values", "irar")),
    ("classifier.mnn.learning_rate=[0.1,0.2]", ("classifier.mnn.learning_rate has 2", "irar")),
    ("classifier.mnn.epochs=[10,20]", ("classifier.mnn.epochs has 2 values", "irar")),
    ("classifier.score_rule=[ship,category]", ("classifier.score_rule has 2 values", "irar")),
    ("classifier.training=noisy grid.replicate=2", ("classifier.training is noisy", "expected")),
    ("classifier.left_out=true grid.aspect=[170,175]", ("classifier.left_out is true", "false")),
]


@pytest.mark.parametrize(("overrides", "said"), TOGETHER, ids=lambda value: str(value)[:60])
def test_what_cannot_be_flown_is_refused_before_any_work(overrides, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    told = sentence(
        *("sensor=irar", "grid.ship=duncan", "grid.aspect=[175]", "store=s.zarr"),
        *overrides.split(" "),
    )
    for word in said:
        assert word in told
    assert "\n" not in told
    assert contents(tmp_path) == {}


def test_the_command_leaves_with_2_and_one_line(tmp_path, monkeypatch, capsys):
    arguments = ["sensor=irar", "grid.ship=duncan", "irar.range=[3,0]", "store=s.zarr"]
    assert "irar.range has 0" in refused(arguments, tmp_path, monkeypatch, capsys)


def test_flights_of_another_sensor_are_only_checked_for_their_ranges():
    """As of the other sensors: what could not be flown stands in nobody's way."""
    assert checked("grid.ship=duncan", "irar.samples=2").irar.samples == 2
    assert "irar.cnr has 91" in sentence("grid.ship=duncan", "irar.cnr=91")


@pytest.mark.parametrize("key", [*NUMBERS, *COUNTS, *MAYBE])
def test_both_ends_of_a_number_are_allowed(key):
    for value in (NUMBERS | COUNTS | MAYBE)[key]:
        assert getattr(FlightConfig(**{key: value}), key) == value


@pytest.mark.parametrize("key", [*AXES, *WHOLE, *WORDS])
def test_both_ends_of_an_axis_and_every_word_are_allowed(key):
    allowed = (AXES | WHOLE | WORDS)[key]
    config = composed(*replace_axes([f"irar.{key}=[{','.join(map(str, allowed))}]"]))
    axis = "flown_pulse_width" if key == "pulse_width" else key
    assert getattr(OmegaConf.to_object(config).irar.expand(), axis) == allowed


@pytest.mark.parametrize("key", WITH_NULL)
@pytest.mark.parametrize(
    ("given", "axis"),
    [("null", (None,)), ("7", (7.0,)), ("[null,-360,360]", (None, -360.0, 360.0))],
)
def test_null_is_a_value_of_some_axes(key, given, axis):
    config = composed(*replace_axes([f"irar.{key}={given}"]))
    assert getattr(OmegaConf.to_object(config).irar.expand(), key) == axis


def test_every_number_of_a_flight_is_an_axis():
    """Of a flight as the library has it; its ship's heading is what the aspect asks for."""
    names = {IN_SI.get(name, (name,))[0] for name in (*FLOWN, *RECORDED)}
    assert names - set(OF_NO_FLIGHT) == {field.name for field in fields(Flight)} - {"ship_heading"}


def test_axes_are_steps_too():
    config = composed(
        *replace_axes(
            [
                "irar.range={start: 3, stop: 4, step: 0.5}",
                "irar.errors.ship_heading={start: -2, stop: 2, step: 1}",
                "irar.errors.aircraft_speed=0.5",
            ]
        )
    )
    grid = OmegaConf.to_object(config).irar.expand((0, 1))
    assert grid.range == (3, 3.5, 4)
    assert grid.replicate == (0, 1)
    # No error comes first, and once.
    assert grid.error == (
        ("none", 0.0),
        ("aircraft_speed", 0.5),
        *(("ship_heading", value) for value in (-2.0, -1.0, 1.0, 2.0)),
    )


def flown_values(config):
    """The first value on each axis that makes a flight."""
    grid = config.expand()
    return {name: getattr(grid, name)[0] for name in (*FLOWN, *RECORDED)}


def test_the_configuration_is_the_flight_of_the_library():
    """Its defaults, in the units of the configuration; the schema's own are the same."""
    config = OmegaConf.to_object(composed()).irar
    assert config == FlightConfig()
    values = flown_values(config)
    flight = config.flight(175.0, **values)
    heading = ship_heading(aspect=175.0, sight=5.0)
    expected = Flight(slant_range=3900.0, ship_heading=heading)
    for field in fields(Flight):
        ours, theirs = getattr(flight, field.name), getattr(expected, field.name)
        assert ours == (pytest.approx(theirs, rel=1e-12) if isinstance(theirs, float) else theirs)
    assert flight.aspect == pytest.approx(175.0)


def test_values_of_a_flight_are_converted():
    config = FlightConfig()
    values = flown_values(config)
    values |= {"ifov": 300.0, "flown_pulse_width": 10.0, "samples": 50, "pointing": 4.0}
    values |= {"range": 2.5, "jitter": 40.0, "cnr": 13.0, "aircraft_heading": 20.0, "offset": -7.0}
    flight = config.flight(30.0, **values)
    assert flight.slant_range == 2500.0
    assert flight.jitter == pytest.approx(40e-6)
    assert flight.ifov == pytest.approx(300e-6)
    assert flight.pulse_width == pytest.approx(10e-9)
    assert flight.cnr == pytest.approx(19.952623)
    assert flight.aspect == pytest.approx(30.0)
    assert (flight.samples, flight.pointing, flight.sight) == (50, 4.0, 13.0)


def test_what_is_believed_wrong():
    mesh = ncti.ships.load("duncan")
    flight = Flight(slant_range=3900.0, ship_heading=0.0, aircraft_speed=80.0)
    settled = plan_scan(mesh, flight).flight
    assert believed(settled, ("none", 0.0)) == settled
    assert believed(settled, ("aircraft_speed", 5.0)) == replace(settled, aircraft_speed=84.0)
    assert believed(settled, ("ship_speed", -2.0)) == replace(settled, ship_speed=6.0)
    for name in ("aircraft_heading", "ship_heading", "pointing"):
        wrong = believed(settled, (name, 0.5))
        assert wrong == replace(settled, **{name: getattr(settled, name) + 0.5})


def test_refusals_are_those_of_the_whole_mesh():
    """Its convex hull, which stands for it, needs as many samples."""
    mesh = ncti.ships.load("roberts")
    for aspect in (0.0, 40.0, 90.0, 175.0):
        for samples in range(60, 300, 80):
            told = []
            for shape in (mesh, mesh.convex_hull):
                heading = ship_heading(aspect=aspect, sight=5.0)
                flight = Flight(
                    slant_range=3900.0, ship_heading=heading, samples=samples, pulse_rate=40_000.0
                )
                try:
                    plan = plan_scan(shape, flight)
                    told.append((plan.first, plan.lines, np.round(plan.flight.pointing, 9)))
                except ValueError as error:
                    told.append(str(error))
            assert told[0] == told[1]

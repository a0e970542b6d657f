"""Settings of flights: what each may hold, what it means, and what is refused before any work."""

from dataclasses import fields, replace

import numpy as np
import pytest
from flight_sweeps import checked, read
from hypothesis import given
from hypothesis import strategies as st

import ncti.ships
from ncti.irar import Flight, ship_heading
from ncti.irar.scene import plan_scan
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.settings import Joint
from sweeps.stages.flights import believed, check_meshes, combinations
from sweeps.stages.irar import (
    CORRECTED,
    FLIGHT,
    FLOWN,
    IN_SI,
    MOST_WRONG,
    NO_ERROR,
    OF_NO_FLIGHT,
    RECORDED,
    Irar,
    flight_of,
)
from sweeps.stages.views import Grid


def refused(**given):
    """The sentence for what is given."""
    with pytest.raises(ConfigurationError) as caught:
        checked(**given)
    said = str(caught.value)
    assert "\n" not in said
    return said


def test_pictures_are_no_axis_and_change_no_number():
    assert read(pictures=True).one(Irar.pictures) is True
    assert not Irar.pictures.identity
    assert "irar.pictures has 2 values" in refused(pictures=[True, False])


def test_dimensions_are_those_of_a_flight_in_their_order():
    assert set(FLIGHT) == {one.name for one in (*FLOWN, *RECORDED, *CORRECTED)}
    assert FLIGHT[:2] == ("range", "depression") and FLIGHT[-1] == "replicate"
    assert Irar.pulse_width.name == "flown_pulse_width"
    assert Irar.range.shown and all(one.noted for one in Irar.declared if one.name in FLIGHT[1:])


# errors ---------------------------------------------------------------------------------------


def test_errors_come_by_parameter_behind_none():
    given = {
        "ship_speed": {"start": -1, "stop": 1, "step": 0.5},
        "aircraft_heading": 2,
        "pointing": None,
        "aircraft_speed": [3, -3],
    }
    assert read(errors=given)[Irar.errors] == (
        ("none", 0.0),
        ("aircraft_heading", 2.0),
        ("aircraft_speed", -3.0),
        ("aircraft_speed", 3.0),
        *(("ship_speed", value) for value in (-1.0, -0.5, 0.5, 1.0)),
    )
    assert read(errors=None)[Irar.errors] == read(errors={})[Irar.errors] == (NO_ERROR,)


@given(
    st.dictionaries(
        st.sampled_from(sorted(MOST_WRONG)),
        st.lists(st.integers(-300, 300), min_size=1, max_size=4, unique=True),
    )
)
def test_errors_are_read_back_from_what_is_written(given):
    values = Irar.errors.values({name: [n / 10 for n in listed] for name, listed in given.items()})
    assert len(values) == 1 + sum(n != 0 for listed in given.values() for n in listed)
    assert Irar.errors.values(Irar.errors.kind.written(values)) == values
    found = Irar.errors.kind.coordinates(values)
    assert list(found) == ["error", "error_parameter", "error_value"]
    arrays = [array for array, _ in found.values()]
    assert arrays[0].tolist() == list(range(len(values)))
    assert list(zip(arrays[1].tolist(), arrays[2].tolist(), strict=True)) == list(values)
    assert all(attrs["long_name"] for _, attrs in found.values())


@pytest.mark.parametrize("key", MOST_WRONG)
def test_errors_have_bounds(key):
    most = MOST_WRONG[key]
    assert len(Irar.errors.values({key: [most, -most]})) == 3
    assert f"irar.errors.{key} has {most + 1}" in refused(errors={key: most + 1})
    for wrong in ("fast", [1, 1], [], {"start": 0}):
        assert f"irar.errors.{key}" in refused(errors={key: wrong})


def test_errors_of_nothing_known_are_refused():
    said = refused(errors={"luck": 1})
    assert said.startswith("irar.errors.luck is not a key") and "ship_heading" in said
    assert "irar.errors is [1], but must be a mapping" in refused(errors=[1])


# flights --------------------------------------------------------------------------------------


def first(*settings, **changes):
    """The first value of each setting, or another one."""
    choices = read()
    return {one.name: choices[one][0] for one in settings} | changes


def test_every_number_of_a_flight_is_a_setting():
    """Of a flight as the library has it; its ship's heading is what the aspect asks for."""
    names = {IN_SI.get(one.name, (one.name,))[0] for one in (*FLOWN, *RECORDED)}
    assert names - set(OF_NO_FLIGHT) == {field.name for field in fields(Flight)} - {"ship_heading"}


def test_defaults_are_those_of_the_library():
    values = {one.name: one.default for one in (*FLOWN, *RECORDED)}
    flight = flight_of(175.0, values)
    expected = Flight(slant_range=3900.0, ship_heading=ship_heading(aspect=175.0, sight=5.0))
    for field in fields(Flight):
        ours, theirs = getattr(flight, field.name), getattr(expected, field.name)
        assert ours == (pytest.approx(theirs, rel=1e-12) if isinstance(theirs, float) else theirs)
    assert flight.aspect == pytest.approx(175.0)


def test_values_of_a_flight_are_converted():
    values = first(*FLOWN, *RECORDED, ifov=300.0, flown_pulse_width=10.0, pointing=4.0, range=2.5)
    values |= {"jitter": 40.0, "cnr": 13.0, "aircraft_heading": 20.0, "offset": -7.0}
    flight = flight_of(30.0, values)
    assert flight.slant_range == 2500.0
    assert flight.jitter == pytest.approx(40e-6)
    assert flight.ifov == pytest.approx(300e-6)
    assert flight.pulse_width == pytest.approx(10e-9)
    assert flight.cnr == pytest.approx(19.952623)
    assert flight.aspect == pytest.approx(30.0)
    assert (flight.samples, flight.pointing, flight.sight) == (60, 4.0, 13.0)


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
    assert believed(flight, ("pointing", 0.5)).pointing == 5.5


# what several settings decide -----------------------------------------------------------------

PLAIN = {one.key.removeprefix("irar."): one.default for one in Irar.declared}
TOGETHER = [
    ({"pulse_rate": 19000}, ("irar.pulse_rate is 19000", "at least 19040", "line_rate")),
    ({"line_rate": [119, 126]}, ("irar.pulse_rate is 20000", "at least 20160")),
    ({"aircraft_speed": [90, 5]}, ("irar.aircraft_speed is 5", "close on the ship")),
    ({"offset": [5, 120]}, ("irar.aircraft_speed is 90", "close on the ship")),
    ({"errors": {"ship_speed": [-1, -9]}}, ("irar.errors.ship_speed has -9", "ship_speed is -1")),
    (
        {"aircraft_speed": 52, "errors": {"ship_speed": 42}},
        ("irar.errors.ship_speed has 42", "comes closer at 1.", "must be such that it does at 11"),
    ),
    (
        {"band_start": [8, 12]},
        ("irar.band_start has 12", "must be below 12, irar.band_stop"),
    ),
    ({"errors": {"aircraft_heading": 1}, "aircraft_heading": 360}, ("aircraft_heading has 1",)),
    (
        {"chain": "printed", "azimuth": "line"},
        ("irar.azimuth is line", "must be pixel", "irar.chain has printed"),
    ),
    (
        {"chain": ["exact", "printed_pulse_rate"], "mirror": ["exact", "none"]},
        ("irar.mirror is exact, none", "must be exact", "printed_pulse_rate"),
    ),
    ({"chain": "printed", "range_filter": "mean"}, ("irar.range_filter is mean", "cluster")),
    ({"profile_range": [1, 100]}, ("irar.profile_range has 1", "ladar.ifov", "render.pixel, 0.5")),
    ({"flown": "texas"}, ("irar.flown has 'texas'", "roberts, the values of grid.ship")),
    ({"flown": []}, ("irar.flown is empty",)),
    ({"classifier__name": "likelihood"}, ("classifier.name is likelihood", "acn, mnn, correl")),
    (
        {"classifier__training": "noisy", "grid__replicate": 2},
        ("classifier.training is noisy", "must be expected", "irar"),
    ),
    (
        {"classifier__left_out": True, "grid__aspect": [170, 175]},
        ("classifier.left_out is true", "must be false", "irar"),
    ),
]


@pytest.mark.parametrize(("given", "said"), TOGETHER, ids=lambda value: str(value)[:60])
def test_what_cannot_be_flown_is_refused(given, said):
    told = refused(**PLAIN | given)
    for word in said:
        assert word in told


OF_SHIPS = [
    ({"samples": 20}, ("irar.samples is 20", "at least", "duncan at 175 deg")),
    ({"grid__aspect": [175, 90]}, ("irar.samples is 160", "at least", "duncan at 90 deg")),
    ({"range_gate": 100}, ("irar.range_gate is 100 m", "as deep as this ship")),
    ({"range": [3.9, 0.3]}, ("irar.range has 0.3, but must be at least 0.", "approaches")),
    ({"line_rate": 20000, "pulse_rate": 1e7}, ("irar.line_rate is 20000", "lines in this")),
    ({"offset": 80}, ("irar.offset is 80", "do not climb")),
    ({"pointing": [None, 50]}, ("irar.pointing is 50",)),
    ({"pointing": 20}, ("irar.pointing has 20", "nearer 5, irar.offset", "duncan at 175 deg")),
]


@pytest.mark.parametrize(("given", "said"), OF_SHIPS, ids=lambda value: str(value)[:60])
def test_what_does_not_see_a_whole_ship_is_refused(given, said):
    given = PLAIN | {"grid__ship": ["duncan", "roberts"], "flown": "duncan"} | given
    choices = checked(**given)
    with pytest.raises(ConfigurationError) as caught:
        check_meshes(choices, ncti.ships.load)
    for word in said:
        assert word in str(caught.value)


def test_ships_that_are_not_flown_past_need_not_be_seen():
    loaded = []
    choices = checked(**PLAIN | {"grid__ship": ["duncan", "roberts"], "flown": "roberts"})
    check_meshes(choices, lambda ship: loaded.append(str(ship)) or ncti.ships.load(ship))
    assert loaded == ["roberts"]


def test_flights_that_are_not_made_are_not_refused():
    """Settings that run together make fewer flights than their values crossed."""
    given = PLAIN | {"samples": [160, 240], "pulse_rate": [20_000, 30_000]}
    assert "irar.pulse_rate is 20000" in refused(**given)
    joint = Joint("both", ("irar.samples", "irar.pulse_rate"), ((160, 2e4), (240, 3e4)))
    choices = replace(read(**given), joint=(joint,))
    found = list(combinations(choices, (Grid.aspect, *FLOWN)))
    assert [(one["samples"], one["pulse_rate"]) for one in found] == [(160, 2e4), (240, 3e4)]
    check_meshes(choices, ncti.ships.load)


def test_another_sensor_has_no_flights_to_refuse():
    assert checked(sensor="range", pulse_rate=10).one(Irar.pulse_rate) == 10
    assert "irar.cnr has 91" in refused(sensor="range", cnr=91)
    assert "irar.flown has 'texas'" in refused(sensor="range", flown="texas")


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

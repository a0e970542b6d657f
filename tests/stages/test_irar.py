"""Settings of flights have the library's defaults, are converted, and give navigation errors."""

from dataclasses import fields, replace

import pytest
from flight_sweeps import read
from hypothesis import given
from hypothesis import strategies as st

import ncti.ships
from ncti.irar import Flight, ship_heading
from ncti.irar.corrected import navigated_flight
from ncti.irar.scene import plan_scan
from sweeps.stages import irar
from sweeps.stages.irar import FLOWN, MAX_ERROR, RECORDED, Irar, flight_of, surface

# errors ---------------------------------------------------------------------------------------


@given(
    st.dictionaries(
        st.sampled_from(sorted(MAX_ERROR)),
        st.lists(st.integers(-300, 300), min_size=1, max_size=4, unique=True),
    )
)
def test_navigation_errors_round_trip(errors):
    values = Irar.errors.values({name: [n / 10 for n in listed] for name, listed in errors.items()})
    assert len(values) == 1 + sum(n != 0 for listed in errors.values() for n in listed)
    assert Irar.errors.values(Irar.errors.kind.as_input(values)) == values
    coordinates = Irar.errors.kind.coordinates(values)
    assert list(coordinates) == ["error", "error_parameter", "error_value"]
    arrays = [array for array, _ in coordinates.values()]
    assert arrays[0].tolist() == list(range(len(values)))
    assert list(zip(arrays[1].tolist(), arrays[2].tolist(), strict=True)) == list(values)
    assert all(attrs["long_name"] for _, attrs in coordinates.values())


# flights --------------------------------------------------------------------------------------


def first(*settings, **changes):
    """Return the first value of each setting, with some changed."""
    choices = read()
    return {setting.name: choices[setting][0] for setting in settings} | changes


def test_defaults_match_the_library():
    values = {setting.name: setting.default for setting in (*FLOWN, *RECORDED)}
    flight = flight_of(175.0, values)
    expected = Flight(slant_range=3900.0, ship_heading=ship_heading(aspect=175.0, sight=5.0))
    for field in fields(Flight):
        ours, theirs = getattr(flight, field.name), getattr(expected, field.name)
        assert ours == (pytest.approx(theirs, rel=1e-12) if isinstance(theirs, float) else theirs)
    assert flight.aspect == pytest.approx(175.0)


def test_flight_settings_are_converted_to_library_units():
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


OTHERS = {
    **{"range": 3.1, "depression": 6.0, "aircraft_speed": 80.0, "ship_speed": 7.0},
    **{"aircraft_heading": 10.0, "aircraft_track": 2.0, "offset": 4.0, "pointing": 4.5},
    **{"mirror_angle": 30.0, "ifov": 450.0, "line_rate": 50.0, "samples": 62},
    **{"pulse_rate": 5000.0, "range_gate": 400.0, "detectors": 4, "jitter": 100.0},
    **{"jitter_time": 1.0, "flown_pulse_width": 20.0, "cnr": 15.0, "range_sigma": 0.5},
    **{"threshold": 8.0, "nedt": 0.2, "band_start": 7.5, "band_stop": 13.0, "clutter": 0.1},
    **{"contrast_at_zero": 3.0, "sea_temperature": 280.0, "band_extinction": 0.2},
    **{"clutter_length": 30.0},
}


def test_every_setting_changes_the_flight_or_the_ship_or_the_noise():
    values, mesh = first(*FLOWN, *RECORDED), ncti.ships.load("roberts")
    assert set(values) == {*OTHERS, "transom_gain", "mast_gain", "replicate"}
    flight, plain = flight_of(175.0, values), surface(mesh, values, "lambertian")["reflectivity"]
    for name, other in OTHERS.items():
        assert flight_of(175.0, values | {name: other}) != flight, name
    for name in ("transom_gain", "mast_gain"):
        changed = surface(mesh, values | {name: 3.0}, "lambertian")["reflectivity"]
        assert (changed != plain).any(), name


def test_different_flights_draw_different_attitudes(monkeypatch):
    """`fly` is replaced by one number, drawn from the stream of the flight's attitude."""
    monkeypatch.setattr(irar, "fly", lambda mesh, flight, *, rng, **surface: rng.random())
    mesh, course = ncti.ships.load("roberts"), first(*FLOWN, jitter=50.0)
    view = {"ship": "roberts", "aspect": 175.0, "seed": 0, "replicate": 0, "reflectance": ""}
    others = ({}, {"ship": "duncan"}, {"aspect": 176.0}, {"seed": 1}, {"replicate": 1})
    drawn = [irar.fly_past(mesh, course, **view | other) for other in others]
    drawn.append(irar.fly_past(mesh, course | {"range": 4.0}, **view))
    assert len(set(drawn)) == len(others) + 1
    course["jitter"] = 0.0
    assert irar.fly_past(mesh, course, **view) == irar.fly_past(mesh, course, **view | others[-1])


def test_navigated_flight_contains_the_given_error():
    mesh = ncti.ships.load("duncan")
    flight = Flight(slant_range=3900.0, ship_heading=0.0, aircraft_speed=80.0)
    settled = plan_scan(mesh, flight).flight
    assert navigated_flight(settled, ("none", 0.0)) == settled
    assert navigated_flight(settled, ("aircraft_speed", 5.0)) == replace(
        settled, aircraft_speed=84.0
    )
    assert navigated_flight(settled, ("ship_speed", -2.0)) == replace(settled, ship_speed=6.0)
    for name in ("aircraft_heading", "ship_heading", "pointing"):
        wrong = navigated_flight(settled, (name, 0.5))
        assert wrong == replace(settled, **{name: getattr(settled, name) + 0.5})
    assert navigated_flight(flight, ("pointing", 0.5)).pointing == 5.5

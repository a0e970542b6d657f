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
from sweeps.stages.irar import FLOWN, MAX_ERROR, RECORDED, Irar, flight_of

# errors ---------------------------------------------------------------------------------------


@given(
    st.dictionaries(
        st.sampled_from(sorted(MAX_ERROR)),
        st.lists(st.integers(-300, 300), min_size=1, max_size=4, unique=True),
    )
)
def test_errors_are_read_back_from_what_is_written(errors):
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


def test_defaults_are_those_of_the_library():
    values = {setting.name: setting.default for setting in (*FLOWN, *RECORDED)}
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
    assert navigated_flight(settled, ("none", 0.0)) == settled
    assert navigated_flight(settled, ("aircraft_speed", 5.0)) == replace(
        settled, aircraft_speed=84.0
    )
    assert navigated_flight(settled, ("ship_speed", -2.0)) == replace(settled, ship_speed=6.0)
    for name in ("aircraft_heading", "ship_heading", "pointing"):
        wrong = navigated_flight(settled, (name, 0.5))
        assert wrong == replace(settled, **{name: getattr(settled, name) + 0.5})
    assert navigated_flight(flight, ("pointing", 0.5)).pointing == 5.5

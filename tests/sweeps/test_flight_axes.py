"""Axes of flights: each parameter does its own, in the flight, in the truth and in the chain."""

from dataclasses import replace

import numpy as np
import pytest
from past_ships import FEET, SMALL, cell, flown
from sweeping import fresh

import ncti.ships
from ncti.irar import (
    Flight,
    correct_as_printed,
    fly,
    profile,
    segmented,
    ship_heading,
    ship_window,
    true_snapshot,
)
from sweeps import flight_course
from sweeps.flight_course import window_of_cell
from sweeps.flight_grid import FLOWN, RECORDED, FlightErrors
from sweeps.flight_variables import SOURCES
from sweeps.seeds import cell_rng


@pytest.fixture(scope="module")
def at_hand(tmp_path_factory, cache):
    """A cache of finished stages that shares only the ships with the machine's."""
    return fresh(tmp_path_factory.mktemp("axes"), cache)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("aircraft_track", [None, 2.0]),
        ("pointing", [None, 4.5]),
        ("mirror_angle", [45.0, 30.0]),
        ("ifov", [500.0, 450.0]),
        ("line_rate", [60.0, 50.0]),
        ("samples", [60, 50]),
        ("pulse_rate", [4000.0, 5000.0]),
        ("range_gate", [300.0, 400.0]),
        ("detectors", [3, 4]),
        ("jitter_time", [0.1, 1.0]),
        ("pulse_width", [30.0, 20.0]),
        ("range_sigma", [1.0, 0.5]),
        ("threshold", [4.0, 8.0]),
        ("nedt", [0.4, 0.2]),
    ],
)
def test_any_parameter_is_an_axis(name, values, tmp_path, cache, monkeypatch):
    """Both its values in one sweep are those of two sweeps, bit for bit, and change something.

    With the same noise for all, whatever the values: what differs is their doing.
    """
    monkeypatch.setattr(flight_course, "cell_rng", lambda seed, **_: np.random.default_rng(seed))
    folder, jitter = fresh(tmp_path, cache), 100.0 if name == "jitter_time" else 0.0
    both, plan = flown(folder, replicates=1, jitter=jitter, **{name: values})
    axis = "flown_pulse_width" if name == "pulse_width" else name
    assert getattr(plan.grid, axis) == tuple(values)
    cells = [cell(both, plan, **{axis: value}) for value in values]
    for number, (value, ours) in enumerate(zip(values, cells, strict=True)):
        (empty := tmp_path / str(number)).mkdir()
        alone, other = flown(fresh(empty, cache), replicates=1, jitter=jitter, **{name: value})
        theirs = cell(alone, other)
        for variable in set(ours) - FEET:
            np.testing.assert_array_equal(ours[variable], theirs[variable], err_msg=variable)
    assert any(
        not np.array_equal(cells[0][variable], cells[1][variable], equal_nan=True)
        for variable in cells[0]
    )


@pytest.mark.parametrize(("chain", "rate"), [("printed", "line"), ("printed_pulse_rate", "pulse")])
def test_the_source_s_chain_is_a_choice(chain, rate, at_hand):
    """Its image by the library, with the belief of the cell."""
    error = ("aircraft_speed", 1.0)
    found, plan = flown(
        at_hand, chain=["exact", chain], errors=FlightErrors(aircraft_speed=1.0), replicates=1
    )
    ours = cell(found, plan, chain=chain, error=error)
    mesh = ncti.ships.load("roberts")
    flight = plan.config.flight(175.0, **{name: getattr(plan.grid, name)[0] for name in FLOWN})
    window = window_of_cell(mesh, flight, error, chain, "pixel", "exact")
    values = {name: getattr(plan.grid, name)[0] for name in (*FLOWN, *RECORDED)}
    rng = cell_rng(0, stage="flight", ship="roberts", aspect=175.0, **values)
    passed = fly(mesh, plan.config.flight(175.0, **values))
    scan = passed.record(rng)
    belief = replace(scan.flight, aircraft_speed=90.9)
    image = segmented(correct_as_printed(scan, belief=belief, window=window, rate=rate), belief)
    inside = np.s_[window.bottom - plan.window.bottom :, window.left - plan.window.left :]
    stored = ours["intensity"][inside][: window.rows, : window.columns]
    np.testing.assert_array_equal(stored, image.intensity.astype(np.float32))
    bins = ours["profile"].shape[-1]
    np.testing.assert_array_equal(
        ours["profile"][0], profile(image, belief, bins=bins).astype(np.float32)
    )
    # What it leaves behind is what the exact chain is there for.
    without = [cell(found, plan, chain=name) for name in ("exact", chain)]
    leans = [abs(float(one["noiseless_mast_tilt"])) for one in without]
    assert leans[0] < 0.5 and leans[1] > 1.0


@pytest.mark.parametrize("width", [10.0, 100.0])
def test_the_truth_is_of_the_flight_s_own_pulse(width, at_hand):
    """A pulse as long as a deck adds up what a short one tells apart, in the truth, too."""
    found, plan = flown(at_hand, pulse_width=[30.0, width], replicates=1)
    mesh, bins = ncti.ships.load("roberts"), found["profile"].shape[-1]
    for pulse_width in (30.0, width):
        flight = Flight(
            slant_range=3000.0,
            ship_heading=ship_heading(aspect=175.0, sight=5.0),
            cnr=100.0,
            pulse_width=pulse_width * 1e-9,
            **SMALL | {"ifov": 500e-6},
        )
        truth = true_snapshot(mesh, flight, ship_window(mesh, flight), cells=8)
        ours = cell(found, plan, flown_pulse_width=pulse_width)["profile"]
        np.testing.assert_allclose(
            ours[SOURCES.index("noiseless")], profile(truth, flight, bins=bins), rtol=1e-5
        )


@pytest.mark.parametrize("chain", ["printed", "printed_pulse_rate"])
def test_an_uncorrected_drift_stays_in_the_window(chain, at_hand):
    """Of a ship that drifts across three times as fast as its lines climb."""
    found, plan = flown(at_hand, chain=["exact", chain], offset=20.0, samples=180, pulse_rate=11e3,
                        cnr=30.0, replicates=1)  # fmt: skip
    printed = cell(found, plan, chain=chain)
    shown = np.nan_to_num(printed["intensity"])
    # A false alarm of the sea may be anywhere; the ship is not at the edge.
    edges = [shown[:2], shown[-2:], shown[:, :2], shown[:, -2:]]
    assert sum(edge.sum() for edge in edges) < 0.005 * shown.sum()


def test_looks_are_those_of_pixels_that_have_some(at_hand):
    """As many whether or not the window is wider than the scan."""
    found, plan = flown(at_hand, errors=FlightErrors(pointing=0.1), replicates=1)
    looks = [float(cell(found, plan, error=error)["looks"]) for error in plan.grid.error]
    assert looks[1] == pytest.approx(looks[0], rel=0.1)

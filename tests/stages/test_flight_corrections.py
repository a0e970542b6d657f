"""Corrected flights: chains, windows that hold the ship, landmarks, and nothing but noise."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
from flight_sweeps import SMALL, at, flown, in_window, opened, read

import ncti.ships
from ncti.irar import (
    Flight,
    correct_as_printed,
    profile,
    segmented,
    ship_heading,
    ship_window,
)
from sweeps.stages.corrections import compared, window_of_cell
from sweeps.stages.irar import EXACT, FLOWN, RECORDED, scan_again


@pytest.mark.parametrize(("chain", "rate"), [("printed", "line"), ("printed_pulse_rate", "pulse")])
def test_the_source_s_chain_is_a_choice(chain, rate, folder):
    """Its image by the library, with the belief of the cell."""
    given = {"chain": ["exact", "printed", "printed_pulse_rate"], "errors": {"aircraft_speed": 1}}
    found = opened(flown(folder, "printed", **given))
    error = ("aircraft_speed", 1.0)
    ours = at(found, chain=chain, error=error)
    mesh, choices = ncti.ships.load("roberts"), read()
    values = {one.name: choices[one][0] for one in (*FLOWN, *RECORDED)}
    where = {"ship": "roberts", "aspect": 175.0, "seed": 0, "reflectance": "projected_area"}
    scan = scan_again(values, mesh, **where)
    window = window_of_cell(mesh, scan.flight, error, chain, "pixel", "exact")
    belief = replace(scan.flight, aircraft_speed=90.9)
    image = segmented(correct_as_printed(scan, belief=belief, window=window, rate=rate), belief)
    stored = in_window(ours, "intensity", window)
    np.testing.assert_array_equal(stored, image.intensity.astype(np.float32))
    np.testing.assert_array_equal(ours.profile[0], profile(image, belief).astype(np.float32))
    # What it leaves behind is what the exact chain is there for.
    leans = [abs(float(at(found, chain=one).noiseless_mast_tilt)) for one in ("exact", chain)]
    assert leans[0] < 0.5 and leans[1] > 1.0


def test_an_uncorrected_drift_stays_in_the_window(folder):
    """Of a ship that drifts across three times as fast as its lines climb."""
    chains = ["exact", "printed", "printed_pulse_rate"]
    given = {"offset": 20, "samples": 180, "pulse_rate": 11e3, "cnr": 30, "chain": chains}
    found = opened(flown(folder, "drift", **given))
    for chain in chains[1:]:
        shown = at(found, chain=chain).intensity.dropna("row", how="all")
        shown = np.nan_to_num(shown.dropna("column", how="all"))
        # A false alarm of the sea may be anywhere; the ship is not at the edge.
        edges = [shown[:2], shown[-2:], shown[:, :2], shown[:, -2:]]
        assert sum(edge.sum() for edge in edges) < 0.005 * shown.sum()


def test_a_wrong_pointing_leaves_the_ship_in_its_window(folder):
    """It seems to be 35 or 14 pixels aside, where the window follows it; with as many looks."""
    found = opened(flown(folder, "pointing", errors={"pointing": [-1, 0.4]}))
    right = at(found, error=("none", 0.0))
    middle = {}
    for degrees in (0.0, -1.0, 0.4):
        error = ("pointing", degrees) if degrees else ("none", 0.0)
        one = at(found, error=error)
        assert float(one.intensity.sum()) == pytest.approx(float(right.intensity.sum()), rel=0.05)
        assert float(one.looks) == pytest.approx(float(right.looks), rel=0.1)
        line = one.intensity.sum("row")
        middle[degrees] = float((line * line.column).sum() / line.sum())
    for degrees in (-1.0, 0.4):
        expected = math.radians(degrees) * math.cos(math.radians(6.7)) / 500e-6
        assert middle[degrees] - middle[0.0] == pytest.approx(expected, abs=1.5)


@pytest.mark.parametrize("azimuth", ["pixel", "none"])
@pytest.mark.parametrize("mirror", ["exact", "rotation"])
def test_a_truth_is_in_the_middle_of_any_window(azimuth, mirror):
    mesh = ncti.ships.load("roberts")
    heading = ship_heading(aspect=175.0, sight=5.0)
    flight = Flight(slant_range=3000.0, ship_heading=heading, **SMALL | {"ifov": 500e-6})
    narrow = ship_window(mesh, flight)
    for error in (("none", 0.0), ("ship_speed", 1.0), ("pointing", -1.0)):
        ours = window_of_cell(mesh, flight, error, EXACT, azimuth, mirror)
        moved = 0
        if error[0] == "pointing":
            moved = round(math.radians(-1) * math.cos(math.radians(6.7)) / 500e-6)
        above, below = narrow.bottom - ours.bottom, ours.rows - narrow.rows
        left, right = narrow.left + moved - ours.left, ours.columns - narrow.columns
        assert (below, right) == (2 * above, 2 * left) and above >= 0 and left >= 0


def test_nothing_but_noise_fails_nothing(folder):
    """At -30 dB nothing is seen: no landmarks, no likeness, a flat signature, no belief changed."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        path = flown(folder, "noise", cnr=-30, autofocus=True, segmentation_threshold=1e6)
    ours = at(opened(path))
    assert np.all(ours.profile[0] == 0)
    assert ours.profile_correlation == 0
    assert ours.closing_speed_error == 0
    assert np.isnan(ours.mast_tilt) and np.isnan(ours.hangar_spike_offset)
    assert np.isnan(ours.mast_ratio[0]) and np.isfinite(ours.mast_ratio[1])
    measured = ours.signature.sel(kind="measured").values
    assert np.all(np.ptp(measured, axis=-1) <= 1e-6 * measured.max())
    assert np.isfinite(ours.noiseless_mast_tilt)


def test_landmarks_are_told_near_the_stern(folder):
    found = opened(
        flown(folder, "astern", grid__aspect=[164, 166, 194], samples=90, pulse_rate=6000)
    )
    told = np.isfinite(found.stern_to_hangar).all("source").squeeze()
    assert told.values.tolist() == [False, True, True]
    assert np.isfinite(found.profile_correlation).all()


def test_profiles_are_compared_by_their_own_spikes():
    """Made ones: a spike of 10 at 0 m among 2s, the measured one 3 m further off."""
    down_range = np.arange(250) - 124.5
    lines = np.zeros((4, 250))
    lines[:, 95:185] = 2.0
    spike = np.array([128, 125, 125, 125])
    lines[np.arange(4), spike] = 10.0
    told = compared(lines, down_range, aspect=180.0)
    assert told["hangar_spike_offset"] == pytest.approx(3.0)
    np.testing.assert_allclose(told["stern_to_hangar"], [33.0, 30.0, 30.0, 30.0])
    # Within 4 m of 0.5 m are 9 bins, both spikes among them: what is left is the same.
    assert told["profile_correlation_without_hangar"] == pytest.approx(1.0)
    assert told["profile_correlation"] < 0.9
    away = compared(lines, down_range, aspect=90.0)
    assert away["profile_correlation"] == told["profile_correlation"]
    assert np.isnan(away["stern_to_hangar"]).all() and np.isnan(away["hangar_spike_offset"])


def test_a_hangar_is_not_always_the_highest():
    """Her stack at 0 m returns twice what her hangar does at -31 m."""
    down_range = np.arange(250) - 124.5
    lines = np.zeros((4, 250))
    lines[:, 60:185] = 0.5
    lines[:, 125], lines[:, 93] = 10.0, 5.0
    told, others = (
        compared(lines, down_range, aspect=175.0, ship=ship) for ship in ("connole", "roberts")
    )
    np.testing.assert_allclose(told["stern_to_hangar"], 33.0)
    np.testing.assert_allclose(others["stern_to_hangar"], 65.0)
    # Masts are told of the class that they are looked for in.
    assert np.isnan(told["mast_ratio"]).all()

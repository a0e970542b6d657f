"""Flights are corrected by the chosen chain, within windows that hold the ship, in any noise."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
from commands import opened
from flight_sweeps import at, flown, in_window, read

import ncti.ships
from ncti.irar import Chain, correct_as_printed, profile, segmented
from sweeps.stages.irar import FLOWN, RECORDED, scan_again


@pytest.mark.parametrize(("chain", "rate"), [("printed", "line"), ("printed_pulse_rate", "pulse")])
def test_printed_chain_matches_the_library(chain, rate, folder):
    """The image and the profile are the library's, with the estimate of the cell."""
    settings = {
        "chain": ["exact", "printed", "printed_pulse_rate"],
        "errors": {"aircraft_speed": 1},
    }
    flights = opened(flown(folder, "printed", **settings), "validation")
    error = ("aircraft_speed", 1.0)
    ours = at(flights, chain=chain, error=error)
    mesh, choices = ncti.ships.load("roberts"), read()
    values = {setting.name: choices[setting][0] for setting in (*FLOWN, *RECORDED)}
    view = {"ship": "roberts", "aspect": 175.0, "seed": 0, "reflectance": "projected_area"}
    scan = scan_again(values, mesh, **view)
    window = Chain(form=chain).window(mesh, scan.flight, error)
    estimate = replace(scan.flight, aircraft_speed=90.9)
    image = segmented(
        correct_as_printed(scan, estimate=estimate, window=window, rate=rate), estimate
    )
    stored = in_window(ours, "intensity", window)
    np.testing.assert_array_equal(stored, image.intensity.astype(np.float32))
    np.testing.assert_array_equal(ours.profile[0], profile(image, estimate).astype(np.float32))
    # The printed chain leaves a tilt of more than 1.0, the exact chain less than 0.5.
    leans = [abs(float(at(flights, chain=way).noiseless_mast_tilt)) for way in ("exact", chain)]
    assert leans[0] < 0.5 and leans[1] > 1.0


def test_window_follows_the_ship_despite_pointing_errors(folder):
    """It seems to be 35 or 14 pixels aside, and the window follows it; looks are as many."""
    flights = opened(flown(folder, "pointing", errors={"pointing": [-1, 0.4]}), "validation")
    right = at(flights, error=("none", 0.0))
    middle = {}
    for degrees in (0.0, -1.0, 0.4):
        error = ("pointing", degrees) if degrees else ("none", 0.0)
        flight = at(flights, error=error)
        assert float(flight.intensity.sum()) == pytest.approx(
            float(right.intensity.sum()), rel=0.05
        )
        assert float(flight.looks) == pytest.approx(float(right.looks), rel=0.1)
        line = flight.intensity.sum("row")
        middle[degrees] = float((line * line.column).sum() / line.sum())
    for degrees in (-1.0, 0.4):
        expected = math.radians(degrees) * math.cos(math.radians(6.7)) / 500e-6
        assert middle[degrees] - middle[0.0] == pytest.approx(expected, abs=1.5)


def test_pure_noise_causes_no_failure(folder):
    """At -30 dB there are no landmarks and no correlation; signatures are flat, estimates kept."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        path = flown(folder, "noise", cnr=-30, autofocus=True, segmentation_threshold=1e6)
    ours = at(opened(path, "validation"))
    assert np.all(ours.profile[0] == 0)
    assert ours.profile_correlation == 0
    assert ours.closing_speed_error == 0
    assert np.isnan(ours.mast_tilt) and np.isnan(ours.hangar_spike_offset)
    assert np.isnan(ours.mast_ratio[0]) and np.isfinite(ours.mast_ratio[1])
    measured = ours.signature.sel(kind="measured").values
    assert np.all(np.ptp(measured, axis=-1) <= 1e-6 * measured.max())
    assert np.isfinite(ours.noiseless_mast_tilt)

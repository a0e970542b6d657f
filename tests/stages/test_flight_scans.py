"""Scans of flights: every parameter is felt, and passes are shared where they may be."""

import numpy as np
import pytest
from flight_sweeps import EXPERIMENT, read

import ncti.ships
from sweeps.engine.plan import Plan
from sweeps.stages import irar
from sweeps.stages.irar import FLOWN, RECORDED, scan_again

OTHERS = {
    **{"range": 3.1, "depression": 6.0, "aircraft_speed": 80.0, "ship_speed": 7.0},
    **{"aircraft_heading": 10.0, "aircraft_track": 2.0, "offset": 4.0, "pointing": 4.5},
    **{"mirror_angle": 30.0, "ifov": 450.0, "line_rate": 50.0, "samples": 62},
    **{"pulse_rate": 5000.0, "range_gate": 400.0, "detectors": 4, "jitter": 100.0},
    **{"jitter_time": 1.0, "transom_gain": 0.0, "mast_gain": 3.0, "flown_pulse_width": 20.0},
    **{"replicate": 1, "cnr": 15.0, "range_sigma": 0.5, "threshold": 8.0, "nedt": 0.2},
    **{"band_start": 7.5, "band_stop": 13.0, "contrast_at_zero": 3.0, "sea_temperature": 280.0},
    **{"band_extinction": 0.2, "clutter": 0.1, "clutter_length": 30.0},
}


@pytest.mark.parametrize("name", OTHERS)
def test_every_parameter_changes_the_scan(name, monkeypatch):
    """With the same noise for all, whatever the values: what differs is their doing."""
    assert set(OTHERS) == {one.name for one in (*FLOWN, *RECORDED)}
    if name != "replicate":  # which has other noise, and no other doing
        monkeypatch.setattr(irar, "cell_rng", lambda seed, **_: np.random.default_rng(seed))
    mesh, choices = ncti.ships.load("roberts"), read()
    values = {one.name: choices[one][0] for one in (*FLOWN, *RECORDED)}
    values["jitter"] = 50.0 if name == "jitter_time" else 0.0
    values["clutter"] = 0.3 if name == "clutter_length" else 0.0
    where = {"ship": "roberts", "aspect": 175.0, "seed": 0, "reflectance": "projected_area"}
    scans = [
        scan_again(given, mesh, **where)
        for given in (values, values, values | {name: OTHERS[name]})
    ]
    first, again, other = (
        (one.time.tobytes(), one.intensity.tobytes(), one.range.tobytes(), one.infrared.tobytes())
        for one in scans
    )
    assert first == again
    assert first != other


def test_the_passive_band_changes_no_active_image():
    """Speckle and all noise are one draw, whatever the band, the sea and its clutter.

    Less the image of a ship as cold as the sea, that of a warm one is what she fills of a pixel,
    times her contrast.
    """
    mesh, choices = ncti.ships.load("roberts"), read()
    values = {one.name: choices[one][0] for one in (*FLOWN, *RECORDED)}
    where = {"ship": "roberts", "aspect": 175.0, "seed": 3, "reflectance": "projected_area"}
    scans = [
        scan_again(values | changed, mesh, **where)
        for changed in ({}, {"contrast_at_zero": 0.0}, {"clutter": 0.5}, {"band_start": 3.0})
    ]
    plain, cold, *others = scans
    for other in (cold, *others):
        np.testing.assert_array_equal(other.intensity, plain.intensity)
        np.testing.assert_array_equal(other.range, plain.range)
        assert not np.array_equal(other.infrared, plain.infrared)
    filled = (plain.infrared - cold.infrared) / plain.flight.contrast
    assert filled.min() == pytest.approx(0.0, abs=1e-6)
    assert filled.max() == pytest.approx(1.0, abs=1e-6)  # float32


def test_draws_share_a_pass_unless_the_line_of_sight_jitters():
    values = read(jitter=[0, 50], grid__replicate=3)
    plan = Plan(EXPERIMENT, values)
    bound = plan.bound["flown_pass"]
    assert len({plan.key(bound, place) for place in plan.cells(bound)}) == 4
    assert plan.count(bound) == 6

"""Every parameter of a flight changes its scan, and flights draw attitudes of their own."""

from functools import cache

import numpy as np
import pytest
from flight_sweeps import read

import ncti.ships
from sweeps.stages import irar
from sweeps.stages.irar import FLOWN, RECORDED, scan_again

FEW = {"ifov": 1000.0, "samples": 40, "line_rate": 30.0, "pulse_rate": 2000.0, "detectors": 2}
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


def test_attitudes_of_different_flights_are_drawn_apart(monkeypatch):
    """`fly` is replaced by one number, drawn from the stream of the flight's attitude."""
    monkeypatch.setattr(irar, "fly", lambda mesh, flight, *, rng, **surface: rng.random())
    mesh, choices = ncti.ships.load("roberts"), read()
    course = {setting.name: choices[setting][0] for setting in FLOWN} | {"jitter": 50.0}
    view = {"ship": "roberts", "aspect": 175.0, "seed": 0, "replicate": 0, "reflectance": ""}
    others = ({}, {"ship": "duncan"}, {"aspect": 176.0}, {"seed": 1}, {"replicate": 1})
    drawn = [irar.fly_past(mesh, course, **view | other) for other in others]
    drawn.append(irar.fly_past(mesh, course | {"range": 4.0}, **view))
    assert len(set(drawn)) == len(others) + 1


@pytest.fixture(scope="module")
def scanned():
    """Return a cached function of some values, which returns the bytes of their scan."""
    mesh, choices = ncti.ships.load("roberts"), read(**FEW)
    view = {"ship": "roberts", "aspect": 175.0, "seed": 0, "reflectance": "projected_area"}
    defaults = {setting.name: choices[setting][0] for setting in (*FLOWN, *RECORDED)}

    @cache
    def scan(**given):
        flight_scan = scan_again(defaults | given, mesh, **view)
        return [
            part.tobytes()
            for part in (
                flight_scan.time,
                flight_scan.intensity,
                flight_scan.range,
                flight_scan.infrared,
            )
        ]

    return scan


@pytest.mark.parametrize("name", OTHERS)
def test_every_parameter_changes_the_scan(name, scanned, monkeypatch):
    """All values have the same noise, so that the parameter alone can change the scan."""
    assert set(OTHERS) == {setting.name for setting in (*FLOWN, *RECORDED)}
    if name != "replicate":  # which changes nothing but the noise
        monkeypatch.setattr(irar, "cell_rng", lambda seed, **_: np.random.default_rng(seed))
    changed = {
        "jitter": 50.0 * (name == "jitter_time"),
        "clutter": 0.3 * (name == "clutter_length"),
    }
    if name == "replicate":
        changed["replicate"] = 0
    assert scanned(**changed) != scanned(**changed | {name: OTHERS[name]})

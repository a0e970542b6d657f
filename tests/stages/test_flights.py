"""Flights of a sweep are equal to the library's by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from commands import opened
from flight_sweeps import SMALL, at, flown, in_window

import ncti.ships
from ncti import irar
from ncti.irar.chain import places
from ncti.ladar import carrier_to_noise, expected_profile, range_extent
from ncti.render import range_image
from sweeps.engine.resolve.streams import cell_rng

IMAGES = ("intensity", "range_image", "infrared_image")


SEVERAL = {
    "seed": 7,
    "grid__replicate": 2,
    "grid__pulse_width": [30, 50],
    "mast_gain": 3,
    "cnr": 15,
    "errors": {"aircraft_speed": 1},
    "autofocus": [False, True],
}


@pytest.fixture(scope="module")
def several(folder):
    """Return flights of a sweep with errors, draws and pulse widths."""
    return opened(flown(folder, **SEVERAL), "validation")


@pytest.mark.parametrize(
    ("error", "focus"),
    [(("none", 0.0), False), (("aircraft_speed", 1.0), False), (("aircraft_speed", 1.0), True)],
)
def test_flight_matches_direct_library_calls(several, error, focus):
    """Every variable follows from the flight's parameters and the key of its noise."""
    ours = at(several, error=error, autofocus=focus, replicate=1)

    mesh = ncti.ships.load("roberts")
    flight = irar.Flight(
        slant_range=3000.0,
        ship_heading=irar.ship_heading(aspect=175.0, sight=5.0),
        cnr=10**1.5,
        **SMALL | {"ifov": 500e-6},
    )
    surface = irar.reflectivity(mesh, mast_gain=3.0)
    values = {
        **dict(range=3.0, depression=6.7, aircraft_speed=90.0, ship_speed=8.0),
        **dict(aircraft_heading=0.0, aircraft_track=None, offset=5.0, pointing=None),
        **dict(mirror_angle=45.0, range_gate=300.0, jitter=0.0, jitter_time=0.1),
        **dict(transom_gain=1.0, mast_gain=3.0, cnr=15.0),
        **dict(flown_pulse_width=30.0, range_sigma=1.0, threshold=4.0, nedt=0.4),
        **SMALL,
    }
    rng = cell_rng(7, stage="flight", ship="roberts", aspect=175.0, replicate=1, **values)
    passed = irar.fly(mesh, flight, reflectivity=surface)
    scan = passed.record(rng)
    estimate = scan.flight
    if error[1]:
        estimate = replace(estimate, aircraft_speed=90.9)
    if focus:
        estimate = irar.autofocus(scan, estimate)

    narrow = irar.ship_window(mesh, flight)
    window, more = narrow, (0, 0)
    if error[1]:
        above = math.ceil(max(narrow.rows, narrow.columns) / 8)
        more = above, narrow.rows
        window = irar.Window(
            narrow.bottom - above,
            narrow.left - narrow.rows,
            narrow.rows + 2 * above,
            narrow.columns + 2 * narrow.rows,
        )
    unsegmented = irar.correct(scan, irar.Correction(), estimate=estimate, window=window)
    image = irar.segmented(unsegmented, estimate)
    fine = irar.correct(scan, irar.Correction(), estimate=estimate, window=window, overscanned=True)
    fine = irar.segmented(fine, estimate)
    truth = irar.true_snapshot(mesh, flight, narrow, cells=8, reflectivity=surface)

    pictures = (image.intensity, image.range - 3000.0, image.infrared)
    for name, values in zip(IMAGES, pictures, strict=True):
        stored = in_window(ours, name, window)
        np.testing.assert_array_equal(stored, values.astype(np.float32))
    assert ours.looks == np.float32(image.looks[image.looks > 0].mean())
    speed = estimate.closing_speed / scan.flight.closing_speed - 1
    assert float(ours.closing_speed_error) == pytest.approx(speed, abs=1e-7)
    assert (speed != 0) == bool(error[1])

    wide = [(n * 8, n * 8) for n in more]
    truths = [np.pad(values, wide) for values in (truth.intensity, truth.infrared)]
    row, column, _ = places(scan, irar.Correction(), estimate)
    spots = row - window.bottom, column - window.left
    pair = unsegmented.intensity, unsegmented.infrared
    tilts = {
        "": irar.tilts([*pair], truths, places=spots),
        "intensity_": irar.tilts(pair[0], truths[0], places=spots),
        "infrared_": irar.tilts(pair[1], truths[1], places=spots),
    }
    clean = irar.correct(
        passed.noiseless(), irar.Correction(), estimate=estimate, window=window
    ).infrared
    row, column, _ = places(passed.noiseless(), irar.Correction(), estimate)
    spots = row - window.bottom, column - window.left
    tilts["noiseless_"] = irar.tilts(clean, truths[1], places=spots)
    for channel, tilt in tilts.items():
        for name in ("mast", "waterline"):
            stored = float(ours[f"{channel}{name}_tilt"])
            assert stored == pytest.approx(getattr(tilt, name), rel=1e-5), (channel, name)
    for name in ("mast", "waterline"):
        error = getattr(tilts[""], f"{name}_error")
        assert float(ours[f"{name}_tilt_error"]) == pytest.approx(error, rel=1e-5), name

    drawn = range_image(
        mesh, aspect=175.0, depression=6.7, pixel=1.5, roll=0.0, slant_range=3000.0, engine="embree"
    )
    profiles = [irar.profile(fine, estimate), irar.profile(truth, flight)]
    for spread in (1.0, 0.0):
        extent = range_extent(drawn, slant_range=3000.0, ifov=500.0001e-6, spread=spread)
        profiles.append(flight.cnr * extent.fraction.sum(axis=0))
    # Shares here are of a slightly larger IFOV, which holds a whole pixel.
    np.testing.assert_allclose(ours.profile, np.array(profiles), rtol=2e-6, atol=1e-6)
    down_range = np.arange(250) - 124.5
    np.testing.assert_array_equal(ours.down_range, down_range)
    spike = down_range[profiles[2].argmax()]
    near = np.abs(down_range - spike) <= 4
    for name, without in (("", None), ("_without_hangar", near)):
        correlation = irar.profile_correlation(profiles[0], profiles[1], exclude=without)
        assert float(ours[f"profile_correlation{name}"]) == pytest.approx(correlation, rel=1e-6)
    ends = (0.02, 0.02, 0.05, 0.05)
    landmarks = [
        irar.landmarks(profile, down_range, hangar=(spike - 8, spike + 8), end=end)
        for profile, end in zip(profiles, ends, strict=True)
    ]
    offset = landmarks[0].hangar - landmarks[1].hangar
    assert float(ours.hangar_spike_offset) == pytest.approx(offset, abs=1e-5)
    for k, marks in enumerate(landmarks):
        expected_marks = {"stern_to_hangar": marks.stern, "stern_to_bridge": marks.stern_to_bridge}
        for name in ("transom", "mast", "forward"):
            peak = getattr(marks, name)
            expected_marks |= {f"{name}_ratio": peak.height, f"{name}_energy": peak.energy}
            expected_marks |= {f"{name}_position": peak.offset} if name != "transom" else {}
        for name, value in (expected_marks | {"deck_spikes": len(marks.deck_spikes)}).items():
            assert float(ours[name][k]) == pytest.approx(value, rel=1e-4, nan_ok=True), name

    flown_extent = irar.measured_extent(fine, estimate, slant_range=100e3)
    cnr = carrier_to_noise(100e3, reference=10**3.2, reference_range=100e3)
    for width in (30, 50):
        expected = expected_profile(
            flown_extent, pulse_width=width * 1e-9, cnr=cnr, target_free_ifovs=4000
        ).astype(np.float32)
        stored = ours.signature.sel(pulse_width=width, kind="measured")
        np.testing.assert_array_equal(stored, expected)

"""Flights of a small sweep: the library done by hand, and what a cell does not depend on."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
from flight_sweeps import EXPERIMENT, SMALL, flown, opened, read

import ncti.ships
from ncti.irar import (
    Correction,
    Flight,
    Window,
    autofocus,
    correct,
    correct_as_printed,
    fly,
    landmarks,
    measured_extent,
    profile,
    profile_correlation,
    reflectivity,
    segmented,
    ship_heading,
    ship_window,
    tilts,
    true_snapshot,
)
from ncti.irar.chain import places
from ncti.ladar import (
    carrier_to_noise,
    cumulative_average,
    expected_profile,
    range_extent,
    sample_frames,
)
from ncti.render import range_image
from sweeps.engine.plan import Plan
from sweeps.engine.seeds import cell_rng
from sweeps.stages import irar
from sweeps.stages.corrections import compared, window_of_cell
from sweeps.stages.irar import EXACT, FLOWN, RECORDED, scan_again

IMAGES = ("intensity", "range_image", "infrared_image")
SEVERAL = {
    "seed": 7,
    "grid__replicate": 2,
    "grid__pulse_width": [30, 50],
    "mast_gain": [1, 3],
    "cnr": [15, 20],
    "errors": {"aircraft_speed": 1},
    "autofocus": [False, True],
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where sweeps of this module find what others finished."""
    return tmp_path_factory.mktemp("flights")


@pytest.fixture(scope="module")
def store(folder):
    """A sweep with two values on axes of every sort."""
    return flown(folder, **SEVERAL)


@pytest.fixture(scope="module")
def several(store):
    return opened(store)


def at(found, **values):
    """One flight past one ship; the first on every other axis."""
    errors = list(
        zip(np.atleast_1d(found.error_parameter), np.atleast_1d(found.error_value), strict=True)
    )
    place = {"error": errors.index(values.pop("error"))} if "error" in values else {}
    one = found.isel(place).sel(values)
    own = {"source", "down_range", "row", "column", "pulse_width", "kind"}
    return one.isel({name: 0 for name in one.dims if name not in own})


def in_window(found, name, window):
    """An image within its cell's own window; there must be nothing outside."""
    rows = slice(window.bottom, window.bottom + window.rows - 1)
    columns = slice(window.left, window.left + window.columns - 1)
    inside = found[name].sel(row=rows, column=columns)
    assert np.isfinite(found[name]).sum() == np.isfinite(inside).sum()
    return inside.values


@pytest.mark.parametrize(
    ("error", "focus"),
    [(("none", 0.0), False), (("aircraft_speed", 1.0), False), (("aircraft_speed", 1.0), True)],
)
def test_a_flight_is_the_library_done_by_hand(several, error, focus):
    """Every variable, from the flight's parameters and the name of its noise."""
    ours = at(several, mast_gain=3, cnr=15, error=error, autofocus=focus, replicate=1)

    mesh = ncti.ships.load("roberts")
    flight = Flight(
        slant_range=3000.0,
        ship_heading=ship_heading(aspect=175.0, sight=5.0),
        cnr=10**1.5,
        **SMALL | {"ifov": 500e-6},
    )
    surface = reflectivity(mesh, mast_gain=3.0)
    values = {
        **dict(range=3.0, depression=6.7, aircraft_speed=90.0, ship_speed=8.0),
        **dict(aircraft_heading=0.0, aircraft_track=None, offset=5.0, pointing=None),
        **dict(mirror_angle=45.0, range_gate=300.0, jitter=0.0, jitter_time=0.1),
        **dict(transom_gain=1.0, mast_gain=3.0, cnr=15.0),
        **dict(flown_pulse_width=30.0, range_sigma=1.0, threshold=4.0, nedt=0.4),
        **SMALL,
    }
    rng = cell_rng(7, stage="flight", ship="roberts", aspect=175.0, replicate=1, **values)
    passed = fly(mesh, flight, reflectivity=surface)
    scan = passed.record(rng)
    belief = scan.flight
    if error[1]:
        belief = replace(belief, aircraft_speed=90.9)
    if focus:
        belief = autofocus(scan, belief)

    narrow = ship_window(mesh, flight)
    window, more = narrow, (0, 0)
    if error[1]:
        above = math.ceil(max(narrow.rows, narrow.columns) / 8)
        more = above, narrow.rows
        window = Window(
            narrow.bottom - above,
            narrow.left - narrow.rows,
            narrow.rows + 2 * above,
            narrow.columns + 2 * narrow.rows,
        )
    whole = correct(scan, Correction(), belief=belief, window=window)
    image = segmented(whole, belief)
    fine = correct(scan, Correction(), belief=belief, window=window, overscanned=True)
    fine = segmented(fine, belief)
    truth = true_snapshot(mesh, flight, narrow, cells=8, reflectivity=surface)

    pictures = (image.intensity, image.range - 3000.0, image.infrared)
    for name, values in zip(IMAGES, pictures, strict=True):
        stored = in_window(ours, name, window)
        np.testing.assert_array_equal(stored, values.astype(np.float32))
    assert ours.looks == np.float32(image.looks[image.looks > 0].mean())
    speed = belief.closing_speed / scan.flight.closing_speed - 1
    assert float(ours.closing_speed_error) == pytest.approx(speed, abs=1e-7)
    assert (speed != 0) == bool(error[1])

    wide = [(n * 8, n * 8) for n in more]
    truths = [np.pad(values, wide) for values in (truth.intensity, truth.infrared)]
    row, column, _ = places(scan, Correction(), belief=belief)
    spots = row - window.bottom, column - window.left
    lean = tilts([whole.intensity, whole.infrared], truths, places=spots)
    active, passive = (
        tilts(image, truth_, places=spots)
        for image, truth_ in zip((whole.intensity, whole.infrared), truths, strict=True)
    )
    clean = correct(passed.noiseless(), Correction(), belief=belief, window=window).infrared
    row, column, _ = places(passed.noiseless(), Correction(), belief=belief)
    noiseless = tilts(clean, truths[1], places=(row - window.bottom, column - window.left))
    for name, value in (
        ("mast_tilt", lean.mast),
        ("waterline_tilt", lean.waterline),
        ("mast_tilt_error", lean.mast_error),
        ("waterline_tilt_error", lean.waterline_error),
        ("intensity_mast_tilt", active.mast),
        ("intensity_waterline_tilt", active.waterline),
        ("infrared_mast_tilt", passive.mast),
        ("infrared_waterline_tilt", passive.waterline),
        ("noiseless_mast_tilt", noiseless.mast),
        ("noiseless_waterline_tilt", noiseless.waterline),
    ):
        assert float(ours[name]) == pytest.approx(value, rel=1e-5), name

    drawn = range_image(
        mesh, aspect=175.0, depression=6.7, pixel=1.5, roll=0.0, slant_range=3000.0, engine="embree"
    )
    profiles = [profile(fine, belief), profile(truth, flight)]
    for spread in (1.0, 0.0):
        extent = range_extent(drawn, slant_range=3000.0, ifov=500.0001e-6, spread=spread)
        profiles.append(flight.cnr * extent.fraction.sum(axis=0))
    # A share of the larger IFOV, which holds a whole pixel.
    np.testing.assert_allclose(ours.profile, np.array(profiles), rtol=2e-6, atol=1e-6)
    down_range = np.arange(250) - 124.5
    np.testing.assert_array_equal(ours.down_range, down_range)
    spike = down_range[profiles[2].argmax()]
    near = np.abs(down_range - spike) <= 4
    for name, without in (("", None), ("_without_hangar", near)):
        alike = profile_correlation(profiles[0], profiles[1], exclude=without)
        assert float(ours[f"profile_correlation{name}"]) == pytest.approx(alike, rel=1e-6)
    ends = (0.02, 0.02, 0.05, 0.05)
    told = [
        landmarks(one, down_range, hangar=(spike - 8, spike + 8), end=end)
        for one, end in zip(profiles, ends, strict=True)
    ]
    offset = told[0].hangar - told[1].hangar
    assert float(ours.hangar_spike_offset) == pytest.approx(offset, abs=1e-5)
    for k, marks in enumerate(told):
        for name, value in (
            ("stern_to_hangar", marks.stern),
            ("stern_to_bridge", marks.stern_to_bridge),
            ("transom_ratio", marks.transom.height),
            ("transom_energy", marks.transom.energy),
            ("mast_position", marks.mast.offset),
            ("mast_ratio", marks.mast.height),
            ("mast_energy", marks.mast.energy),
            ("forward_position", marks.forward.offset),
            ("forward_ratio", marks.forward.height),
            ("forward_energy", marks.forward.energy),
            ("deck_spikes", len(marks.deck_spikes)),
        ):
            assert float(ours[name][k]) == pytest.approx(value, rel=1e-4, nan_ok=True), name

    seen = measured_extent(fine, belief, slant_range=100e3)
    cnr = carrier_to_noise(100e3, reference=10**3.2, reference_range=100e3)
    for width in (30, 50):
        expected = expected_profile(
            seen, pulse_width=width * 1e-9, cnr=cnr, target_free_ifovs=4000
        ).astype(np.float32)
        stored = ours.signature.sel(pulse_width=width, kind="measured")
        np.testing.assert_array_equal(stored, expected)


def test_synthetic_signatures_are_those_of_the_range_channel(folder):
    """Same view, same sensor, drawn at the flight's depression; tests have a name of their own."""
    given = {"depression": 5, "profile_frames": [8, 16], "grid__replicate": 2}
    found = opened(flown(folder, "deep", **given))
    mesh = ncti.ships.load("roberts")
    image = range_image(mesh, aspect=175.0, depression=5.0, pixel=0.5, engine="embree")
    finer = 0.5 * max(math.sqrt(int(image.hit.sum()) / 20_000), 0.25)
    image = range_image(mesh, aspect=175.0, depression=5.0, pixel=finer, engine="embree")
    extent = range_extent(image, slant_range=100e3)
    sensor = {"pulse_width": 30e-9, "cnr": 10**3.2, "target_free_ifovs": 4000}
    learned = expected_profile(extent, **sensor).astype(np.float32)
    rng = cell_rng(
        0, stage="flight_signature", ship="roberts", aspect=175.0, depression=5.0,
        pulse_width=30.0, replicate=1,
    )  # fmt: skip
    frames = sample_frames(extent, frame_count=16, rng=rng, **sensor)
    for count in (8, 16):
        ours = at(found, replicate=1, profile_frames=count).signature.isel(pulse_width=0)
        np.testing.assert_array_equal(ours.sel(kind="learned"), learned)
        test = cumulative_average(frames, (count,))[0].astype(np.float32)
        np.testing.assert_array_equal(ours.sel(kind="test"), test)


def test_a_flight_is_the_same_in_another_grid(several, tmp_path):
    """Whatever else there is: other gains, ratios, errors, replicates, ships, and other windows."""
    other = opened(
        flown(
            tmp_path, seed=7, mast_gain=3, cnr=[12, 20], range=[2.5, 3], offset=5,
            grid__ship=["duncan", "roberts"], flown=["duncan", "roberts"], errors={"pointing": -1},
        )
    )  # fmt: skip
    ours, theirs = (
        at(found, ship="roberts", mast_gain=mast, cnr=20, range=3, error=("none", 0.0))
        for found, mast in ((other.expand_dims(mast_gain=[3.0]), 3), (several, 3))
    )
    theirs = theirs.sel(pulse_width=[30])
    for name in ours.data_vars:
        mine, yours = ours[name], theirs[name]
        if name in IMAGES:
            mine, yours = (one.stack(at=("row", "column")).dropna("at") for one in (mine, yours))
            np.testing.assert_array_equal(mine["at"], yours["at"])
        np.testing.assert_array_equal(mine, yours, err_msg=name)
    assert other.sizes["column"] != several.sizes["column"]
    quieter = at(other, ship="roberts", cnr=12, range=3)
    assert not np.array_equal(quieter.profile, ours.profile)


def test_a_scan_again_is_the_scan_of_the_sweep(several):
    values = {one.name: read(**SEVERAL)[one][0] for one in (*FLOWN, *RECORDED)}
    values |= {"mast_gain": 3.0, "cnr": 15.0, "replicate": 1}
    mesh = ncti.ships.load("roberts")
    where = {"ship": "roberts", "aspect": 175.0, "reflectance": "projected_area"}
    ours = at(several, mast_gain=3, cnr=15, replicate=1)
    window = ship_window(mesh, scan_again(values, mesh, seed=7, **where).flight)
    for seed in (7, 8):
        scan = scan_again(values, mesh, seed=seed, **where)
        image = segmented(correct(scan, window=window), scan.flight)
        stored = in_window(ours, "intensity", window)
        same = np.array_equal(stored, image.intensity.astype(np.float32))
        assert same == (seed == 7)


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


def test_a_ship_that_is_not_flown_past_is_only_learned(folder):
    given = {"grid__ship": ["duncan", "roberts"], "flown": "roberts", "cnr": [15, 20]}
    path = flown(folder, "learned", **given)
    found = opened(path)
    for name, values in found.sel(ship="duncan").data_vars.items():
        if name != "signature":
            assert np.isnan(values).all(), name
            assert np.isfinite(found[name].sel(ship="roberts")).any(), name
    kinds = found.signature.sel(ship="duncan")
    assert np.isfinite(kinds.sel(kind=["learned", "test"])).all()
    assert np.isnan(kinds.sel(kind="measured")).all()
    # Its images take no room: the window is that of the other.
    alone = opened(flown(folder, "alone", cnr=[15, 20]))
    for dim in ("row", "column"):
        np.testing.assert_array_equal(alone[dim], found[dim])
        assert found[dim].attrs["units"] == "pixel" and "ship origin" in found[dim].long_name
    status = opened(path, "status_measured").cell.sel(ship="duncan")
    assert np.all(status.sel(kind="measured") == -1)
    assert np.all(status.sel(kind=["learned", "test"]) == 1)
    assert np.all(opened(path, "status").view == 1)


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


def test_glinting_masts_are_an_input(several):
    """Three times the reflectivity of masts: more of them in the flight and its truth, as much
    in the synthetic profiles, which know nothing of it."""
    before, after = (at(several, mast_gain=gain, cnr=20).mast_energy for gain in (1, 3))
    real, made = ["measured", "noiseless"], ["synthetic", "point"]
    gain = (after / before).sel(source=real)
    assert np.all((gain > 1.5) & (gain < 3.1))
    np.testing.assert_array_equal(before.sel(source=made), after.sel(source=made))


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


def test_the_truth_is_of_the_flight_s_own_pulse(folder):
    """A pulse as long as a deck adds up what a short one tells apart, in the truth, too."""
    found = opened(flown(folder, "pulses", pulse_width=[10, 100]))
    mesh = ncti.ships.load("roberts")
    for pulse_width in (10, 100):
        flight = Flight(
            slant_range=3000.0,
            ship_heading=ship_heading(aspect=175.0, sight=5.0),
            cnr=100.0,
            pulse_width=pulse_width * 1e-9,
            **SMALL | {"ifov": 500e-6},
        )
        truth = true_snapshot(mesh, flight, ship_window(mesh, flight), cells=8)
        ours = at(found, flown_pulse_width=pulse_width).profile.sel(source="noiseless")
        np.testing.assert_allclose(ours, profile(truth, flight), rtol=1e-5)


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


def test_other_bins_and_other_surfaces_are_those_of_the_sweep(folder):
    """Half-metre bins hold as much as metre ones; Lambertian ships return less, in flight, too."""
    coarse, fine, cosine = (
        at(opened(flown(folder, f"bins{k}", **given))).profile
        for k, given in enumerate(
            ({}, {"ladar__bin_width": 0.5}, {"ladar__reflectance": "lambertian"})
        )
    )
    pairs = fine.values.reshape(4, 250, 2).sum(axis=-1)
    # Points in space; spread pixels are binned to rounding, too.
    np.testing.assert_allclose(pairs[:2].sum(-1), coarse[:2].sum("down_range"), rtol=1e-5)
    np.testing.assert_allclose(pairs[0], coarse[0], rtol=1e-5, atol=1e-3)
    assert np.all(cosine.sum("down_range") < 0.95 * coarse.sum("down_range"))


def test_flights_are_what_a_physicist_expects(several):
    """Bounds that a coarse image, 1.5 m a pixel, keeps; with and without an error of the speed."""
    right, wrong = (several.isel(error=k).sel(autofocus=False) for k in (0, 1))
    assert np.all(right.profile_correlation.sel(cnr=20) > 0.9)
    assert np.all(np.abs(right.hangar_spike_offset) < 1.0)
    assert np.all(np.abs(right.noiseless_mast_tilt) < 1.0)
    assert np.all(right.closing_speed_error == 0)
    assert np.all((right.looks > 8) & (right.looks < 11))  # 9.7 lines a pixel
    sums = right.profile.sel(source="noiseless").sum("down_range")  # in noise powers
    np.testing.assert_allclose(sums.sel(cnr=20) / sums.sel(cnr=15), 10**0.5, rtol=1e-5)
    # A hundredth too fast, and tops come to lie 4 m nearer or further than the waterline.
    np.testing.assert_allclose(wrong.closing_speed_error, 90 / 82.2 * 0.01, rtol=0.1)
    assert (right.profile_correlation - wrong.profile_correlation).mean() > 0.05


def test_words_of_a_flight_are_not_taken_by_the_laser_radar(folder, several):
    """Both have an `ifov` and a `cnr`; several values of the one leave the other its name."""
    assert several.ifov.item() == 500 and several.ifov.attrs["units"] == "urad"
    assert several.cnr.values.tolist() == [15, 20]
    assert several.samples.item() == 60 and several.mirror.item() == "exact"
    assert several.error_parameter.values.tolist() == ["none", "aircraft_speed"]
    found = opened(flown(folder, "both", ladar__cnr=[30, 32], render__samples=[100, 200]))
    assert found.cnr.item() == 20 and found.ladar_cnr.values.tolist() == [30, 32]
    assert set(found.signature.dims) > {"ladar_cnr", "render_samples"}
    assert not {"ladar_cnr", "render_samples"} & set(found.profile.dims)


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

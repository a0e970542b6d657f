"""The flights of a view: what they share, what they leave out, and the library done by hand."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
from past_ships import FEET, SMALL, cell, flown, planned
from sweeping import fresh

import ncti.ships
from ncti.irar import (
    Correction,
    Flight,
    Window,
    autofocus,
    correct,
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
from ncti.ladar import carrier_to_noise, expected_profile, range_extent
from ncti.render import range_image
from sweeps import flight_course
from sweeps.flight_comparison import compared
from sweeps.flight_course import window_of_cell
from sweeps.flight_grid import FLOWN, FlightErrors
from sweeps.flight_schema import EXACT
from sweeps.flight_variables import KINDS, OF_VIEWS, SOURCES
from sweeps.seeds import cell_rng
from sweeps.sensor_schema import LadarConfig


@pytest.fixture(scope="module")
def at_hand(tmp_path_factory, cache):
    """A cache of finished stages that shares only the ships with the machine's."""
    return fresh(tmp_path_factory.mktemp("flights"), cache)


@pytest.fixture(scope="module")
def several(at_hand):
    """A view with two values on axes of every sort, and its plan."""
    return flown(
        at_hand,
        seed=7,
        mast_gain=[1.0, 3.0],
        cnr=[15.0, 20.0],
        errors=FlightErrors(aircraft_speed=1.0),
        autofocus=[False, True],
    )


@pytest.mark.parametrize(
    ("error", "focus"),
    [(("none", 0.0), False), (("aircraft_speed", 1.0), False), (("aircraft_speed", 1.0), True)],
)
def test_a_cell_is_the_library_done_by_hand(several, error, focus):
    """Every variable, from the flight's parameters and the name of its noise."""
    found, plan = several
    ours = cell(found, plan, mast_gain=3.0, cnr=15.0, error=error, autofocus=focus, replicate=1)

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

    inside = np.s_[window.bottom - plan.window.bottom :, window.left - plan.window.left :]
    for name, values in (
        ("intensity", image.intensity),
        ("range_image", image.range - 3000.0),
        ("infrared_image", image.infrared),
    ):
        stored = ours[name][inside][: window.rows, : window.columns]
        np.testing.assert_array_equal(stored, values.astype(np.float32))
        assert np.isfinite(ours[name]).sum() == np.isfinite(values).sum()
    assert ours["looks"] == np.float32(image.looks[image.looks > 0].mean())
    speed = belief.closing_speed / scan.flight.closing_speed - 1
    assert ours["closing_speed_error"] == pytest.approx(speed, abs=1e-7)
    assert (speed != 0) == bool(error[1])

    wide = [(n * 8, n * 8) for n in more]
    truths = [np.pad(values, wide) for values in (truth.intensity, truth.infrared)]
    row, column, _ = places(scan, Correction(), belief=belief)
    spots = row - window.bottom, column - window.left
    lean = tilts([whole.intensity, whole.infrared], truths, places=spots)
    assert ours["mast_tilt"] == pytest.approx(lean.mast, rel=1e-6)
    assert ours["waterline_tilt"] == pytest.approx(lean.waterline, rel=1e-6)
    assert ours["mast_tilt_error"] == pytest.approx(lean.mast_error, rel=1e-6)
    assert ours["waterline_tilt_error"] == pytest.approx(lean.waterline_error, rel=1e-6)
    clean = correct(passed.noiseless(), Correction(), belief=belief, window=window).infrared
    row, column, _ = places(passed.noiseless(), Correction(), belief=belief)
    lean = tilts(clean, truths[1], places=(row - window.bottom, column - window.left))
    assert ours["noiseless_mast_tilt"] == pytest.approx(lean.mast, rel=1e-5)
    assert ours["noiseless_waterline_tilt"] == pytest.approx(lean.waterline, rel=1e-5)

    drawn = range_image(
        mesh, aspect=175.0, depression=6.7, pixel=1.5, roll=0.0, slant_range=3000.0, engine="embree"
    )
    profiles = [profile(fine, belief), profile(truth, flight)]
    for spread in (1.0, 0.0):
        extent = range_extent(drawn, slant_range=3000.0, ifov=500.0001e-6, spread=spread)
        profiles.append(flight.cnr * extent.fraction.sum(axis=0))
    # A share of the larger IFOV, which holds a whole pixel.
    np.testing.assert_allclose(ours["profile"], np.array(profiles), rtol=2e-6, atol=1e-6)
    assert ours["profile_correlation"] == pytest.approx(
        profile_correlation(profiles[0], profiles[1]), rel=1e-6
    )
    down_range = np.arange(250) - 124.5
    spike = down_range[profiles[2].argmax()]
    assert ours["profile_correlation_without_hangar"] == pytest.approx(
        profile_correlation(profiles[0], profiles[1], exclude=np.abs(down_range - spike) <= 4),
        rel=1e-6,
    )
    ends = (0.02, 0.02, 0.05, 0.05)
    told = [
        landmarks(one, down_range, hangar=(spike - 8, spike + 8), end=end)
        for one, end in zip(profiles, ends, strict=True)
    ]
    assert ours["hangar_spike_offset"] == pytest.approx(told[0].hangar - told[1].hangar, abs=1e-5)
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
            assert ours[name][k] == pytest.approx(value, rel=1e-4, nan_ok=True), name

    extent = measured_extent(fine, belief, slant_range=100e3)
    cnr = carrier_to_noise(100e3, reference=10**3.2, reference_range=100e3)
    for k, width in enumerate((30e-9, 50e-9)):
        # The plan of these tests has no target-free IFOVs' axis but one value, the default.
        expected = expected_profile(extent, pulse_width=width, cnr=cnr, target_free_ifovs=4000)
        np.testing.assert_allclose(ours["signature"][k, KINDS.index("measured")], expected, 1e-6)


def test_every_variable_of_the_store_is_made(several):
    assert set(several[0]) == {name for name, *_ in OF_VIEWS}


def test_signatures_that_are_learned_are_those_of_the_range_channel(at_hand):
    """Same view, same sensor: `expected` of the other channel, drawn at the flight's depression."""
    found, plan = flown(at_hand, depression=5.0)
    mesh = ncti.ships.load("roberts")
    image = range_image(mesh, aspect=175.0, depression=5.0, pixel=0.25, engine="embree")
    samples = int(image.hit.sum())
    if samples < 20_000:
        finer = 0.25 * max(math.sqrt(samples / 20_000), 0.25)
        image = range_image(mesh, aspect=175.0, depression=5.0, pixel=finer, engine="embree")
    extent = range_extent(image, slant_range=100e3)
    expected = expected_profile(
        extent, pulse_width=50e-9, cnr=10**3.2, target_free_ifovs=4000
    ).astype(np.float32)
    learned = cell(found, plan)["signature"][1, KINDS.index("learned")]
    np.testing.assert_array_equal(learned, expected)


def test_test_signatures_scatter_about_the_learned_ones(several):
    """Sixteen frames of the same ship: residuals of mean 0, other ones in each replicate."""
    found, plan = several
    first, second = (cell(found, plan, replicate=k)["signature"] for k in (0, 1))
    learned, test = KINDS.index("learned"), KINDS.index("test")
    np.testing.assert_array_equal(first[:, learned], second[:, learned])
    residual = np.stack([one[:, test] - one[:, learned] for one in (first, second)])
    assert not np.any(residual[0] == residual[1])
    # 250 bins, of which some 120 are independent at 30 ns: the mean is within 4 of its errors.
    scatter = residual.std(axis=-1)
    assert np.all(np.abs(residual.mean(axis=-1)) < 4 * scatter / math.sqrt(60))
    # The noise of 4,000 target-free IFOVs and 16 frames.
    assert np.all(scatter < 0.02 * first[:, learned].max(axis=-1))


def test_a_cell_is_the_same_in_another_grid(several, tmp_path, cache):
    """Whatever else there is: other gains, ratios, errors, replicates, and other windows."""
    found, plan = several
    alone, other = flown(
        fresh(tmp_path, cache), seed=7, replicates=1, mast_gain=3.0, cnr=[12.0, 20.0],
        range=[2.5, 3.0], offset=5.0,
    )  # fmt: skip
    ours = cell(alone, other, cnr=20.0, range=3.0)
    theirs = cell(found, plan, mast_gain=3.0, cnr=20.0)
    for name in ours:
        if name in FEET:
            bottom, left = (
                getattr(other.window, side) - getattr(plan.window, side)
                for side in ("bottom", "left")
            )
            ours_there, theirs_there = (
                np.argwhere(np.isfinite(one[name])) for one in (ours, theirs)
            )
            np.testing.assert_array_equal(ours_there + np.array([bottom, left]), theirs_there)
            np.testing.assert_array_equal(
                ours[name][np.isfinite(ours[name])], theirs[name][np.isfinite(theirs[name])]
            )
        else:
            np.testing.assert_array_equal(ours[name], theirs[name], err_msg=name)
    quieter = cell(alone, other, cnr=12.0, range=3.0)
    assert not np.array_equal(quieter["profile"], ours["profile"])


@pytest.mark.parametrize(("jitter", "passes"), [(0.0, 2), (50.0, 4)])
def test_a_pass_is_flown_once_and_recorded_once(jitter, passes, tmp_path, cache, monkeypatch):
    """Two gains, two replicates, two ratios; jitter is another one in each replicate."""
    flights, records = [], []
    fly_, record = flight_course.fly, flight_course.Pass.record
    monkeypatch.setattr(
        flight_course, "fly", lambda *a, **k: flights.append(k["reflectivity"]) or fly_(*a, **k)
    )
    monkeypatch.setattr(
        flight_course.Pass, "record", lambda self, rng: records.append(self) or record(self, rng)
    )
    folder = fresh(tmp_path, cache)
    changes = dict(jitter=jitter, transom_gain=[0.0, 1.0], cnr=[15.0, 20.0])
    found, _ = flown(folder, **changes)
    assert (len(flights), len(records)) == (passes, 8)
    # What is finished is found again; another filter flies and records again, but no more.
    again, _ = flown(folder, **changes)
    assert (len(flights), len(records)) == (passes, 8)
    for name, values in found.items():
        np.testing.assert_array_equal(values, again[name])
    flown(folder, range_filter=["cluster", "mean"], replicates=1, **changes | {"cnr": 15.0})
    assert (len(flights), len(records)) == (passes + 2, 10)


@pytest.mark.parametrize(
    ("change", "made"),
    [
        ({"seed": 5}, 2),
        ({"cnr": 15.0}, 2),
        ({"nedt": 0.3}, 2),
        ({"segmentation_threshold": 20.0}, 2),
        ({"profile_frames": 8}, 1),
        ({"ladar": LadarConfig(cnr=30.0)}, 2),
        ({"past": ("roberts", "duncan")}, 1),
    ],
)
def test_a_stage_is_made_again_for_what_it_depends_on(change, made, tmp_path, cache):
    folder = fresh(tmp_path, cache)
    for changed in ({}, change):
        flown(folder, replicates=1, **changed)
    assert len(list((folder / "flight").rglob("*.npz"))) == made


def test_a_ship_that_is_not_flown_past_is_only_learned(at_hand):
    found, _ = flown(at_hand, past=("duncan",))
    for name, values in found.items():
        if name != "signature":
            assert np.isnan(values).all()
    learned, test, measured = np.moveaxis(found["signature"], -2, 0)
    assert np.isfinite(learned).all() and np.isfinite(test).all()
    assert np.isnan(measured).all()
    there, _ = flown(at_hand)
    np.testing.assert_array_equal(there["signature"][..., :2, :], found["signature"][..., :2, :])


def test_nothing_but_noise_fails_nothing(at_hand):
    """At -30 dB nothing is seen: no landmarks, no likeness, a flat signature, no belief changed."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found, plan = flown(at_hand, cnr=-30.0, autofocus=True, segmentation_threshold=1e6)
    ours = cell(found, plan)
    assert np.all(ours["profile"][0] == 0)
    assert ours["profile_correlation"] == 0
    assert ours["closing_speed_error"] == 0
    assert np.isnan(ours["mast_tilt"]) and np.isnan(ours["hangar_spike_offset"])
    assert np.isnan(ours["mast_ratio"][0]) and np.isfinite(ours["mast_ratio"][1])
    measured = ours["signature"][:, KINDS.index("measured")]
    assert np.all(np.ptp(measured, axis=-1) <= 1e-6 * measured.max())
    assert np.isfinite(ours["noiseless_mast_tilt"])


@pytest.mark.parametrize(("aspect", "told"), [(164.0, False), (166.0, True), (194.0, True)])
def test_landmarks_are_told_near_the_stern(aspect, told, at_hand):
    found, plan = flown(at_hand, aspect=aspect, samples=90, pulse_rate=6000.0, replicates=1)
    assert np.isfinite(cell(found, plan)["stern_to_hangar"]).all() == told
    assert np.isfinite(found["profile_correlation"]).all()


def test_glinting_masts_are_an_input(several):
    """Three times the reflectivity of masts: more of them in the flight and its truth, as much
    in the synthetic profiles, which know nothing of it."""
    found, plan = several
    plain, glints = (
        cell(found, plan, mast_gain=gain, cnr=20.0)["mast_energy"] for gain in (1.0, 3.0)
    )
    by_source = dict(zip(SOURCES, zip(plain, glints, strict=True), strict=True))
    for name, (before, after) in by_source.items():
        if name in ("measured", "noiseless"):
            assert 1.5 * before < after < 3.1 * before
        else:
            assert before == after


@pytest.mark.parametrize("pointing", [-1.0, 0.4])
def test_a_wrong_pointing_leaves_the_ship_in_its_window(pointing, at_hand):
    """It seems to be 35 or 14 pixels aside, where the window follows it."""
    found, plan = flown(at_hand, errors=FlightErrors(pointing=pointing), replicates=1)
    right, wrong = (
        cell(found, plan, error=error) for error in (("none", 0.0), ("pointing", pointing))
    )
    shown = [np.nansum(one["intensity"]) for one in (right, wrong)]
    assert shown[1] == pytest.approx(shown[0], rel=0.05)
    columns = [np.nansum(one["intensity"], axis=0) for one in (right, wrong)]
    middle = [line @ np.arange(line.size) / line.sum() for line in columns]
    aside = middle[1] - middle[0]
    expected = math.radians(pointing) * math.cos(math.radians(6.7)) / 500e-6
    assert aside == pytest.approx(expected, abs=1.5)


@pytest.mark.parametrize("azimuth", ["pixel", "none"])
@pytest.mark.parametrize("mirror", ["exact", "rotation"])
def test_windows_of_cells_lie_in_the_shared_one(azimuth, mirror, at_hand):
    plan = planned(
        at_hand, "roberts", 175.0, azimuth=["pixel", "none"], mirror=["exact", "rotation"],
        errors=FlightErrors(pointing=[-1.0, 1.0]),
    ).flights  # fmt: skip
    mesh, whole = ncti.ships.load("roberts"), plan.window
    flight = plan.config.flight(175.0, **{name: getattr(plan.grid, name)[0] for name in FLOWN})
    for error in plan.grid.error:
        ours = window_of_cell(mesh, flight, error, EXACT, azimuth, mirror)
        assert whole.bottom <= ours.bottom and whole.left <= ours.left
        assert ours.bottom + ours.rows <= whole.bottom + whole.rows
        assert ours.left + ours.columns <= whole.left + whole.columns
        narrow = ship_window(mesh, flight)
        # As far to each side: a truth on the narrow one is in its middle.
        assert (ours.rows - narrow.rows) % 2 == (ours.columns - narrow.columns) % 2 == 0


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
    told = compared(lines, down_range, aspect=175.0, ship="connole")
    np.testing.assert_allclose(told["stern_to_hangar"], 33.0)
    others = compared(lines, down_range, aspect=175.0, ship="roberts")
    np.testing.assert_allclose(others["stern_to_hangar"], 65.0)


def test_other_bins_are_those_of_the_sweep(at_hand):
    """Half-metre bins hold as much as metre ones."""
    coarse, _ = flown(at_hand, replicates=1)
    fine, _ = flown(at_hand, replicates=1, ladar=LadarConfig(bin_width=0.5))
    assert fine["profile"].shape[-1] == 500
    pairs = fine["profile"].reshape(*coarse["profile"].shape, 2).sum(axis=-1)
    for k in (0, 1):  # points in space; spread pixels are binned to rounding, too
        np.testing.assert_allclose(
            pairs[..., k, :].sum(), coarse["profile"][..., k, :].sum(), rtol=1e-5
        )
    np.testing.assert_allclose(pairs[..., 0, :], coarse["profile"][..., 0, :], rtol=1e-5, atol=1e-3)


def test_lambertian_ships_reflect_so_in_flight_too(at_hand):
    even, plan = flown(at_hand, replicates=1)
    cosine, _ = flown(at_hand, replicates=1, ladar=LadarConfig(reflectance="lambertian"))
    ours, theirs = cell(cosine, plan), cell(even, plan)
    for k, source in enumerate(SOURCES):
        assert ours["profile"][k].sum() < 0.95 * theirs["profile"][k].sum(), source

"""Simulations: statistics, labels, reproducibility, and what they refuse."""

import math

import matplotlib.pyplot as plt
import numpy as np
import pytest
import trimesh
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import ncti
from ncti import simulate
from ncti.ladar import noise_floor, power_ratio

BOX = trimesh.creation.box((40.0, 8.0, 6.0))
BOX.apply_translation((0.0, 0.0, 3.0))
COARSE = {"ifov": 500e-6, "samples": 60, "line_rate": 60.0, "detectors": 2, "slant_range": 3000.0}


def profile(ship=BOX, **given):
    return simulate.range_profile(ship, **{"aspect": 30.0, "target_free_ifovs": 50, **given})


def image(ship=BOX, **given):
    return simulate.infrared_image(ship, **{"aspect": 30.0, **given})


def flight(ship=BOX, **given):
    return simulate.flight(ship, **{"aspect": 170.0, **COARSE, **given})


EVERY = pytest.mark.parametrize("simulated", [profile, image, flight])


def test_the_averaged_profile_is_the_expected_one_in_the_mean():
    """Student's t with 29 degrees of freedom in each of 250 bins; level 5e-6."""
    found = profile(frames=2000, rng=1)
    shorter = [profile(frames=50, rng=seed).values for seed in range(2, 32)]
    deviation = np.std(shorter, axis=0, ddof=1) * math.sqrt(50 / 2000)
    assert np.abs((found - found.expected).values / deviation).max() < 7.7


@EVERY
def test_a_mesh_that_is_no_solid_is_refused(simulated):
    inverted, opened = BOX.copy(), BOX.copy()
    inverted.invert()
    opened.update_faces(np.arange(len(opened.faces)) > 0)
    for wrong, reason in ((inverted, "inside out"), (opened, "is open")):
        with pytest.raises(ValueError, match=f"ship {reason}|ship is {reason}"):
            simulated(wrong)


def test_no_floor_is_left():
    """Beyond the ship and its pulse the expected profile is 0, and nowhere below."""
    found = profile(target_free_ifovs=4000)
    beyond = abs(found.down_range) > 40
    # sums of 4,000 floors, rounded
    rounding = 4000 * noise_floor() * np.finfo(float).eps * 100
    assert float(abs(found.expected[beyond]).max()) < rounding
    assert float(found.expected.min()) > -rounding
    assert float(found.expected.max()) > 1


def test_a_box_is_as_long_as_it_is():
    """Bow-on the returns of its ends are 40 m apart, but only the near one faces the sensor."""
    found = profile(aspect=0.0, depression=0.0, pulse_width=10e-9)
    peak = float(found.expected.idxmax("down_range"))
    assert abs(peak + 20.0) <= 0.5


@settings(max_examples=15)
@given(
    aspect=st.floats(-360, 360),
    pulse_width=st.floats(9.44e-9, 200e-9),
    slant_range=st.floats(5e3, 400e3),
    accuracy=st.floats(1e-3, 0.5),
)
def test_any_profile_says_its_error(aspect, pulse_width, slant_range, accuracy):
    found = profile(
        aspect=aspect,
        pulse_width=pulse_width,
        slant_range=slant_range,
        accuracy=accuracy,
        frames=1,
        ifov=1e-3,
    )
    assert np.isfinite(found).all()
    assert np.isfinite(found.expected).all()
    reached = found.attrs["error_bound"] <= accuracy
    assert found.attrs["accuracy_reached"] == ("yes" if reached else "no")
    assert found.attrs["pulse_width_ns"] == pytest.approx(pulse_width * 1e9)


def test_an_accuracy_out_of_reach_is_said():
    found = profile("texas", aspect=0.0, accuracy=1e-6, frames=1, pulse_width=10e-9)
    assert found.attrs["accuracy_reached"] == "no"
    assert 1e-6 < found.attrs["error_bound"] < 1e-3


def test_a_finer_accuracy_moves_the_profile_by_no_more_than_it_says():
    """Amplitudes are roots of extents: compared in the square, where extents are linear."""
    rough, fine = (profile("texas", frames=1, accuracy=a) for a in (0.02, 1e-4))
    difference = float(abs(rough.expected - fine.expected).sum() / fine.expected.sum())
    assert 0 < difference < rough.attrs["error_bound"] + fine.attrs["error_bound"]


def test_a_profile_does_not_depend_on_its_company():
    several = profile(aspect=[0.0, 30.0, 350.0])
    assert several.dims == ("aspect", "down_range")
    alone = profile(aspect=30.0)
    xr.testing.assert_identical(several.sel(aspect=30.0).drop_attrs(), alone.drop_attrs())
    assert not np.array_equal(several[0], several[1])
    bounds = [profile(aspect=each, frames=1).attrs["error_bound"] for each in (0.0, 30.0, 350.0)]
    assert several.attrs["error_bound"] == max(bounds)


@pytest.mark.parametrize("aspect", [40.0, 121.0])
def test_a_ship_with_like_sides_looks_alike_from_both(aspect):
    port, starboard = (profile(aspect=each, frames=1) for each in (aspect, 360.0 - aspect))
    np.testing.assert_allclose(port.expected, starboard.expected, atol=1e-9)


@EVERY
def test_a_seed_repeats_a_simulation(simulated):
    first, same, other = (simulated(rng=seed) for seed in (3, np.int64(3), 4))
    assert first.identical(same)
    assert not first.equals(other)
    assert first.attrs["seed"] == 3


@EVERY
def test_a_generator_is_used_as_it_is(simulated):
    rng = np.random.default_rng(3)
    first, second = simulated(rng=rng), simulated(rng=rng)
    assert not first.equals(second)
    assert first.equals(simulated(rng=np.random.default_rng(3)))
    assert "seed" not in first.attrs


@EVERY
def test_a_ship_is_a_name_a_path_or_a_mesh(simulated, tmp_path):
    path = tmp_path / "barge.stl"
    BOX.export(path)
    by_path, by_text, mesh = simulated(path), simulated(str(path)), simulated()
    assert by_path.equals(by_text)
    assert str(by_path.ship.values) == "barge"
    assert str(mesh.ship.values) == "mesh"
    by_name = simulated("duncan")
    assert str(by_name.ship.values) == "duncan"
    assert simulated(ncti.ships.load("duncan")).identical(by_name)


@EVERY
def test_everything_has_a_label_and_a_unit(simulated):
    found = simulated()
    every = [found] if isinstance(found, xr.DataArray) else list(found.data_vars.values())
    for one in (*every, *(found[name] for name in found.coords if name != "ship")):
        assert one.attrs["long_name"], one.name
        assert one.attrs["units"], one.name


@EVERY
def test_one_call_draws_it_with_a_title_that_is_whole(simulated):
    found = simulated("spruance")
    every = [found] if isinstance(found, xr.DataArray) else list(found.data_vars.values())
    for one in every:
        figure, axes = plt.subplots()
        one.plot(ax=axes)
        assert axes.get_title().startswith("ship = spruance, aspect = ")
        assert axes.get_title().endswith(" [degree]")
        assert axes.get_xlabel()
        assert axes.get_ylabel()
        plt.close(figure)


@EVERY
@pytest.mark.filterwarnings("ignore:The data type", "ignore:Consolidated metadata")
def test_results_can_be_stored(simulated, tmp_path):
    """Attributes and coordinates are plain values."""
    found = simulated()
    path = tmp_path / "s.zarr"
    (found.to_dataset() if isinstance(found, xr.DataArray) else found).to_zarr(path)
    assert dict(xr.open_zarr(path).sizes) == dict(found.sizes)


def test_an_image_shows_the_ship_as_large_as_it_is():
    """Without noise or spread: the area of the pixels that show it, within those of its outline."""
    found = image(
        aspect=90.0, depression=0.0, slant_range=5e3, nedt=0, target_spread=0, sea_spread=0
    )
    shown = found > 0
    assert np.unique(found).tolist() == [0.0, found.attrs["contrast_K"]]
    area, side = float(shown.sum()) * 0.75**2, 0.75
    assert abs(area - 40 * 6) <= 2 * (40 + 6) * side
    across = found.horizontal[shown.any("vertical")]
    assert abs(float(across.mean())) <= side
    up = found.vertical[shown.any("horizontal")]
    assert abs(float(up.mean()) - 3.0) <= side


def test_a_corrected_flight_shows_the_ship_where_it_is():
    found = flight(aspect=90.0)
    inside = found.corrected_intensity > 0
    pixel = 1.5
    assert abs(float(found.horizontal[inside.any("vertical")].mean())) < 2 * pixel
    # broadside all of the near side is half the beam nearer than the origin
    assert float(found.corrected_range.median()) == pytest.approx(-4.0, abs=2.0)
    assert found.attrs["line_rate"] == 60.0


def test_a_flight_takes_parameters_and_corrections():
    found = flight(jitter=50e-6, offset=3.0, aircraft_heading=10.0)
    assert found.attrs["aspect"] == pytest.approx(170.0)
    assert found.attrs["jitter"] == 50e-6
    plain = ncti.irar.Correction(azimuth="none", mirror="none")
    assert not flight(correction=plain).equals(flight())
    xr.testing.assert_equal(flight(correction=plain).intensity, flight().intensity)


@pytest.mark.parametrize(
    ("simulated", "given", "message"),
    [
        (profile, {"ship": 5}, "ship is of type int, but must be a name, a path or a"),
        (profile, {"ship": "bismarck"}, "unknown ship 'bismarck'"),
        (profile, {"aspect": 400.0}, "aspect is 400.0, but must be .* at most 360"),
        (profile, {"aspect": []}, r"aspect has shape \(0,\), but must be one number or a list"),
        (profile, {"aspect": [[1.0]]}, r"aspect has shape \(1, 1\)"),
        (profile, {"aspect": "bow"}, "aspect is 'bow'"),
        (profile, {"pulse_width": 5e-9}, "pulse_width is 5e-09, but must be .* at least 9.4"),
        (profile, {"pulse_width": math.nan}, "pulse_width is nan"),
        (profile, {"slant_range": -1.0}, "slant_range is -1.0"),
        (profile, {"frames": 0}, "frames is 0, but must be a whole number at least 1"),
        (profile, {"frames": 1.5}, "frames is 1.5"),
        (profile, {"accuracy": 0.0}, "accuracy is 0.0, but must be"),
        (profile, {"depression": 91.0}, "depression is 91.0"),
        (profile, {"ifov": 0.0}, "ifov is 0.0"),
        (profile, {"bin_width": 0.0}, "bin_width is 0.0"),
        (profile, {"bin_width": 1e-9}, "bin_width is 1e-09, but must be .* at least 0.015"),
        (profile, {"slant_range": 100.0}, "slant_range is 100.0, but must be .* at least 1000"),
        (profile, {"pulse_width": 1e-3}, "pulse_width is 0.001, but must be .* at most 1e-06"),
        (image, {"foo": 3}, "foo is no parameter of an image, but must be one of contrast_at_zero"),
        (flight, {"correction": "x"}, "correction is 'x', but must be an ncti.irar.Correction"),
        (profile, {"window": 20.0}, "window is 20 m, but must be at least"),
        (profile, {"cnr_db": 1584.9}, "cnr_db is 1584.9, but must be .* at most 200"),
        (profile, {"ifov": 1e-7}, "ifov is 1e-07 rad, but must be at least 1e-06 rad, 0.1 m at"),
        (profile, {"target_free_ifovs": -1}, "target_free_ifovs is -1"),
        (profile, {"rng": -1}, "rng is -1, but must be a seed"),
        (profile, {"rng": "today"}, "rng is 'today'"),
        (profile, {"rng": True}, "rng is True"),
        (image, {"ship": None}, "ship is of type NoneType"),
        (image, {"aspect": math.inf}, "aspect is inf"),
        (image, {"slant_range": 0.0}, "slant_range is 0.0"),
        (image, {"slant_range": 25}, "slant_range is 25, but must be .* at least 1000"),
        (image, {"ifov": 1e-9}, "ifov is 1e-09 rad, but must be at least 2e-06 rad, 0.1 m at"),
        (image, {"frames": 0}, "frames is 0"),
        (image, {"super_resolution": "deep"}, "super_resolution is 'deep'"),
        (image, {"phase": (0.0, 1.0)}, r"phase\[1\] is 1.0"),
        (image, {"nedt": -1.0}, "nedt is -1.0"),
        (image, {"rng": 1.0}, "rng is 1.0"),
        (flight, {"aspect": 400.0}, "aspect is 400.0"),
        (flight, {"slant_range": 1.0}, "slant_range is 1.0"),
        (flight, {"ship_heading": 3.0}, "ship_heading is no parameter of a flight, but must be"),
        (flight, {"speed": 3.0}, "speed is no parameter of a flight, but must be one of aircraft_"),
        (flight, {"cnr": 100.0}, "cnr is no parameter of a flight, but must be one of .*cnr_db"),
        (flight, {"cnr_db": 100.0}, "cnr_db is 100.0, but must be .* at most 90"),
        (flight, {"aircraft_heading": "north"}, "aircraft_heading is 'north'"),
        (flight, {"rng": None}, "rng is None"),
    ],
)
def test_a_mistake_is_one_sentence(simulated, given, message):
    with pytest.raises(ValueError, match=message) as told:
        simulated(**given)
    assert "\n" not in str(told.value)


def test_decibels_are_those_of_the_command_line():
    """32 dB are 10^3.2, the ratio that the sensors' functions take, and the default at 100 km."""
    asked, given = profile(cnr_db=32), profile()
    np.testing.assert_allclose(asked, given, rtol=1e-12)
    assert asked.attrs["cnr_db"] == pytest.approx(32)
    assert power_ratio(32) == pytest.approx(10**3.2, rel=1e-15)
    # Without noise, Equation C: amplitudes far above the floor grow as the root of the ratio.
    weak, strong = (profile(cnr_db=level).expected.max() for level in (100, 120))
    assert float(strong / weak) == pytest.approx(10, rel=1e-3)


def test_a_flight_takes_decibels_and_stores_the_ratio():
    assert flight(cnr_db=20).attrs["cnr"] == pytest.approx(100)

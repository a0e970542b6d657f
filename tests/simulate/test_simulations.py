"""Simulations are accurate as stated, labelled, reproducible, and refuse invalid arguments."""

import numpy as np
import pytest
import trimesh
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import ncti
from ncti import simulate

BOX = trimesh.creation.box((40.0, 8.0, 6.0))
BOX.apply_translation((0.0, 0.0, 3.0))
COARSE = {"ifov": 500e-6, "samples": 60, "line_rate": 60.0, "detectors": 2, "slant_range": 3000.0}


def profile(ship=BOX, **options):
    return simulate.range_profile(ship, **{"aspect": 30.0, "target_free_ifovs": 50, **options})


def image(ship=BOX, **options):
    return simulate.infrared_image(ship, **{"aspect": 30.0, **options})


def flight(ship=BOX, **options):
    return simulate.flight(ship, **{"aspect": 170.0, **COARSE, **options})


def test_symmetric_ship_has_equal_port_and_starboard_profiles():
    """Lines are mirrored, so even the error of coarse lines, some 1e-3, is the same."""
    port, starboard = (profile(aspect=aspect, accuracy=0.5).expected for aspect in (35.0, 325.0))
    np.testing.assert_allclose(starboard, port, rtol=0, atol=1e-9 * float(port.max()))


def test_non_solid_mesh_is_refused():
    inverted, opened = BOX.copy(), BOX.copy()
    inverted.invert()
    opened.update_faces(np.arange(len(opened.faces)) > 0)
    for wrong, reason in ((inverted, "inside out"), (opened, "is open")):
        with pytest.raises(ValueError, match=f"ship .*{reason}"):
            image(wrong)


@settings(max_examples=15)
@given(
    aspect=st.floats(-360, 360),
    pulse_width=st.floats(9.44e-9, 200e-9),
    slant_range=st.floats(5e3, 400e3),
    accuracy=st.floats(1e-3, 0.5),
)
def test_profiles_report_their_error_bound(aspect, pulse_width, slant_range, accuracy):
    simulated = profile(
        aspect=aspect,
        pulse_width=pulse_width,
        slant_range=slant_range,
        accuracy=accuracy,
        frames=1,
        ifov=1e-3,
    )
    assert np.isfinite(simulated).all()
    assert np.isfinite(simulated.expected).all()
    reached = simulated.attrs["error_bound"] <= accuracy
    assert simulated.attrs["accuracy_reached"] == ("yes" if reached else "no")
    assert simulated.attrs["pulse_width_ns"] == pytest.approx(pulse_width * 1e9)


def test_profiles_of_two_accuracies_differ_within_bounds():
    """Profiles of two accuracies differ by less than the sum of their error bounds."""
    rough, fine = (profile("texas", frames=1, accuracy=a) for a in (0.02, 1e-4))
    difference = float(abs(rough.expected - fine.expected).sum() / fine.expected.sum())
    assert 0 < difference < rough.attrs["error_bound"] + fine.attrs["error_bound"]


def test_profile_does_not_depend_on_other_aspects():
    together = profile(aspect=[0.0, 30.0, 350.0])
    assert together.dims == ("aspect", "down_range")
    single = profile(aspect=30.0)
    xr.testing.assert_identical(together.sel(aspect=30.0).drop_attrs(), single.drop_attrs())
    assert not np.array_equal(together[0], together[1])
    bounds = [
        profile(aspect=aspect, frames=1).attrs["error_bound"] for aspect in (0.0, 30.0, 350.0)
    ]
    assert together.attrs["error_bound"] == max(bounds)


@pytest.mark.parametrize("simulated", [image, flight])
def test_ship_may_be_a_name_path_or_mesh(simulated, tmp_path):
    path = tmp_path / "barge.stl"
    BOX.export(path)
    by_path, mesh = simulated(path), simulated()
    assert by_path.equals(simulated(str(path)))
    assert str(by_path.ship.values) == "barge"
    assert str(mesh.ship.values) == "mesh"
    by_name = simulated("duncan")
    assert str(by_name.ship.values) == "duncan"
    assert simulated(ncti.ships.load("duncan")).identical(by_name)


def test_mutating_a_mesh_does_not_affect_later_results(tmp_path):
    """Changing a loaded or given mesh afterwards does not change the cached ship."""
    path, mesh = tmp_path / "barge.stl", BOX.copy()
    BOX.export(path)
    by_path, by_mesh = image(path), image(mesh)
    ncti.ships.load(path).apply_scale(2.0)
    mesh.apply_scale(1.5)
    assert image(path).equals(by_path)
    assert not image(mesh).equals(by_mesh)


@pytest.mark.parametrize("simulated", [profile, image, flight])
def test_all_outputs_have_long_name_and_units(simulated):
    result = simulated()
    arrays = [result] if isinstance(result, xr.DataArray) else list(result.data_vars.values())
    for array in (*arrays, *(result[name] for name in result.coords if name != "ship")):
        assert array.attrs["long_name"], array.name
        assert array.attrs["units"], array.name


def test_image_shows_the_ship_at_true_size():
    """Without noise the area of ship pixels is right within the pixels of the outline."""
    thermal = image(
        aspect=90.0, depression=0.0, slant_range=5e3, nedt=0, target_spread=0, sea_spread=0
    )
    ship = thermal > 0
    assert np.unique(thermal).tolist() == [0.0, thermal.attrs["contrast_K"]]
    area, side = float(ship.sum()) * 0.75**2, 0.75
    assert abs(area - 40 * 6) <= 2 * (40 + 6) * side
    across = thermal.horizontal[ship.any("vertical")]
    assert abs(float(across.mean())) <= side
    up = thermal.vertical[ship.any("horizontal")]
    assert abs(float(up.mean()) - 3.0) <= side


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"pulse_width": 1e-6}, r"^window is 250.0 m, .* at least 303 m to hold mesh .* 1000 ns"),
        ({"ifov": 0.9e-6}, r"^ifov is 9e-07 rad, .* at least 1e-06 rad"),
    ],
)
def test_infeasible_window_or_ifov_is_refused(given, said):
    with pytest.raises(ValueError, match=said):
        profile(**given)


def test_narrowest_allowed_ifov_is_accepted():
    """In floating point 1e-6 times 100 km is slightly less than 0.1 m."""
    small = trimesh.creation.box((4.0, 4.0, 3.0))
    assert profile(small, ifov=1e-6, frames=1, accuracy=0.1).attrs["ifov_urad"] == 1.0


def test_too_many_ifovs_are_refused_before_rendering(monkeypatch):
    monkeypatch.setattr("ncti.simulate.profiles.extent_within", None)
    large = trimesh.creation.box((1700.0, 200.0, 300.0))
    with pytest.raises(ValueError, match=r"^ifov is 0.00015 rad, .* at least 0\.\d+ rad for 2500 "):
        profile(large, window=2500.0, slant_range=1e3)

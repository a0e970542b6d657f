"""A tiny sweep of all classifiers of range profiles: its store and its tables."""

import math

import numpy as np
import pytest
import xarray as xr
from classifier_sweep import BINS, NAMES, OWN, SCALARS, SHAPE, STATES, SWEEP, group
from sweeping import command, contents, fresh
from test_configuration import composed
from threadpoolctl import threadpool_limits

import ncti.ships
from ncti.evaluate import wilson_interval
from ncti.ladar import expected_profile, frame_moments, noise_floor, range_extent
from ncti.render import range_image
from sweeps.app import replace_axes
from sweeps.naming import Profiles, name_by_correlation, name_by_likelihood
from sweeps.prepare import prepare


def test_one_worker_makes_the_same_store(swept, tmp_path, cache):
    one = command(
        *SWEEP, "cluster.workers=1", "store=s.zarr", folder=tmp_path, cache=fresh(tmp_path, cache)
    )
    assert one.returncode == 0, one.stderr
    assert contents(tmp_path / "s.zarr") == contents(swept / "s.zarr")
    assert contents(tmp_path / "s-tables") == contents(swept / "s-tables")


@pytest.mark.parametrize("name", NAMES)
def test_answers_have_their_axes(name, swept):
    answers = group(swept, f"classification/{name}")
    own = {key: len(values) for key, values in OWN[name].items()}
    cell = {"pulse_width": 2, "range": 1}
    assert dict(answers.correct.sizes) == cell | own | SHAPE
    assert answers.predicted.sizes == answers.correct.sizes
    for key, values in OWN[name].items():
        assert answers[key].values.tolist() == values
    for key in SCALARS[name] | {"target_free_ifovs"}:
        assert answers[key].ndim == 0
    others = set().union(*(SCALARS[other] | set(OWN[other]) for other in NAMES))
    assert not set(answers.coords) & (others - SCALARS[name] - set(OWN[name]))
    state = group(swept, STATES[name])
    assert np.all(state.cell == 1)
    assert state.cell.sizes == answers.correct.sizes
    ship = xr.DataArray(np.arange(2), dims="ship")
    right = answers.predicted == ship
    if name == "mnn":
        assert answers.hidden.sizes == answers.loss.sizes == cell | own
        xr.testing.assert_equal(answers.ship_correct == 1, right)
        # The aspects are one of each group.
        right &= answers.predicted_bin == xr.DataArray(np.arange(3), dims="aspect")
        assert np.all(answers.presentations == 40)
        assert np.all((answers.loss > 0) & (answers.loss < 4))
    xr.testing.assert_equal(answers.correct == 1, right)
    assert 0 < right.mean() < 1


def test_every_array_says_what_it_holds(swept):
    """And of what unit, but for words."""
    tree = xr.open_datatree(swept / "s.zarr", engine="zarr")
    held = {node.path.strip("/"): node.to_dataset() for node in tree.subtree if node.has_data}
    assert set(held) == {
        *("range_profile", *STATES.values()),
        *(f"{kind}/{name}" for kind in ("classification", "tables") for name in NAMES),
    }
    for dataset in held.values():
        for array in dataset.variables.values():
            assert array.attrs["long_name"]
            assert array.dtype.kind not in "iuf" or array.attrs["units"]
        for array in dataset.data_vars.values():
            assert array.attrs["units"] == "1"
    profiles = held["range_profile"]
    assert profiles.lag.attrs["units"] == profiles.down_range.attrs["units"] == "m"
    for name in NAMES:
        assert held[f"tables/{name}"].attrs["receiver"] == "full_profile"
        flags = held[STATES[name]].cell.attrs
        assert flags["flag_meanings"] == "missing failed done"
        assert list(flags["flag_values"]) == [-1, 0, 1]


@pytest.mark.parametrize("name", NAMES)
def test_tables_are_fractions_of_the_answers(name, swept):
    """Intervals are between those of as many answers as there are, and as many views."""
    tables = group(swept, f"tables/{name}")
    answers = group(swept, f"classification/{name}")
    assert tables.aspect_bin.values.tolist() == BINS
    assert tables.aspect_low.values[:3].tolist() == [0, 45, 90]
    kinds = {"": "correct", "training_": "training_correct", "ship_": "ship_correct"}
    for prefix, correct in kinds.items():
        assert (f"{prefix}accuracy" in tables) == (correct in answers)
        if correct not in answers:
            continue
        replicates = 2 if "replicate" in answers[correct].dims else 1
        over = [key for key in ("replicate", "ship") if key in answers[correct].dims]
        by_aspect = answers[correct].mean(over)
        accuracy, n = tables[f"{prefix}accuracy"], tables[f"{prefix}n"]
        low, high = tables[f"{prefix}ci_low"], tables[f"{prefix}ci_high"]
        for number, label in enumerate(BINS[:3]):
            ours = by_aspect.isel(aspect=number, drop=True)
            stored = accuracy.sel(aspect_bin=label)
            np.testing.assert_allclose(stored, ours.transpose(*stored.dims), atol=1e-12)
            assert np.all(n.sel(aspect_bin=label) == 2 * replicates)
        stored = accuracy.sel(aspect_bin="overall")
        ours = by_aspect.mean("aspect").transpose(*stored.dims)
        np.testing.assert_allclose(stored, ours, atol=1e-12)
        assert np.all(n.sel(aspect_bin="overall") == 6 * replicates)
        wide, narrow = (wilson_interval(accuracy * n / k, n / k) for k in (replicates, 1))
        for low_end, middle, high_end in (
            (wide[0], low, narrow[0]),
            (narrow[1], high, wide[1]),
        ):
            assert np.all(low_end <= middle + 1e-12)
            assert np.all(middle <= high_end + 1e-12)


def test_profiles_and_covariances_are_the_librarys(swept):
    """Of a view, from its image on; the covariance's band is the dense matrix's."""
    image = range_image(
        ncti.ships.load("spruance"), aspect=45, depression=3.84, pixel=0.5, engine="embree"
    )
    extent = range_extent(image, slant_range=100e3, ifov=150e-6, bin_width=1.0, window=250.0)
    profiles = group(swept, "range_profile").sel(ship="spruance", aspect=45, range=100)
    bins = profiles.sizes["down_range"]
    for pulse_width in (30, 50):
        found = profiles.sel(pulse_width=pulse_width)
        signal = {"pulse_width": pulse_width * 1e-9, "cnr": 10**3.2, "target_free_ifovs": 4000}
        mean, dense = frame_moments(extent, **signal)
        # Half a unit in the last place of float32.
        np.testing.assert_allclose(found.expected, mean, rtol=2**-24)
        np.testing.assert_allclose(found.expected, expected_profile(extent, **signal), rtol=2**-24)
        band = found.covariance.values
        assert found.lag.values.tolist() == list(range(len(band)))
        whole = np.zeros((bins, bins))
        for lag in range(bins):
            n = np.arange(bins - lag)
            if lag < len(band):
                whole[n, n + lag] = whole[n + lag, n] = band[lag, : bins - lag]
                assert not band[lag, bins - lag :].any()
        np.testing.assert_allclose(whole, dense, rtol=2**-24, atol=2**-149)
        assert dense[0, 1] > 0.5 * dense[0, 0]  # it is a band, not a diagonal


def test_floors_are_the_noise_of_all_ifovs(swept):
    """4,000 target-free ones and the ship's own, at the edge of the window."""
    profiles = group(swept, "range_profile").sel(range=100, ship=["duncan"], aspect=[90])
    image = range_image(
        ncti.ships.load("duncan"), aspect=90, depression=3.84, pixel=0.5, engine="embree"
    )
    on_target = len(range_extent(image, slant_range=100e3, ifov=150e-6, bin_width=1.0).fraction)
    assert on_target > 10
    assert noise_floor() == pytest.approx((math.pi**3 / 32) ** 0.25)
    for number in range(2):
        expected = profiles.expected.isel(pulse_width=number).values[0]
        there = np.ones((1, 1), dtype=bool)
        floor = Profiles(expected, expected[None, None], there, np.array([90.0]), (1,)).floor
        np.testing.assert_allclose(floor, (4000 + on_target) * noise_floor(), rtol=2**-23)


@pytest.mark.parametrize("number", [0, 1])
def test_a_cell_is_named_by_its_own_profiles(number, swept):
    """Those of its pulse width in the store, whose floor is in them."""
    config = prepare(composed(*replace_axes(SWEEP))).config
    held = group(swept, "range_profile").isel(pulse_width=number, range=0)
    views = {"view": ("ship", "aspect")}
    profiles = Profiles(
        expected=held.expected.stack(views).transpose("view", "down_range").values,
        averaged=held.averaged.stack(views)
        .transpose("replicate", "frame_count", "view", "down_range")
        .values,
        there=np.ones((2, 3), dtype=bool),
        aspects=held.aspect.values,
        frame_count=(2, 4),
    )
    covariance = held.covariance.stack(views).transpose("view", "lag", "down_range").values
    settings = {"classifier": config.classifier}
    with threadpool_limits(1):
        wanted = {
            "correlation": name_by_correlation(profiles, **settings),
            "likelihood": name_by_likelihood(profiles, covariance, **settings),
        }
    for name, arrays in wanted.items():
        answers = group(swept, f"classification/{name}").isel(pulse_width=number, range=0)
        for kind, values in arrays.items():
            stored = answers[kind].values
            np.testing.assert_allclose(stored, values.reshape(stored.shape), rtol=1e-5, atol=1e-9)

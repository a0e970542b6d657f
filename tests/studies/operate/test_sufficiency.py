"""Frame counts at which shares reach a level, and the cheapest settings, are right."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from sklearn.isotonic import IsotonicRegression

from studies.operate.sufficiency import cheapest_setting, crossing, isotonic


@given(st.lists(st.floats(0, 1), min_size=1, max_size=9))
def test_isotonic_values_match_scikit_learn(values):
    exact = IsotonicRegression().fit_transform(np.arange(len(values)), values)
    assert np.allclose(isotonic([values])[0], exact, atol=1e-12)


@pytest.mark.parametrize("step", [0.5, 0.25])
@pytest.mark.parametrize("threshold", [3.0, 17.3, 61.0])
def test_crossing_of_a_logistic_is_its_threshold(threshold, step):
    log = np.arange(0, 7 + step, step) * np.log(2)
    logit = np.log(0.95 / 0.05)
    shares = 1 / (1 + np.exp(-(log - np.log(threshold)) * 2 - logit))
    place = crossing(shares, np.exp(log))
    # Between places a step h apart, linear interpolation errs by h^2 / 8 of the second derivative,
    # at most 2^2 * 0.0963, over the slope at the level, 2 * 0.95 * 0.05, or half of that above it.
    bound = (step * np.log(2)) ** 2 / 8 * 4 * 0.0963 / (2 * 0.95 * 0.05 / 2)
    assert abs(np.log(place / threshold)) < bound


def test_crossing_at_the_ends_and_half_way():
    shares = [[0.96, 0.97, 0.98], [0.1, 0.2, 0.949], [0.0, 0.0, 0.95], [0.0, 0.9, 1.0]]
    places = [2, np.inf, 8, 4 * 2**0.5]
    assert crossing(shares, [2, 4, 8]).tolist() == pytest.approx(places)


@given(st.integers(0, 2**32 - 1))
def test_cheapest_setting_minimises_cost(seed):
    rng = np.random.default_rng(seed)
    axes = {"range": [50.0, 100.0], "cnr": [20.0, 26.0, 32.0], "ifov": [75.0, 150.0]}
    values = rng.random((2, 3, 2, 21))
    values[rng.random(values.shape) < 0.3] = np.inf
    values[1, :, :, 0] = np.inf
    cost = xr.DataArray(values, axes, ("range", "cnr", "ifov", "resample"))
    least = cheapest_setting(cost, ("cnr", "ifov")).transpose("range")
    costs = values[0, :, :, 0]
    assert least.cost.values[0] == costs.min() and least.cost.values[1] == np.inf
    minima = np.sort(values[0, :, :, 1:].min(axis=(0, 1)))
    if np.isfinite(costs.min()):
        c, i = np.unravel_index(costs.argmin(), costs.shape)
        assert (least.cnr.values[0], least.ifov.values[0]) == (axes["cnr"][c], axes["ifov"][i])
    assert least.cost_low.values[0] in minima[:2] and least.cost_high.values[0] in minima[-2:]
    assert np.isnan(least.cnr.values[1]) and np.isnan(least.chosen.values[1])

"""Profile vectors have no floor and a peak of one, independent of gain and offset."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ncti.features import profile_vector

values = st.floats(-1e6, 1e6, allow_nan=False)


def test_the_floor_is_the_mean_of_both_ends():
    ends = np.concatenate([np.full(50, 1.0), [9.0], np.full(50, 3.0)])
    assert profile_vector(ends)[[0, 50, -1]] == pytest.approx([-1 / 7, 1, 1 / 7])


@given(arrays(float, (3, 50), elements=values), st.floats(0.01, 100), st.floats(-1e5, 1e5))
def test_profile_vector_ignores_gain_and_floor(profile, gain, floor):
    plain, moved = profile_vector(profile), profile_vector(gain * profile + floor)
    assert np.isfinite(moved).all()
    # Adding a floor rounds at 2e-16 of the largest value; the peak above the floor scales that.
    peak = (profile - profile[:, [0, 1, 2, 3, -4, -3, -2, -1]].mean(axis=1, keepdims=True)).max(1)
    clear = peak > 1e-6 * (np.abs(profile).max() + abs(floor) / gain)
    np.testing.assert_allclose(plain[clear], moved[clear], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("flat", [0.0, 4000.1, 1e300, 5e-324])
def test_flat_profile_gives_a_zero_vector(flat):
    np.testing.assert_array_equal(profile_vector(np.full(250, flat)), np.zeros(250))

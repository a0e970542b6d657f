"""The histogram-cluster average is the mean of the most populated window of ranges."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from ncti.irar.looks import histogram_cluster_average

# Quarters tie often, and their differences are exact.
quarters = st.integers(-40, 40).map(lambda n: n / 4)
maybe = st.one_of(quarters, st.just(math.nan))


def plain_average(looks, window):
    """Return the average by its definition, window by window."""
    known = sorted(r for r in looks if not math.isnan(r))
    held = [[r for r in known if 0 <= r - begin <= window] for begin in known]
    if not held:
        return math.nan
    return np.mean(min(held, key=lambda h: (-len(h), h[-1] - h[0], h[0])))


shapes = array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=9)


@given(
    arrays(float, shapes.filter(lambda shape: shape[-1] > 0), elements=maybe),
    st.sampled_from([0.25, 1.0, 4.0, 30.0]),
)
def test_it_is_the_mean_of_the_most_populated_window(ranges, window):
    averages = histogram_cluster_average(ranges, window=window)
    assert averages.shape == ranges.shape[:-1]
    flat = ranges.reshape(-1, ranges.shape[-1])
    expected = [plain_average(looks, window) for looks in flat]
    np.testing.assert_allclose(averages.ravel(), expected, rtol=0, atol=1e-13)

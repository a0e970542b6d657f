"""Range profile: every intensity once, in the bin of its range."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ncti.irar.profiling import range_profile

intensities = st.floats(0, 1e6)
# Quarters lie on the edges of bins often.
ranges = st.one_of(st.integers(-80, 80).map(lambda n: n / 4), st.floats(-20, 20), st.just(math.nan))


@given(
    arrays(float, (4, 5), elements=intensities),
    arrays(float, (4, 5), elements=ranges),
    st.sampled_from([0.25, 1.0, 3.0]),
    st.sampled_from([-10.0, -2.5, 0.0]),
    st.integers(1, 30),
)
def test_bins_are_those_of_the_definition(intensity, down_range, bin_width, start, bins):
    profile = range_profile(intensity, down_range, start=start, bins=bins, bin_width=bin_width)
    expected = np.zeros(bins)
    for n in range(bins):
        near = start + n * bin_width
        for power, r in zip(intensity.ravel(), down_range.ravel(), strict=True):
            if near <= r < near + bin_width:
                expected[n] += power
    np.testing.assert_allclose(profile, expected, rtol=1e-14)

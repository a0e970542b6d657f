"""A range profile sums the intensities whose ranges fall into each bin."""

import math

import numpy as np
from flown import flight
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ncti.irar import Snapshot, Window, profile

intensities = st.floats(0, 1e6)
# Quarters lie on the edges of bins often.
ranges = st.one_of(st.integers(-80, 80).map(lambda n: n / 4), st.floats(-20, 20), st.just(math.nan))


@given(
    arrays(float, (4, 5), elements=intensities),
    arrays(float, (4, 5), elements=ranges),
    st.sampled_from([0.25, 1.0, 3.0]),
    st.integers(1, 30),
)
def test_profile_bins_match_their_definition(intensity, down_range, bin_width, bins):
    flown, window = flight(), Window(bottom=0, left=0, rows=4, columns=5)
    row, column, range_ = np.arange(4.0), np.arange(5.0), down_range + flown.slant_range
    image = Snapshot(window, row, column, intensity, range_, intensity, np.ones((4, 5), int))
    expected, start = np.zeros(bins), -bins * bin_width / 2
    for n in range(bins):
        near = start + n * bin_width
        for power, r in zip(intensity.ravel(), (range_ - flown.slant_range).ravel(), strict=True):
            if near <= r < near + bin_width:
                expected[n] += power
    computed = profile(image, flown, bins=bins, bin_width=bin_width)
    np.testing.assert_allclose(computed, expected, rtol=1e-14)

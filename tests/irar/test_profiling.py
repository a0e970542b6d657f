"""Range profile: every intensity once, in the bin of its range."""

import math

import numpy as np
import pytest
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


@given(arrays(float, (6, 7), elements=intensities), arrays(float, (6, 7), elements=ranges))
def test_energy_is_conserved_at_any_bin(intensity, down_range):
    """All that has a range in the window arrives, once; finer bins add up to coarser ones."""
    whole = intensity[~np.isnan(down_range)].sum()
    coarse = range_profile(intensity, down_range, start=-20.0, bins=41)
    # Sums of 42 terms in another order.
    assert coarse.sum() == pytest.approx(whole, rel=1e-13)
    fine = range_profile(intensity, down_range, start=-20.0, bins=164, bin_width=0.25)
    np.testing.assert_allclose(fine.reshape(41, 4).sum(axis=-1), coarse, rtol=1e-13)


def test_a_grazing_deck_is_a_comb_and_a_slanted_face_is_flat():
    """Rows of 0.8 m on a deck at 6.7 deg lie 6.86 m apart in range: one bin of seven."""
    spacing = 0.8 / math.sin(math.radians(6.7))
    deck = np.broadcast_to((np.arange(8) * spacing)[:, None], (8, 10))
    profile = range_profile(np.ones(deck.shape), deck, start=0.0, bins=60)
    at = np.flatnonzero(profile)
    assert profile[at].tolist() == [10.0] * 8
    assert set(np.diff(at).tolist()) <= {6, 7}
    face = np.arange(400) / 10 + 0.05
    flat = range_profile(np.full(400, 0.5), face, start=0.0, bins=40)
    np.testing.assert_array_equal(flat, np.full(40, 5.0))

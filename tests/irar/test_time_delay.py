"""Time delay and integration averages the columns that its definition names."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ncti.irar import time_delay_integrate


@given(
    arrays(float, (3, 2, 9), elements=st.integers(-1000, 1000).map(float)),
    st.integers(1, 3),
)
def test_integrated_columns_match_their_definition(samples, detectors):
    samples = samples[:detectors]
    expected = np.empty(samples.shape[1:])
    for line, c in np.ndindex(expected.shape):
        looks = [samples[k, line, c + k] for k in range(detectors) if c + k < 9]
        expected[line, c] = np.mean(looks)
    columns = time_delay_integrate(samples)
    np.testing.assert_allclose(columns, expected, rtol=0, atol=1e-12)

"""Fairing of hulls: the curves of SciPy's monotone cubics, to the bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.interpolate import PchipInterpolator

from ncti.ships.fairing import MonotoneCubic

HEIGHTS = st.floats(-50, 50).map(lambda y: round(y, 3))  # m: flat, steep and broken edges


@given(st.data())
def test_curves_are_those_of_scipy(data):
    """2 to 12 knots; between the knots, on them, and half a metre within the ends."""
    count = data.draw(st.integers(2, 12))
    x = np.cumsum(data.draw(arrays(float, count, elements=st.floats(0.1, 30))))
    y = data.draw(arrays(float, (count, 2), elements=HEIGHTS))
    places = np.concatenate([np.linspace(x[0], x[-1], 101), x])
    assert np.array_equal(MonotoneCubic.through(x, y)(places), PchipInterpolator(x, y)(places))


@pytest.mark.parametrize("sign", [1, -1])
def test_curve_is_as_monotone_as_its_knots(sign):
    x = np.array([0.0, 1.0, 1.1, 8.0, 30.0])
    y = sign * np.array([[0.0], [5.0], [5.0], [5.5], [90.0]])
    curve = sign * MonotoneCubic.through(x, y)(np.linspace(0, 30, 3001))[:, 0]
    assert np.diff(curve).min() >= -1e-12 * 90  # of rounding

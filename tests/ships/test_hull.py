"""Hull lines between stations are monotone where the stations are."""

import numpy as np
import pytest

from ncti.ships.hull import Hull


@pytest.mark.parametrize("sign", [1, -1])
def test_a_deck_is_as_monotone_as_its_stations(sign):
    """A break of deck stays a step without overshoot."""
    x = np.array([0.0, 1.0, 1.1, 8.0, 30.0])
    y = sign * np.array([0.0, 5.0, 5.0, 5.5, 90.0])
    hull = Hull(30.0, np.stack([x, y, y, y], axis=1), 0.0, 0.0, 0.0)
    places = np.linspace(0, 30, 3001)
    for curve in hull.deck_edge(places):
        assert np.diff(sign * curve).min() >= -1e-12 * 90  # of rounding
        np.testing.assert_allclose(curve[[0, 100, 110, 800, 3000]], y, atol=1e-12)
